"""The run against another: what differs, scene by scene, for every model that both hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from harness.errors import InputError
from harness.html_report.grid import Cell, Grid, Heading
from harness.html_report.names import cell_name, model_order, plain
from harness.html_report.verdict import TEST_HEADINGS, Outcome, outcome, tally, test_cells
from harness.results import compare_finished, read_run
from harness.table.cells import TESTS
from harness.table.columns import DIFFERENCE_COLUMNS
from harness.table.differences import in_families

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from harness.results import Comparison
    from harness.table.columns import Column
    from harness.table.differences import Difference

MOST_NAMED = 20
"""How many scenes that are left out are named."""


@dataclass(frozen=True)
class RunComparison:
    """A run less another.

    Attributes
    ----------
    other
        The other run's name.
    lead
        One sentence.
    notes
        What was left out.
    settings
        What is configured differently.
    differences
        Of every model, paired by scene.
    about
        What the numbers are.
    """

    other: str
    lead: str
    notes: Sequence[str]
    settings: Grid
    differences: Grid
    about: str


def compare(first: Path, second: Path) -> RunComparison:
    """Compare every model that two finished runs share.

    Parameters
    ----------
    first, second
        Folders; the second's values are subtracted.

    Raises
    ------
    InputError
        As `harness.results.compare_finished`; runs without a model in common.
    """
    runs = read_run(first), read_run(second)
    ours, theirs = ({record.model for record in run.records} for run in runs)
    models = sorted(ours & theirs, key=model_order)
    if not models:
        raise InputError(
            f"{first} and {second} have no model in common ({', '.join(sorted(ours))} and "
            f"{', '.join(sorted(theirs))}); compare two of them with `harness compare`"
        )
    found = [compare_finished(*runs, model_a=model, model_b=model) for model in models]
    differences = in_families(item for comparison in found for item in comparison.differences)
    outcomes: list[Outcome] = []
    rows = []
    for item in differences:
        for column in DIFFERENCE_COLUMNS:
            contrast = item.values[column.key]
            if contrast.scenes:
                outcomes.append(outcome(contrast, column))
                rows.append((*_names(item, column), *test_cells(contrast, column)))
    names = [Heading(text, numeric=False) for text in ("class and test set", "model", "measure")]
    scenes = found[0].scenes
    return RunComparison(
        other=str(second),
        lead=(
            f"This run against {second.resolve().name}, on {scenes} scenes of both: "
            f"{tally(outcomes)}."
        ),
        notes=tuple(_notes(found)),
        settings=Grid(
            "Settings that differ",
            [Heading(text, numeric=False) for text in ("key", "this run", "the other")],
            [(Cell(key), Cell(str(a)), Cell(str(b))) for key, a, b in found[0].settings],
        ),
        differences=Grid("This run less the other", (*names, *TEST_HEADINGS), rows),
        about=TESTS,
    )


def _names(item: Difference, column: Column) -> tuple[Cell, ...]:
    return (
        Cell(cell_name(item.category, item.completion)),
        Cell(plain(item.first)),
        Cell(column.heading),
    )


def _notes(found: Sequence[Comparison]) -> Iterator[str]:
    """Say what was left out, once for all models."""
    yield from dict.fromkeys(text for comparison in found for text in comparison.empty)
    unlike = list(dict.fromkeys(text for comparison in found for text in comparison.unlike))
    if unlike:
        rest = f" and {len(unlike) - MOST_NAMED} more" if len(unlike) > MOST_NAMED else ""
        named = "; ".join(unlike[:MOST_NAMED])
        yield f"Left out, not the same scene in both runs: {named}{rest}."
    first = found[0]
    if first.only_first or first.only_second:
        yield (
            f"Scenes of one run alone, left out: {first.only_first} of this run, "
            f"{first.only_second} of the other."
        )
