"""Figures made of pictures: a grid of panels of exact size, letters, scale bars, legends."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from harness.figures.style import CONFIDENCE_COLOURS, DPI, SMALL_PT

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    import numpy.typing as npt
    from matplotlib.axes import Axes

    from harness.cubes import Picture, View

BAR_LENGTHS_CM = (1, 2, 5, 10, 20, 50)
LONGEST_BAR = 0.25
"""Of a panel's width."""


@dataclass(frozen=True)
class Layout:
    """Sizes of a grid of pictures, inches.

    Attributes
    ----------
    width
        Of the figure.
    aspect
        A panel's width by its height.
    left, right, top, bottom
        Room around the grid.
    gap, under
        Room between columns, and under each row.
    """

    width: float
    aspect: float
    left: float = 0.02
    right: float = 0.02
    top: float = 0.18
    bottom: float = 0.02
    gap: float = 0.06
    under: float = 0.08


@dataclass(frozen=True, eq=False)
class Grid:
    """A figure of panels.

    Attributes
    ----------
    axes
        By row and column.
    panel_px
        Width and height of a panel at `DPI`.
    """

    figure: Figure
    axes: Sequence[Sequence[Axes]]
    panel_px: tuple[int, int]


def picture_grid(rows: int, columns: int, *, layout: Layout) -> Grid:
    """Begin a figure of rows and columns of pictures of one size."""
    free = layout.width - layout.left - layout.right - (columns - 1) * layout.gap
    width = free / columns
    height = width / layout.aspect
    total = layout.top + rows * (height + layout.under) + layout.bottom
    figure = Figure(figsize=(layout.width, total))
    FigureCanvasAgg(figure)
    axes = []
    for row in range(rows):
        bottom = total - layout.top - (row + 1) * height - row * layout.under
        axes.append(
            [
                figure.add_axes(
                    (
                        (layout.left + column * (width + layout.gap)) / layout.width,
                        bottom / total,
                        width / layout.width,
                        height / total,
                    )
                )
                for column in range(columns)
            ]
        )
    panel_px = (round(width * DPI), round(height * DPI))
    return Grid(figure=figure, axes=axes, panel_px=panel_px)


def show_picture(axes: Axes, picture: Picture) -> None:
    """Fill a panel with a picture of its proportions."""
    axes.imshow(picture, aspect="auto")
    axes.set_axis_off()


def letter(axes: Axes, name: str) -> None:
    """Put a panel's letter before its title."""
    axes.text(0.0, 1.02, name, transform=axes.transAxes, fontweight="bold", ha="left", va="bottom")


def row_label(axes: Axes, text: str) -> None:
    """Name a row, left of its first panel."""
    axes.text(
        -0.03,
        0.5,
        text,
        transform=axes.transAxes,
        rotation=90,
        ha="right",
        va="center",
        linespacing=1.3,
    )


def under_panel(axes: Axes, text: str) -> None:
    """Write below a panel."""
    axes.text(
        0.5,
        -0.02,
        text,
        transform=axes.transAxes,
        ha="center",
        va="top",
        fontsize=SMALL_PT,
        linespacing=1.25,
    )


def scale_bar(
    axes: Axes, *, view: View, at_world: npt.NDArray[np.float64], light: bool = False
) -> None:
    """Draw a bar of whole centimetres, as long as it would be seen at a point (3,)."""
    width, height = view.size
    per_cm = 0.01 * view.focal * height / float(view.depths(at_world))
    fitting = [cm for cm in BAR_LENGTHS_CM if cm * per_cm <= LONGEST_BAR * width]
    length_cm = fitting[-1] if fitting else BAR_LENGTHS_CM[0]
    x, y = 0.04 * width, 0.955 * height
    colour, around = ("white", "none") if light else ("black", "white")
    halo = [withStroke(linewidth=2.4, foreground=around)]
    axes.plot(
        [x, x + length_cm * per_cm],
        [y, y],
        color=colour,
        linewidth=1.4,
        solid_capstyle="butt",
        path_effects=halo,
    )
    axes.text(
        x + length_cm * per_cm / 2,
        y - 0.02 * height,
        f"{length_cm} cm",
        color=colour,
        ha="center",
        va="bottom",
        fontsize=SMALL_PT,
        path_effects=halo,
    )
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)


def legend_height(count: int, *, columns: int) -> float:
    """Height (inches) of a legend of so many names below a figure."""
    return 0.06 + 0.14 * math.ceil(count / columns)


def dot_legend(
    figure: Figure,
    colours: Mapping[str, str],
    *,
    centre: float = 0.5,
    columns: int | None = None,
    marker: str = "o",
) -> None:
    """Name colours at the lower edge, in one line unless columns are given.

    Parameters
    ----------
    figure
        With `legend_height` left free below.
    colours
        By name.
    centre
        Of the legend, as a share of the figure's width.
    columns
        Most names in a line.
    marker
        Of all names.
    """
    figure.legend(
        handles=[
            Line2D(
                [],
                [],
                linestyle="none",
                marker=marker,
                markersize=5,
                color=colour,
                label=name,
                markeredgecolor="0.3",
                markeredgewidth=0.4,
            )
            for name, colour in colours.items()
        ],
        loc="lower center",
        bbox_to_anchor=(centre, 0.04 / figure.get_figheight()),
        ncols=min(len(colours), columns or len(colours)),
        handletextpad=0.2,
        columnspacing=1.2,
        labelspacing=0.3,
        borderaxespad=0,
        borderpad=0,
    )


def confidence_bar(figure: Figure, *, place: tuple[float, float, float, float], label: str) -> None:
    """Draw the colours of confidence in a box (left, bottom, width, height) of the figure."""
    axes = figure.add_axes(place)
    bar = figure.colorbar(
        ScalarMappable(cmap=CONFIDENCE_COLOURS), cax=axes, orientation="horizontal"
    )
    bar.set_ticks([0, 0.5, 1])
    bar.ax.tick_params(length=2, pad=1.5)
    bar.outline.set_linewidth(0.4)
    axes.text(-0.04, 0.5, label, transform=axes.transAxes, ha="right", va="center")
