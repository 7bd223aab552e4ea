"""Tables as the page shows them: cells with the value that they sort by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from harness.table.cells import UNDEFINED, interval, number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.statistics import MeanEstimate

Tone = Literal["", "good", "bad", "dim"]


@dataclass(frozen=True)
class Cell:
    """A cell.

    Attributes
    ----------
    text
        What is read.
    value
        What a numeric column sorts by; None sorts last.
    note
        Stands small below the text.
    tone
        Whether it is good or bad news; its text says so as well.
    """

    text: str
    value: float | None = None
    note: str = ""
    tone: Tone = ""


@dataclass(frozen=True)
class Heading:
    """A column.

    Attributes
    ----------
    text
        Its name.
    numeric
        Whether it sorts by its cells' values; else by their texts.
    about
        What it is, for those who point at it.
    """

    text: str
    numeric: bool = True
    about: str = ""


@dataclass(frozen=True)
class Grid:
    """A table that sorts by any column.

    Attributes
    ----------
    caption
        What it shows.
    headings
        One for each cell of a row.
    rows
        Whose first cell names the row.
    """

    caption: str
    headings: Sequence[Heading]
    rows: Sequence[Sequence[Cell]]


def estimate_cell(estimate: MeanEstimate, *, scenes: int) -> Cell:
    """Write a mean with its interval, and in how many scenes it is defined if not in all."""
    defined = "" if estimate.count in (0, scenes) else f"n={estimate.count}"
    note = " ".join(filter(None, (interval(estimate), defined)))
    return Cell(number(estimate.mean), value=estimate.mean, note=note)


def number_cell(value: float | None, text: str | None = None) -> Cell:
    """Write a number, three decimals unless its text is given; a dash where there is none."""
    if value is None:
        return Cell(UNDEFINED)
    return Cell(number(value) if text is None else text, value=value)
