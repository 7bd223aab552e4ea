"""Risk against coverage: of the most confident decisions, the share that is wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.calibration import COVERAGES, mean_risk, scene_risks
from harness.figures.charts import (
    chart_grid,
    is_first,
    model_legend,
    name_vertical,
    panel_blocks,
)
from harness.figures.source import PREFERRED_MODEL, Cell, order_models
from harness.figures.style import (
    GREY,
    RANDOM,
    TWO_COLUMNS_IN,
    SeriesStyle,
    model_style,
    new_figure,
)
from harness.statistics import bootstrap_interval

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from harness.calibration.series import ScenePoints
    from harness.figures.source import RunSource

Floats = npt.NDArray[np.float64]

CONFIDENCE = "confidence"
INTERVAL_AT = np.array([10, 20, 30, 40, 50, 60, 70, 80, 90, 100])
"""Coverages, percent, at which intervals are computed; bands are drawn between them."""
LINEAR_BELOW = 0.1
"""Risk, percent: above it the scale is logarithmic, for models differ by factors."""
MARKER_AT = (24, 49, 74, 99)
BASELINES = {
    "nearest": SeriesStyle(f"{PREFERRED_MODEL} by distance to the data", GREY, "None", "dashed"),
    "random": replace(RANDOM, label=f"{PREFERRED_MODEL} in random order", marker="None"),
}
"""Other orders of the metric model's decisions."""


def draw_risk_coverage(source: RunSource) -> tuple[Figure, str]:
    """Draw every model's curve in each class and test set; returns the figure and its caption.

    Raises
    ------
    NothingToDrawError
        The run recorded no scenes.
    """
    read = source.points
    cells = source.answered_cells
    figure = new_figure(
        width_in=TWO_COLUMNS_IN, height_in=0.5 + 1.75 * len(panel_blocks(len(cells)))
    )
    models = order_models(set(read.models))
    for panel, (axes,) in chart_grid(figure, panels=len(cells), charts=1):
        cell = cells[panel]
        _draw_cell(axes, source, cell, models)
        axes.set_title(cell.label)
        axes.set_xlabel("coverage (%)")
        first = is_first(panel, panels=len(cells))
        name_vertical(axes, "risk: wrong decisions (%)", first=first)
    others = list(BASELINES.values()) if PREFERRED_MODEL in models else []
    model_legend(figure, models, others=others, rows=2)
    count = len({scene.scene_id for scenes in read.cells.values() for scene in scenes})
    return figure, (
        f"mean over {count} scenes, decisions ranked by the confidence in them; bands are 95 % "
        f"intervals over objects, of {', '.join(_banded(models))}; on the mesh within "
        f"{1000 * source.tolerance_m:g} mm"
    )


def _draw_cell(axes: Axes, source: RunSource, cell: Cell, models: Sequence[str]) -> None:
    read = source.points
    for model in models:
        scenes = read.cells.get((cell.category, cell.completion, model))
        if not scenes:
            continue
        style = model_style(model)
        risks = scene_risks(scenes, CONFIDENCE)
        curve = 100 * mean_risk(risks)
        front = 4 if model == PREFERRED_MODEL else 3
        axes.plot(
            100 * COVERAGES,
            curve,
            color=style.colour,
            linestyle=style.line,
            marker=style.marker,
            markevery=list(MARKER_AT),
            zorder=front,
        )
        if model in _banded(models):
            _draw_band(axes, scenes, risks, style=style, seed=read.seed)
        if model == PREFERRED_MODEL:
            for name, look in BASELINES.items():
                other = 100 * mean_risk(scene_risks(scenes, name))
                axes.plot(
                    100 * COVERAGES, other, color=look.colour, linestyle=look.line, linewidth=0.9
                )
    axes.set_xlim(0, 100)
    axes.set_xticks([0, 25, 50, 75, 100])
    axes.set_yscale("symlog", linthresh=LINEAR_BELOW, linscale=0.6)
    axes.set_ylim(0, 100)
    axes.set_yticks([0, 0.1, 1, 10, 100], ["0", "0.1", "1", "10", "100"])
    axes.minorticks_off()


def _banded(models: Sequence[str]) -> list[str]:
    """List the models whose intervals are drawn: of all they would cover each other."""
    return [name for name in ("metric", "classic_tuned") if name in models] or list(models[:1])


def _draw_band(
    axes: Axes, scenes: Sequence[ScenePoints], risks: Floats, *, style: SeriesStyle, seed: int
) -> None:
    objects = np.array([scene.object_name for scene in scenes], dtype=np.str_)
    defined = ~np.isnan(risks[:, 0])
    bounds = [
        bootstrap_interval(risks[defined, percent - 1], objects=objects[defined], seed=seed)
        for percent in INTERVAL_AT
    ]
    if any(bound is None for bound in bounds):
        return
    low, high = 100 * np.array(bounds, dtype=np.float64).T
    axes.fill_between(INTERVAL_AT, low, high, color=style.colour, alpha=0.15, linewidth=0)
