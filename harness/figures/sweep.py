"""Curves over what a study varies: an ablation's axes, or the tolerance of a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import polars as pl

from harness.config import RunSection
from harness.errors import InputError
from harness.figures.charts import (
    chart_grid,
    is_first,
    model_legend,
    name_vertical,
    panel_blocks,
)
from harness.figures.source import BOX, Cell, NothingToDrawError, order_models
from harness.figures.style import TWO_COLUMNS_IN, model_style, new_figure, plain
from harness.statistics import mean_estimate

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from harness.figures.source import RunSource
    from harness.figures.style import SeriesStyle
    from harness.statistics import MeanEstimate

AXIS = "grid."
METRICS = {"precision": "precision", "accuracy": "accuracy", "aurc": "AURC"}
"""Rows of the figure: a record's field and its name in print."""
LOGARITHMIC = frozenset({"aurc"})
"""Metrics that differ by factors; linear below `LINEAR_BELOW`, for they can be 0."""
LINEAR_BELOW = 0.001
NAMES = {
    "scenes.views": "views",
    "scenes.depth_noise.subpixel_px": "disparity noise (px)",
    "pipeline.training.points": "training points",
    "protocol.reported_tolerance_m": "tolerance (mm)",
    "tolerance_m": "tolerance (mm)",
}
UNITS = {"_m": ("mm", 1000.0), "_px": ("px", 1.0), "_deg": ("degrees", 1.0)}
"""What a key's ending says: the unit in print, and its number in one of the key's own."""
LOG_RATIO = 8.0
"""An axis whose values span a greater ratio is logarithmic."""
DODGE = 0.35
"""Share of the least gap between two steps over which models stand beside each other."""

LETTER = 0.042
"""Width of a letter, by that of the narrowest panel."""

Step = float | str


@dataclass(frozen=True, eq=False)
class Sweep:
    """Records over the steps of one axis.

    Attributes
    ----------
    key
        Of the configuration, or a choice's name.
    frame
        Scored records, with the step in the column ``step``.
    held
        What the other axes are held at, in words; empty without any.
    seed
        Of the intervals' resampling.
    """

    key: str
    frame: pl.DataFrame
    held: str = ""
    seed: int = 0

    @property
    def steps(self) -> list[Step]:
        """Its steps: numbers by size, names as they come."""
        found = self.frame["step"].unique(maintain_order=True).to_list()
        return sorted(found) if self.frame["step"].dtype.is_numeric() else found

    @property
    def label(self) -> str:
        """The axis' name in print, with its unit."""
        if self.key in NAMES:
            return NAMES[self.key]
        name = self.key.rpartition(".")[2]
        for ending, (unit, _) in UNITS.items():
            if name.endswith(ending):
                return plain(f"{name.removesuffix(ending).replace('_', ' ')} ({unit})")
        return plain(name.replace("_", " "))

    def positions(self) -> npt.NDArray[np.float64]:
        """Where the steps stand on the axis: numbers in their unit in print, names evenly."""
        steps = self.steps
        if any(isinstance(step, str) for step in steps):
            return np.arange(len(steps), dtype=np.float64)
        factors = [value for ending, (_, value) in UNITS.items() if self.key.endswith(ending)]
        return np.array(steps, dtype=np.float64) * (factors[0] if factors else 1.0)


def tolerance_sweep(source: RunSource) -> Sweep:
    """Take a run's records over the tolerances at which they were scored.

    Raises
    ------
    NothingToDrawError
        It was scored at one alone.
    """
    rows = [record for record in source.records if record.status == "ok"]
    columns = ("category", "completion", "model", "object_name", "tolerance_m", *METRICS)
    frame = pl.DataFrame(
        [[getattr(record, name) for name in columns] for record in rows],
        schema={
            name: pl.Float64 if name in ("tolerance_m", *METRICS) else pl.String for name in columns
        },
        orient="row",
    ).rename({"tolerance_m": "step"})
    if frame["step"].n_unique() < 2:
        raise NothingToDrawError("the run was scored at one tolerance alone")
    return Sweep(key="tolerance_m", frame=frame, seed=source.config.run.seed)


