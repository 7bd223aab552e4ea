"""What a run shows, in words: the best model of each cell, and ours against the classic one."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from harness.html_report.bars import bars
from harness.html_report.best import RULE, best_model
from harness.html_report.grid import Cell, Grid, Heading, Tone, number_cell
from harness.html_report.names import cell_name, plain, variant_name
from harness.table.cells import (
    TESTS,
    difference,
    effect,
    interval,
    number,
    object_count,
    pair_label,
    probability,
    scene_count,
    verdict as say,
)
from harness.table.columns import DIFFERENCE_COLUMNS, HIGHER_IS_BETTER, columns_of
from harness.table.differences import PAIRS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.html_report.bars import Bar
    from harness.html_report.best import Best
    from harness.runs.records import Record
    from harness.table.columns import Column
    from harness.table.differences import Contrast, Difference
    from harness.table.summary import Table

Outcome = Literal["better", "worse", "same", "undetected", "untested"]

BARS = (
    "Bars: to the right of the middle the first model is better; mean, interval, and as a pale "
    "band what the run is too small to find. Bars of one measure have one scale."
)
HEADLINE = columns_of("precision", "auroc", "aurc", "ece")
"""What the verdict is about: the seed's number, two rankings, and calibration."""


@dataclass(frozen=True)
class Line:
    """A measure of a cell.

    Attributes
    ----------
    best
        The best model by `harness.html_report.best.RULE`, with its mean and interval.
    judgement
        What the paired test says of ours against the classic one; empty without the pair.
    tone
        Whether that is good or bad for ours.
    bar
        The difference, to one scale for all of this measure; None without one.
    """

    heading: str
    best: str
    judgement: str
    tone: Tone
    bar: Bar | None


@dataclass(frozen=True)
class CellVerdict:
    """A class and test set: its name, its scenes, its measures."""

    label: str
    about: str
    lines: tuple[Line, ...]


@dataclass(frozen=True)
class Verdict:
    """A run's headline.

    Attributes
    ----------
    lead
        One sentence.
    cells
        The classes and test sets.
    bars, about
        What the bars and the numbers are.
    """

    lead: str
    cells: tuple[CellVerdict, ...]
    bars: str
    about: str


def verdict(table: Table, records: Sequence[Record], *, seed: int) -> Verdict:
    """Say of each class and test set which model is best, and how ours stands to the classic.

    Parameters
    ----------
    table
        The run's.
    records
        What it was made of.
    seed
        Of the intervals' resampling.
    """
    of_cell: defaultdict[tuple[str, str], list[Record]] = defaultdict(list)
    for record in records:
        if record.tolerance_m == table.reported_tolerance_m:
            of_cell[record.category, record.completion].append(record)
    differences = {
        (item.category, item.completion, item.segmenter): item
        for pair in _judged_pair(table)
        for item in table.reported_differences()
        if (item.first, item.second) == pair
    }
    groups = table.groups()
    fullest = [max(rows, key=lambda row: row.scenes) for rows in groups]
    judged = [
        differences.get((row.category, row.variant.completion, row.variant.segmenter))
        for row in fullest
    ]
    drawn = {
        column.key: bars(
            [None if item is None else item.values[column.key] for item in judged], column
        )
        for column in HEADLINE
    }
    cells = []
    for index, (row, found) in enumerate(zip(fullest, judged, strict=True)):
        own = of_cell[row.category, row.variant.completion]
        lines = [
            Line(
                column.heading,
                _say_best(best, table, scenes=row.scenes),
                *_judgement(found, column),
                drawn[column.key][index],
            )
            for column in HEADLINE
            if (best := best_model(own, column, seed=seed)) is not None
        ]
        if lines:
            name = cell_name(row.category, row.variant.completion)
            about = f"{scene_count(row)}, {object_count(row)}"
            cells.append(CellVerdict(name, about, tuple(lines)))
    return Verdict(
        lead=_lead(table, list(differences.values())),
        cells=tuple(cells),
        bars=BARS if differences else "",
        about=f"{RULE} {TESTS}",
    )


def difference_grid(table: Table) -> Grid:
    """Tabulate the paired differences of models at the reported tolerance."""
    return Grid(
        "The first model less the second",
        (*_texts("class and test set", "models", "measure"), *TEST_HEADINGS),
        [
            (
                Cell(cell_name(item.category, item.completion)),
                Cell(pair_label(item)),
                Cell(column.heading),
                *test_cells(item.values[column.key], column),
            )
            for item in table.reported_differences()
            for column in DIFFERENCE_COLUMNS
            if item.values[column.key].scenes
        ],
    )


