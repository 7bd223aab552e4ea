"""What charts share: a panel for each class and test set, one legend of models under them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from matplotlib.lines import Line2D

from harness.figures.style import model_style

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from harness.figures.style import SeriesStyle

COLUMNS = 4
"""Panels beside each other in two columns of text, at most."""


def panel_blocks(count: int) -> list[range]:
    """Cut a number of panels into rows of equal length, as far as it goes."""
    rows = math.ceil(count / COLUMNS)
    columns = math.ceil(count / rows)
    return [range(start, min(start + columns, count)) for start in range(0, count, columns)]


def chart_grid(figure: Figure, *, panels: int, charts: int) -> Iterator[tuple[int, Sequence[Axes]]]:
    """Lay out panels of charts that stand above each other.

    Yields each panel's number with its charts, the upper first. Only the first panel of a row
    names the vertical axes: see `is_first`.
    """
    blocks = panel_blocks(panels)
    rows, columns = len(blocks) * charts, len(blocks[0])
    grid = figure.subplots(rows, columns, squeeze=False)
    for row, block in enumerate(blocks):
        for column in range(columns):
            stacked = [grid[row * charts + chart][column] for chart in range(charts)]
            if column < len(block):
                yield block[column], stacked
            else:
                for axes in stacked:
                    axes.remove()


def is_first(panel: int, *, panels: int) -> bool:
    """Whether a panel is its row's first."""
    return any(panel == block[0] for block in panel_blocks(panels))


def name_vertical(axes: Axes, name: str, *, first: bool) -> None:
    """Name a vertical axis that the panels of a row share, in the first of them alone."""
    axes.tick_params(axis="y", labelleft=first)
    if first:
        axes.set_ylabel(name)


def model_legend(
    figure: Figure, models: Sequence[str], *, others: Sequence[SeriesStyle] = (), rows: int = 1
) -> None:
    """Name models and other series below the figure."""
    styles = [*(model_style(name) for name in models), *others]
    figure.legend(
        handles=[
            Line2D(
                [],
                [],
                color=style.colour,
                marker=style.marker,
                linestyle=style.line,
                label=style.label,
            )
            for style in styles
        ],
        loc="outside lower center",
        ncols=math.ceil(len(styles) / rows),
        columnspacing=1.4,
        handletextpad=0.5,
    )
