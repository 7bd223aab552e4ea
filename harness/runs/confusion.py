"""Which categories are taken for which: test points by true category and predicted class."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from harness.runs.tabular import check_types, read_rows, schema_of, write_rows

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class Confusion:
    """Test points of one scene that are truly of one category and predicted to be of another.

    Pairs that no point falls on have no row.

    Attributes
    ----------
    tolerance_m
        Distance within which a point lies on a mesh, metres.
    true
        Category of the object that the points lie on, the target or a neighbour; ``free`` on none.
    predicted
        Category that the classifier gives them, or ``free``.
    points
        Their number.
    """

    scene_id: str
    model: str
    completion: str
    tolerance_m: float
    true: str
    predicted: str
    points: int

    def __post_init__(self) -> None:
        check_types(self)

    def result(self) -> tuple[str, str, float]:
        """Return which result of the scene the row belongs to: model, completion, tolerance."""
        return (self.model, self.completion, self.tolerance_m)

    def key(self) -> tuple[str, str, str, float, str, str]:
        """Return what identifies a row, in sorting order."""
        return (self.scene_id, *self.result(), self.true, self.predicted)


CONFUSION_SCHEMA = schema_of(Confusion)


def write_confusion(rows: Iterable[Confusion], path: Path) -> None:
    """Write a run's rows as Parquet, in the order of their keys."""
    write_rows(sorted(rows, key=Confusion.key), path, schema=CONFUSION_SCHEMA)


def read_confusion(path: Path) -> list[Confusion]:
    """Read what `write_confusion` wrote.

    Raises
    ------
    InputError
        The file is missing, damaged or of another schema.
    """
    return read_rows(path, row=Confusion)
