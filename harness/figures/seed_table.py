"""Table III as dots with intervals, ours beside the seed's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.lines import Line2D

from harness.figures.source import NothingToDrawError
from harness.figures.style import SEED, TWO_COLUMNS_IN, model_style, new_figure
from harness.runs.records import Variant
from harness.statistics import mean_estimate
from harness.table.columns import SEED_COLUMNS
from harness.table.seed import seed_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from harness.figures.source import Cell, RunSource
    from harness.table.columns import Column

COLUMN_ORDER = ("precision", "accuracy", "tp", "tn", "fp", "fn")
ROW_IN = 0.135


@dataclass(frozen=True)
class Line:
    """A line of the figure: a cell's heading, or one of its models."""

    cell: Cell
    model: str


def draw_seed_table(source: RunSource) -> tuple[Figure, str]:
    """Draw every cell of the run's table; returns the figure and its caption.

    Raises
    ------
    NothingToDrawError
        No scene was scored.
    """
    if not source.cells:
        raise NothingToDrawError("no scene of the run was scored")
    lines = [Line(cell, model) for cell in source.cells for model in ("", *source.models)]
    by_key = {column.key: column for column in SEED_COLUMNS}
    figure = new_figure(width_in=TWO_COLUMNS_IN, height_in=0.75 + ROW_IN * len(lines))
    panels = figure.subplots(1, len(COLUMN_ORDER), sharey=True)
    for axes, key in zip(panels, COLUMN_ORDER, strict=True):
        for place, line in enumerate(lines):
            if line.model:
                _draw_line(axes, source, line, by_key[key], place=place)
            elif place:
                axes.axhline(place - 0.5, color="0.8", linewidth=0.5)
        axes.set_title(by_key[key].heading)
        axes.set_xlabel("share")
        axes.set_xlim(-0.04, 1.04)
        axes.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
    first = panels[0]
    first.set_ylim(len(lines) - 0.4, -0.8)
    first.set_yticks(
        range(len(lines)),
        [model_style(line.model).label if line.model else line.cell.label for line in lines],
    )
    for text, line in zip(first.get_yticklabels(), lines, strict=True):
        text.set_fontweight("normal" if line.model else "bold")
    figure.legend(
        handles=[
            Line2D([], [], color="0.4", marker="o", label="ours, 95 % interval over objects"),
            Line2D([], [], color=SEED.colour, marker=SEED.marker, linestyle="none", label="seed"),
        ],
        loc="outside lower center",
        ncols=2,
    )
    scenes = len({record.scene_id for record in source.reported})
    return figure, (
        f"means over {scenes} scenes with 95 % bootstrap intervals over objects; TP to FN as "
        f"shares of the test points; on the mesh within {1000 * source.tolerance_m:g} mm; crosses: "
        "the seed's Table III, of other scenes and another completer; its metric model stands "
        "beside both of ours"
    )


def _draw_line(axes: Axes, source: RunSource, line: Line, column: Column, *, place: int) -> None:
    records = [
        record
        for record in source.reported
        if (record.category, record.completion, record.model)
        == (line.cell.category, line.cell.completion, line.model)
    ]
    values = [column.value(record) for record in records]
    found = mean_estimate(
        np.array([np.nan if value is None else value for value in values], dtype=np.float64),
        objects=np.array([record.object_name for record in records], dtype=np.str_),
        seed=source.config.run.seed,
    )
    style = model_style(line.model)
    if found.low is not None and found.high is not None:
        axes.plot(
            [found.low, found.high],
            [place, place],
            color=style.colour,
            linewidth=1.2,
            solid_capstyle="butt",
        )
    if found.mean is not None:
        axes.plot(
            found.mean,
            place,
            color=style.colour,
            marker=style.marker,
            markeredgecolor="white",
            markeredgewidth=0.4,
            markersize=4.2,
            zorder=3,
        )
    variant = Variant(model=line.model, completion=line.cell.completion)
    seed = seed_numbers(category=line.cell.category, variant=variant).get(column.key)
    if seed is not None:
        axes.plot(
            seed,
            place,
            color=SEED.colour,
            marker=SEED.marker,
            markersize=4,
            markeredgewidth=1.1,
            linestyle="none",
            zorder=3.5,
        )