def test_cells(contrast: Contrast, column: Column) -> tuple[Cell, ...]:
    """Write what a paired test says of a measure, under `TEST_HEADINGS`."""
    tone = outcome_tone(outcome(contrast, column))
    words = {"good": "better: ", "bad": "worse: "}.get(tone, "")
    return (
        Cell(difference(contrast), value=contrast.mean, tone=tone),
        Cell(words + " ".join(say(contrast)), tone=tone),
        number_cell(contrast.p_value, probability(contrast.p_value)),
        number_cell(contrast.q_value, probability(contrast.q_value)),
        number_cell(contrast.effect_size, effect(contrast.effect_size)),
        number_cell(contrast.minimum_detectable),
        number_cell(contrast.scenes, str(contrast.scenes)),
        number_cell(contrast.objects, str(contrast.objects)),
    )


TEST_HEADINGS = (
    Heading("difference [95 % interval]"),
    Heading("verdict", numeric=False),
    Heading("p", about="Of changing the signs of the objects' differences."),
    Heading("q", about="p adjusted by Benjamini and Hochberg over this table."),
    Heading("effect", about="Hedges' g of the objects' means."),
    Heading("detectable", about="The least true difference that is found 80 times in 100."),
    Heading("scenes"),
    Heading("objects"),
)


def outcome(contrast: Contrast, column: Column) -> Outcome:
    """Say whether the first is found to be better or worse than the second, or equals it."""
    if contrast.p_value is None or contrast.mean is None:
        return "untested"
    if contrast.mean == 0 and not contrast.minimum_detectable:
        return "same"
    if not contrast.detected:
        return "undetected"
    return "better" if (contrast.mean > 0) == (column.key in HIGHER_IS_BETTER) else "worse"


def outcome_tone(found: Outcome) -> Tone:
    """Good or bad news for the first."""
    tones: dict[Outcome, Tone] = {"better": "good", "worse": "bad"}
    return tones.get(found, "")


def tally(outcomes: Sequence[Outcome]) -> str:
    """Count outcomes, in words."""
    counts = [
        (outcomes.count("better"), "better"),
        (outcomes.count("worse"), "worse"),
        (outcomes.count("same"), "the same"),
        (outcomes.count("undetected"), "not detected to differ"),
        (outcomes.count("untested"), "on too few objects to test"),
    ]
    said = [f"{words} in {count}" for count, words in counts if count]
    plural = "" if len(outcomes) == 1 else "s"
    return f"{', '.join(said)} of {len(outcomes)} comparison{plural}"


def _judged_pair(table: Table) -> list[tuple[str, str]]:
    """Find the first of the tables' pairs that the run holds: ours against the classic one."""
    held = {(item.first, item.second) for item in table.reported_differences()}
    return [pair for pair in PAIRS if pair in held][:1]


def _lead(table: Table, found: Sequence[Difference]) -> str:
    if not any(row.scenes for row in table.rows):
        return "No scene was scored: every one failed."
    if not found:
        return "The run holds no pair of models that is judged; the best of each class are below."
    contrasts = [(item.values[column.key], column) for item in found for column in HEADLINE]
    outcomes = [outcome(contrast, column) for contrast, column in contrasts if contrast.scenes]
    names = ", ".join(column.heading for column in HEADLINE)
    first, second = plain(found[0].first), plain(found[0].second)
    return (
        f"The {first} model against the {second} one, by {names} in each class and test set: "
        f"{tally(outcomes)}."
    )


def _say_best(best: Best, table: Table, *, scenes: int) -> str:
    """Name the best model and its mean; the number of scenes where it is not all of them."""
    names = " and ".join(variant_name(variant, table) for variant in best.variants)
    said = f"{names} {number(best.value.mean)} {interval(best.value)}".rstrip()
    return said if best.value.count == scenes else f"{said} (in {best.value.count} scenes)"


def _judgement(found: Difference | None, column: Column) -> tuple[str, Tone]:
    """Say in words what the paired test found, and whether that is good for the first."""
    if found is None or not found.values[column.key].scenes:
        return "", ""
    contrast = found.values[column.key]
    said = outcome(contrast, column)
    head, tail = say(contrast)
    q_value = "" if contrast.q_value is None else f", q {probability(contrast.q_value)}"
    words = {"better": "better, ", "worse": "worse, "}.get(said, "")
    defined = "" if contrast.scenes == found.scenes else f" (in {contrast.scenes} scenes)"
    return (
        f"{pair_label(found)} {difference(contrast)}{defined}{q_value}: {words}{head} {tail}",
        outcome_tone(said),
    )


def _texts(*names: str) -> tuple[Heading, ...]:
    return tuple(Heading(name, numeric=False) for name in names)
