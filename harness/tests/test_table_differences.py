"""Differences of a table: by hand, in their family, and how each rendering words them."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace

import numpy as np
import pytest

from harness.statistics import MeanEstimate, PairedTest, benjamini_hochberg, paired_test
from harness.table.cells import (
    compact_difference,
    effect,
    explanation,
    probability,
    verdict,
)
from harness.table.columns import DIFFERENCE_COLUMNS
from harness.table.contrasts import difference_lines
from harness.table.differences import Contrast, paired_differences
from harness.table.flat import render_csv
from harness.table.latex import render_latex
from harness.table.markdown import render_markdown
from harness.table.summary import Table, summarise
from harness.tests.test_table import failed, record, table_of
from harness.tests.test_table_brief import cells


@pytest.fixture
def table() -> Table:
    """Six mug scenes in both test sets, and two bowl scenes in one."""
    return table_of(
        [*cells(), *cells(completion="perturbed"), *cells(category="bowl", scenes=2)][::-1]
    )


def test_a_difference_is_the_mean_of_the_scenes_differences(table: Table) -> None:
    found = {
        (item.category, item.completion, item.second): item for item in table.reported_differences()
    }
    assert len(found) == 3 * 4
    tuned = found["mug", "none", "classic_tuned"]
    assert (tuned.first, tuned.scenes, tuned.objects) == ("metric", 6, 6)
    # Metric is at 0.90, 0.91, ... 0.95 and the tuned classic at 0.80.
    assert tuned.values["accuracy"].mean == pytest.approx(0.125)
    expected = paired_test(
        np.array([0.10, 0.11, 0.12, 0.13, 0.14, 0.15]),
        objects=np.array([f"mug_{i}" for i in range(6)]),
        seed=0,
    )
    assert expected.p_value == 2 / 64
    for name in PairedTest.__dataclass_fields__:
        ours = getattr(tuned.values["accuracy"], name)
        assert ours == pytest.approx(getattr(expected, name)), name
    assert found["bowl", "none", "classic"].values["accuracy"].low is None
    nearest = found["mug", "none", "nearest"].values["precision"]
    assert (nearest.mean, nearest.scenes) == (0.0, 5)
    assert tuned.values["log_loss"] == contrast(None, scenes=0)


def test_a_tables_differences_at_one_tolerance_are_one_family(table: Table) -> None:
    swept = table_of([*cells(), *(replace(row, tolerance_m=0.01) for row in cells())])
    for whole, tolerance_m in ((table, 0.005), (swept, 0.005), (swept, 0.01)):
        family = [
            value
            for item in whole.differences
            if item.tolerance_m == tolerance_m
            for value in item.values.values()
        ]
        tested = [value for value in family if value.p_value is not None]
        p_values = [value.p_value for value in tested]
        expected = benjamini_hochberg(np.array(p_values, dtype=np.float64))
        np.testing.assert_array_equal([value.q_value for value in tested], expected)
        assert {value.q_value for value in family if value.p_value is None} == {None}
    # In both test sets of mugs, p is 1/32 for the accuracy of four pairs and 1 for the precision,
    # which in bowls of two objects is the same and is tested too: 8 of 20.
    q_value = table.differences[0].values["accuracy"].q_value
    assert q_value == pytest.approx(20 / 32 / 8)
    # One cell alone is a smaller family: 4 of 8.
    assert swept.differences[0].values["accuracy"].q_value == pytest.approx(8 / 32 / 4)


def test_only_scenes_that_both_scored_are_paired() -> None:
    mine = [record(i, (4, 3, 2, 1), accuracy=0.9) for i in range(4)]
    theirs = [record(i, (4, 3, 2, 1), accuracy=0.5) for i in (1, 2)] + [failed(3)]
    (item,) = paired_differences(mine, theirs, classes=("mug",), seed=0)
    assert item.scenes == 2
    assert item.values["accuracy"].mean == pytest.approx(0.4)
    assert paired_differences(mine[:1], theirs, classes=("mug",), seed=0) == ()
    other = [replace(row, completion="perturbed") for row in theirs]
    assert paired_differences(mine, other, classes=("mug",), seed=0) == ()


def test_a_run_without_a_pair_has_no_differences() -> None:
    assert table_of([record(0, (1, 1, 1, 1))]).differences == ()
    assert "Paired differences" not in render_markdown(table_of([record(0, (1, 1, 1, 1))]))


def test_the_order_of_the_records_changes_nothing(table: Table) -> None:
    records = [*cells(), *cells(completion="perturbed"), *cells(category="bowl", scenes=2)]
    assert summarise(records, reported_tolerance_m=0.005, classes=("mug", "bowl"), seed=0) == table


def test_files_hold_the_differences_too(table: Table) -> None:
    lines = [
        line
        for line in csv.DictReader(io.StringIO(render_csv(table)))
        if line["less_model"] == "classic_tuned" and line["metric"] == "accuracy"
    ]
    assert [(line["category"], line["completion"], line["model"]) for line in lines] == [
        ("mug", "perturbed", "metric"),
        ("mug", "none", "metric"),
        ("bowl", "none", "metric"),
    ]
    assert float(lines[0]["mean"]) == pytest.approx(0.125)
    assert (lines[0]["scenes"], lines[0]["objects"], lines[0]["seed"]) == ("6", "6", "")
    tuned = table.differences[0].values["accuracy"]
    for name in ("p_value", "q_value", "effect_size", "minimum_detectable"):
        assert float(lines[0][name]) == getattr(tuned, name)
        # Too few bowls to test.
        assert lines[2][name] == ""
    page = render_markdown(table)
    assert "## Paired differences" in page
    assert re.search(
        r"\| Mug \| metric - classic tuned \| accuracy \| 6 \| 6 \| \+0\.125 \[\+0\.1.*\] "
        r"\| \.031 \| \.078 \| \+5\.\d\d \| not detected; alone it would be \(\.0\d\d\) \|",
        page,
    )
    assert "| Bowl | metric - network | accuracy | 2 | 2 |" in page
    assert "not tested: 6 objects are needed |" in page
    sheet = render_latex(table)
    assert r"Bowl, 2 scenes, 2 objects & mean [95 \% interval] & p & q & effect & verdict" in sheet
    assert "precision n=5 & +0.000 [" in sheet
    assert sheet.count(r"\begin{tabular}") == sheet.count(r"\end{tabular}")


def test_compared_cells_stand_under_one_heading(table: Table) -> None:
    items = [(f"{item.category} {item.completion}", item) for item in table.differences[:2]]
    text = "\n".join(line.plain for line in difference_lines(items, width=100))
    assert text.count("[95 % interval]") == 1
    assert [line for line in text.splitlines() if not line.startswith(" ")] == ["mug perturbed"] * 2
    nothing = replace(table.differences[0], values={})
    empty = {column.key: contrast(None, scenes=0) for column in DIFFERENCE_COLUMNS}
    (line,) = difference_lines([("mug", replace(nothing, values=empty))], width=100)
    assert line.plain == "no scene defines a difference"


@pytest.mark.parametrize(
    ("estimate", "text"),
    [
        (MeanEstimate(0.034, 0.012, 0.056, 9), "+.034 [+.012, +.056]"),
        (MeanEstimate(-0.034, -0.056, 0.001, 9), "-.034 [-.056, +.001]"),
        (MeanEstimate(-1.5, -2.0, -0.25, 9), "-1.500 [-2.000, -.250]"),
        (MeanEstimate(0.1, None, None, 3), "+.100 [\N{EN DASH}]"),
        (MeanEstimate(None, None, None, 0), "\N{EN DASH}"),
    ],
)
def test_compact_differences(estimate: MeanEstimate, text: str) -> None:
    assert compact_difference(estimate) == text


def contrast(mean: float | None, *, scenes: int = 8, **values: float | None) -> Contrast:
    names = ("low", "high", "p_value", "effect_size", "minimum_detectable", "q_value")
    known = dict.fromkeys(names) | values
    return Contrast(mean=mean, scenes=scenes, objects=scenes, **known)


@pytest.mark.parametrize(
    ("item", "text", "detected"),
    [
        (
            contrast(0.1, p_value=0.01, q_value=0.05, minimum_detectable=0.04),
            "detected; one test could detect .040",
            True,
        ),
        (
            contrast(0.1, p_value=0.01, q_value=0.0501, minimum_detectable=0.2),
            "not detected; alone it would be (.200)",
            False,
        ),
        (
            contrast(0.1, p_value=0.06, q_value=0.06, minimum_detectable=0.2),
            "not detected; one test could detect .200",
            False,
        ),
        (
            contrast(0.0, p_value=1.0, q_value=1.0, minimum_detectable=4e-4),
            "not detected; one test could detect <.001",
            False,
        ),
        (
            contrast(0.0, p_value=1.0, q_value=1.0, minimum_detectable=0.0),
            "the same in every scene",
            False,
        ),
        (contrast(0.0, scenes=3, p_value=1.0, q_value=1.0), "the same in every scene", False),
        (contrast(0.2, scenes=3), "not tested: 6 objects are needed", False),
        (contrast(None, scenes=0), " ", False),
    ],
)
def test_what_was_not_found_never_reads_as_nothing(
    item: Contrast, text: str, *, detected: bool
) -> None:
    assert " ".join(verdict(item)) == text
    assert item.detected == detected


def test_a_table_says_what_its_tests_are(table: Table) -> None:
    text = explanation(table)
    for phrase in (
        "adjusted by Benjamini and Hochberg over all differences of the table at the tolerance",
        "'detected' is q up to .050",
        "a single test at 5 % finds in 80 % of such runs",
        "none below 6 objects",
    ):
        assert phrase in text
    assert "Benjamini" not in explanation(table_of([record(0, (1, 1, 1, 1))]))


def test_probabilities_and_effects() -> None:
    assert [probability(p) for p in (None, 0.0004, 0.0005, 0.0123, 1.0)] == [
        *("\N{EN DASH}", "<.001", ".001", ".012", "1.000")
    ]
    assert [effect(value) for value in (None, 0.0, -1.234)] == ["\N{EN DASH}", "+0.00", "-1.23"]
