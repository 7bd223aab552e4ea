"""Reliability: how often points lie on the object, by the confidence that they do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import EngFormatter

from harness.calibration import BINS, reliability
from harness.figures.charts import (
    chart_grid,
    is_first,
    model_legend,
    name_vertical,
    panel_blocks,
)
from harness.figures.source import order_models
from harness.figures.style import GREY, TWO_COLUMNS_IN, model_style, new_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from harness.calibration import Reliability
    from harness.calibration.series import ScenePoints
    from harness.figures.source import RunSource

CONFIDENCE = "confidence"
LEAST_POINTS = 20
"""A bin of fewer says little: it is counted, not drawn."""


def draw_reliability(source: RunSource) -> tuple[Figure, str]:
    """Draw every model's diagram in each class and test set; returns the figure and its caption.

    Raises
    ------
    NothingToDrawError
        The run recorded no scenes.
    """
    read = source.points
    cells = source.answered_cells
    figure = new_figure(
        width_in=TWO_COLUMNS_IN, height_in=0.35 + 2.75 * len(panel_blocks(len(cells)))
    )
    models = order_models(set(read.models))
    points = [sum(len(scene.truth) for scene in scenes) for scenes in read.cells.values()]
    for panel, (diagram, counts) in chart_grid(figure, panels=len(cells), charts=2):
        cell = cells[panel]
        for model in models:
            scenes = read.cells.get((cell.category, cell.completion, model))
            if scenes:
                draw_diagram(diagram, counts, pooled(scenes), model=model)
        _finish(diagram, counts, first=is_first(panel, panels=len(cells)), most=1.5 * max(points))
        diagram.set_title(cell.label)
    model_legend(figure, models)
    return figure, (
        "confidence that a point lies on the object (recalibrated probability times the "
        "segmenter's and the completer's score) against the share that does, points of all scenes "
        f"in {BINS} bins of equal width, those of at least {LEAST_POINTS} points; above the "
        "diagonal it is too modest, below too sure; lower row: number of points; on the mesh "
        f"within {1000 * source.tolerance_m:g} mm"
    )


def pooled(scenes: Sequence[ScenePoints]) -> Reliability:
    """Make the diagram of the points of all scenes in which the confidence is defined."""
    defined = [scene for scene in scenes if CONFIDENCE in scene.on_object]
    values = [scene.on_object[CONFIDENCE] for scene in defined]
    truths = [scene.truth for scene in defined]
    return reliability(
        np.concatenate([np.zeros(0), *values]), np.concatenate([np.zeros(0, bool), *truths])
    )


def draw_diagram(diagram: Axes, counts: Axes, found: Reliability, *, model: str) -> None:
    """Draw a model's diagram and, below, how many points each bin holds."""
    style = model_style(model)
    shown = found.counts >= LEAST_POINTS
    if shown.any():
        diagram.plot(
            100 * found.mean_predicted[shown],
            100 * found.observed[shown],
            color=style.colour,
            marker=style.marker,
            linestyle=style.line,
            linewidth=0.9,
            clip_on=False,
        )
    counts.stairs(
        found.counts,
        100 * found.edges,
        color=style.colour,
        linestyle=style.line,
        linewidth=0.9,
        baseline=None,
    )


def _finish(diagram: Axes, counts: Axes, *, first: bool, most: float) -> None:
    diagram.plot([0, 100], [0, 100], color=GREY, linewidth=0.7, zorder=1)
    diagram.set_ylim(0, 100)
    counts.set_yscale("log")
    counts.set_ylim(0.8, most)
    # Powers would be smaller than the smallest text.
    counts.yaxis.set_major_formatter(EngFormatter(sep=""))
    counts.set_xlabel("confidence (%)")
    for axes in (diagram, counts):
        axes.set_xlim(0, 100)
        axes.set_xticks([0, 25, 50, 75, 100])
    diagram.set_yticks([0, 25, 50, 75, 100])
    diagram.tick_params(labelbottom=False)
    name_vertical(diagram, "on the mesh (%)", first=first)
    name_vertical(counts, "points", first=first)