def read_sweeps(ablation: Path) -> dict[str, Sweep]:
    """Read an ablation's axes, each with the others at their first cell's step.

    Parameters
    ----------
    ablation
        The folder that ``harness ablate`` wrote.

    Returns
    -------
    sweeps
        By the axis' last name, or its whole one if two share that; axes of one step are left out.

    Raises
    ------
    InputError
        The folder holds no ablation, or its records cannot be used.
    """
    path = ablation / "ablation.parquet"
    remedy = "pass a folder that `harness ablate` wrote"
    if not path.is_file():
        raise InputError(f"{ablation} holds no ablation.parquet; {remedy}")
    try:
        frame = pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path} cannot be read ({reason}); {remedy}") from None
    needed = ("category", "completion", "model", "object_name", "status", "cell", *METRICS)
    if missing := [name for name in needed if name not in frame.columns]:
        raise InputError(f"{path} has no column '{missing[0]}'; {remedy}")
    axes = [name for name in frame.columns if name.startswith(AXIS)]
    if not axes:
        raise InputError(f"{path} has no column '{AXIS}KEY' for what was varied; {remedy}")
    if empty := [name for name in axes if frame[name].null_count()]:
        raise InputError(f"{path} leaves '{empty[0]}' empty in a cell; {remedy}")
    frame = frame.sort("cell", maintain_order=True)
    first = frame.head(1)
    sweeps = {}
    for axis in axes:
        others = [name for name in axes if name != axis]
        kept = [pl.col(name) == first[name][0] for name in others]
        own = frame.filter(pl.col("status") == "ok", *kept).rename({axis: "step"})
        if own["step"].dtype == pl.Boolean:
            own = own.with_columns(pl.col("step").replace_strict({True: "on", False: "off"}))
        elif not own["step"].dtype.is_numeric():
            own = own.with_columns(pl.col("step").cast(pl.String))
        if own["step"].n_unique() < 2:
            continue
        held = ", ".join(f"{_short(name)} {first[name][0]}" for name in others)
        name = _short(axis)
        if sum(_short(other) == name for other in axes) > 1:
            name = axis.removeprefix(AXIS)
        sweeps[name] = Sweep(key=axis.removeprefix(AXIS), frame=own, held=held)
    return sweeps


def _short(axis: str) -> str:
    return axis.rpartition(".")[2]


def draw_sweep(
    sweep: Sweep, *, classes: Sequence[str] = RunSection().classes
) -> tuple[Figure, str]:
    """Draw means with intervals over an axis; returns the figure and its caption.

    Parameters
    ----------
    sweep
        With two steps or more.
    classes
        The classes' order; others follow.
    """
    panels = sweep_panels(sweep, classes=classes)
    models = order_models(set(sweep.frame["model"]))
    places = _dodged(sweep, models)
    rows = len(panel_blocks(len(panels)))
    figure = new_figure(
        width_in=TWO_COLUMNS_IN, height_in=0.25 + (0.3 + 1.15 * len(METRICS)) * rows
    )
    by_metric: dict[str, list[Axes]] = {metric: [] for metric in METRICS}
    for panel, charts in chart_grid(figure, panels=len(panels), charts=len(METRICS)):
        title, frame = panels[panel]
        charts[0].set_title(title)
        for axes, (metric, name) in zip(charts, METRICS.items(), strict=True):
            by_metric[metric].append(axes)
            for model in models:
                own = frame.filter(pl.col("model") == model)
                means = step_means(own, metric=metric, steps=sweep.steps, seed=sweep.seed)
                _draw_curve(axes, places[model], means, style=model_style(model))
            _finish(axes, sweep, bottom=axes is charts[-1])
            name_vertical(axes, name, first=is_first(panel, panels=len(panels)))
    for metric, charts in by_metric.items():
        _share_scale(charts, logarithmic=metric in LOGARITHMIC)
    model_legend(figure, models)
    return figure, (
        "means over scenes with 95 % intervals over "
        f"{sweep.frame['object_name'].n_unique()} objects; AURC: less is better"
        + (f"; {sweep.held}" if sweep.held else "")
    )


