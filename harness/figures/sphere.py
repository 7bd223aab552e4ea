"""The unit sphere of the metric embedding with the points of unseen objects.

    credence-train sphere --validation data/meshes/validation --out sphere.csv
    python -m harness.figures.sphere sphere.csv sphere.png

Both halves of the sphere are seen from outside, along the diagonal that divides the six directions
of a perfectly spread embedding into two threes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import polars as pl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from harness.errors import InputError
from harness.pictures import CLASS_COLOURS
from harness.runs.atomic import write_atomically

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = npt.NDArray[np.float64]

COLUMNS = {
    "kind": pl.String,
    "category": pl.String,
    "e1": pl.Float64,
    "e2": pl.Float64,
    "e3": pl.Float64,
}
UNIT_TOLERANCE = 1e-3
# Right, up and towards the viewer, rows of a rotation.
VIEW = np.array(
    [
        [1 / np.sqrt(2), -1 / np.sqrt(2), 0],
        [1 / np.sqrt(6), 1 / np.sqrt(6), -2 / np.sqrt(6)],
        [1 / np.sqrt(3), 1 / np.sqrt(3), 1 / np.sqrt(3)],
    ]
)


@dataclass(frozen=True)
class Category:
    """A category on the sphere.

    Attributes
    ----------
    name
        The category.
    points : (n, 3) float64
        Unit vectors of its points.
    direction : (3,) float64
        Its learned direction, a unit vector.
    """

    name: str
    points: Floats
    direction: Floats

    def mean(self) -> Floats:
        """Return the unit vector that its points lie around, (3,)."""
        total: Floats = self.points.sum(axis=0)
        length = float(np.linalg.norm(total))
        return total / length if length > 0 else self.direction


@dataclass(frozen=True)
class Angles:
    """How narrow the categories are and how far apart, degrees.

    Attributes
    ----------
    within_mean, within_p95
        Mean and 95th percentile of the angle between a point and its category's mean.
    between_mean, between_min
        Mean and least angle between two categories' means.
    """

    within_mean: float
    within_p95: float
    between_mean: float
    between_min: float


def read_table(*, table: Path) -> tuple[Category, ...]:
    """Read the unit vectors that ``credence-train sphere`` writes.

    Parameters
    ----------
    table
        CSV with the columns kind (point or direction), category, e1, e2, e3.

    Returns
    -------
    tuple of Category
        Those that have points, in the table's order.

    Raises
    ------
    InputError
        The table cannot be read, or its rows are not unit vectors of known categories.
    """
    remedy = "write it with `credence-train sphere`"
    try:
        rows = pl.read_csv(table, schema=COLUMNS)
    except (OSError, pl.exceptions.PolarsError) as error:
        message = f"cannot read {table}: {str(error).splitlines()[0]}; {remedy}"
        raise InputError(message) from error
    vectors = rows.select("e1", "e2", "e3").to_numpy()
    lengths = np.linalg.norm(vectors, axis=1)
    off = ~(np.abs(lengths - 1) <= UNIT_TOLERANCE)
    if off.any():
        row = int(np.argmax(off))
        raise InputError(f"row {row + 1} of {table} has length {lengths[row]:.3g}, not 1; {remedy}")
    categories = []
    for name in rows["category"].unique(maintain_order=True):
        if name not in CLASS_COLOURS:
            raise InputError(f"{table} has the unknown category '{name}'; {remedy}")
        own = (rows["category"] == name).to_numpy()
        points = vectors[own & (rows["kind"] == "point").to_numpy()]
        directions = vectors[own & (rows["kind"] == "direction").to_numpy()]
        if len(directions) != 1:
            found = len(directions)
            raise InputError(f"{table} has {found} directions for '{name}', not one; {remedy}")
        if len(points):
            categories.append(Category(name=name, points=points, direction=directions[0]))
    if not categories:
        raise InputError(f"{table} has no points; {remedy}")
    return tuple(categories)


def measure_angles(*, categories: tuple[Category, ...]) -> Angles:
    """Measure the angles within and between categories.

    Parameters
    ----------
    categories
        At least one.

    Returns
    -------
    Angles
        The angles between categories are 0 when there is only one.
    """
    means = np.array([category.mean() for category in categories])
    within = np.concatenate(
        [_degrees(category.points @ mean) for category, mean in zip(categories, means, strict=True)]
    )
    first, second = np.triu_indices(len(means), k=1)
    between = _degrees(np.sum(means[first] * means[second], axis=1))
    return Angles(
        within_mean=float(within.mean()),
        within_p95=float(np.quantile(within, 0.95, method="inverted_cdf")),
        between_mean=float(between.mean()) if len(between) else 0.0,
        between_min=float(between.min()) if len(between) else 0.0,
    )


def draw_sphere(*, table: Path, out: Path) -> Angles:
    """Draw both halves of the sphere with the points and the categories' directions.

    Parameters
    ----------
    table
        What ``credence-train sphere`` wrote.
    out
        The picture, PNG.

    Returns
    -------
    Angles
        Those in the picture's title.

    Raises
    ------
    InputError
        The table cannot be used, or the picture cannot be written.
    """
    categories = read_table(table=table)
    angles = measure_angles(categories=categories)
    figure = Figure(figsize=(10, 5.9), layout="constrained")
    FigureCanvasAgg(figure)
    front, back = figure.subplots(1, 2)
    _draw_half(front, categories, side=1)
    _draw_half(back, categories, side=-1)
    front.set_title("from the front", fontsize=9)
    back.set_title("from behind", fontsize=9)
    figure.suptitle(
        "Unseen objects' points on the unit sphere\n"
        f"within a class: mean {angles.within_mean:.1f}°, 95 % below {angles.within_p95:.1f}°"
        f"   between classes: mean {angles.between_mean:.1f}°, least {angles.between_min:.1f}°",
        fontsize=11,
    )
    handles, labels = front.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside lower center",
        ncols=len(categories),
        frameon=False,
        markerscale=4,
    )

    def write(file: IO[bytes]) -> None:
        figure.savefig(file, format="png")

    write_atomically(out, write)
    return angles


def _draw_half(axes: Axes, categories: tuple[Category, ...], *, side: int) -> None:
    """Draw the half that faces the viewer (side 1) or faces away (-1), seen from its outside."""
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_xlim(-1.08, 1.08)
    axes.set_ylim(-1.08, 1.08)
    axes.add_patch(Circle((0, 0), 1, facecolor="0.97", edgecolor="0.6"))
    # Seen from behind, right and left change places.
    seen = VIEW * np.array([[side], [1], [side]])
    for category in categories:
        colour = np.array(CLASS_COLOURS[category.name]) / 255
        x, y, depth = seen @ category.points.T
        axes.scatter(
            x[depth >= 0],
            y[depth >= 0],
            s=4,
            alpha=0.35,
            linewidths=0,
            color=[colour],
            label=category.name,
        )
        x, y, depth = seen @ category.direction
        if depth >= 0:
            axes.plot(x, y, "X", color=colour, markeredgecolor="black", markersize=10)
            axes.annotate(category.name, (x, y), xytext=(7, 6), textcoords="offset points")


def _degrees(cosines: Floats) -> Floats:
    """Angles of cosines, degrees."""
    angles: Floats = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    return angles


def main() -> int:
    """Draw the table named first to the picture named second."""
    if len(sys.argv) != 3:
        sys.stderr.write("usage: python -m harness.figures.sphere TABLE.csv PICTURE.png\n")
        return 2
    try:
        draw_sphere(table=Path(sys.argv[1]), out=Path(sys.argv[2]))
    except InputError as error:
        sys.stderr.write(f"harness.figures.sphere: {error}\n")
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