def sweep_panels(sweep: Sweep, *, classes: Sequence[str]) -> list[tuple[str, pl.DataFrame]]:
    """Split a sweep's records into panels, each with its title.

    A panel is a class and test set; a class alone where the axis itself chooses among test sets
    or completers, so that its steps stand beside each other.
    """
    frame = sweep.frame
    order = {name: place for place, name in enumerate(classes)}
    categories = sorted(
        frame["category"].unique(), key=lambda name: (order.get(name, len(order)), name)
    )
    chosen = frame.group_by("category", "step").agg(pl.col("completion").n_unique() == 1)
    if chosen["completion"].all() and frame["completion"].n_unique() > 1:
        return [(name, frame.filter(pl.col("category") == name)) for name in categories]
    panels = []
    for category in categories:
        own = frame.filter(pl.col("category") == category)
        completions = sorted(own["completion"].unique(), key=lambda name: (name == BOX, name))
        panels += [
            (Cell(category, name).label, own.filter(pl.col("completion") == name))
            for name in completions
        ]
    return panels


def step_means(
    frame: pl.DataFrame, *, metric: str, steps: Sequence[Step], seed: int
) -> list[MeanEstimate]:
    """Mean of a metric over the scenes of each step, with its interval."""
    found = []
    for step in steps:
        own = frame.filter(pl.col("step") == step)
        values = own[metric].cast(pl.Float64).fill_null(np.nan).to_numpy()
        objects = own["object_name"].to_numpy().astype(np.str_)
        found.append(mean_estimate(values, objects=objects, seed=seed))
    return found


def _draw_curve(
    axes: Axes,
    places: npt.NDArray[np.float64],
    means: Sequence[MeanEstimate],
    *,
    style: SeriesStyle,
) -> None:
    values = np.array([np.nan if item.mean is None else item.mean for item in means])
    axes.plot(
        places,
        values,
        color=style.colour,
        marker=style.marker,
        linestyle=style.line,
        linewidth=1.0,
    )
    for place, item in zip(places, means, strict=True):
        if item.low is not None and item.high is not None:
            axes.plot(
                [place, place],
                [item.low, item.high],
                color=style.colour,
                linewidth=0.8,
                solid_capstyle="butt",
            )


def _dodged(sweep: Sweep, models: Sequence[str]) -> Mapping[str, npt.NDArray[np.float64]]:
    """Positions (steps,) of each model, beside each other so that intervals can be told apart."""
    places = sweep.positions()
    shares = (np.arange(len(models)) - (len(models) - 1) / 2) / max(len(models), 1) * DODGE
    if is_logarithmic(places):
        moved = [places * np.exp(share * np.diff(np.log(places)).min()) for share in shares]
    else:
        moved = [places + share * np.diff(places).min() for share in shares]
    return dict(zip(models, moved, strict=True))


def is_logarithmic(places: npt.NDArray[np.float64]) -> bool:
    """Whether an axis' steps (n,) span so much that they are drawn by their logarithm."""
    return bool(places.min() > 0 and places.max() / places.min() >= LOG_RATIO)


def is_crowded(places: npt.NDArray[np.float64], names: Sequence[str]) -> bool:
    """Whether names (n,) under their places (n,) on an axis would touch each other."""
    along = np.log(places) if is_logarithmic(places) else places
    along = (along - along[0]) / (along[-1] - along[0])
    lengths = np.array([len(name) for name in names])
    needed = (lengths[1:] + lengths[:-1] + 2) / 2 * LETTER
    return bool((np.diff(along) < needed).any())


def _finish(axes: Axes, sweep: Sweep, *, bottom: bool) -> None:
    places = sweep.positions()
    if is_logarithmic(places):
        axes.set_xscale("log")
    names = [
        plain(step) if isinstance(step, str) else f"{place:g}"
        for step, place in zip(sweep.steps, places, strict=True)
    ]
    axes.set_xticks(places, names)
    axes.minorticks_off()
    axes.tick_params(axis="x", labelbottom=bottom)
    if is_crowded(places, names):
        for label in axes.get_xticklabels():
            label.set(rotation=45, ha="right", rotation_mode="anchor")
    if bottom:
        axes.set_xlabel(sweep.label)


def _share_scale(charts: Sequence[Axes], *, logarithmic: bool) -> None:
    """Give the panels of a metric one vertical axis."""
    limits = [axes.get_ylim() for axes in charts]
    low, high = min(low for low, _ in limits), max(high for _, high in limits)
    for axes in charts:
        if logarithmic:
            axes.set_yscale("symlog", linthresh=LINEAR_BELOW, linscale=0.5)
            axes.set_yticks([0, 0.001, 0.01, 0.1, 1], ["0", "0.001", "0.01", "0.1", "1"])
            axes.minorticks_off()
        axes.set_ylim(0 if logarithmic else low, high)
