"""The short table, its differences and the confusion: numbers by hand, and what fits a terminal."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from rich.console import Console

from harness.runs.confusion import Confusion
from harness.runs.records import Record, Variant
from harness.statistics import MeanEstimate, PairedTest, benjamini_hochberg, paired_test
from harness.table.brief import render_brief
from harness.table.cells import (
    chunks,
    compact,
    compact_difference,
    effect,
    explanation,
    probability,
    verdict,
)
from harness.table.columns import DIFFERENCE_COLUMNS
from harness.table.confusion import confusion_shares, render_confusion
from harness.table.contrasts import difference_lines
from harness.table.differences import Contrast, paired_differences
from harness.table.flat import render_csv
from harness.table.latex import render_latex
from harness.table.markdown import render_markdown
from harness.table.summary import MODEL_ORDER, Table, summarise
from harness.tests.test_table import failed, record, table_of

if TYPE_CHECKING:
    from rich.console import RenderableType

ACCURACY = dict(zip(MODEL_ORDER, (0.75, 0.8, 0.5, 0.9, 0.88, 0.7), strict=True))


def scene_records(scene: int, *, category: str = "mug", completion: str = "none") -> list[Record]:
    """All six models on one scene; a later scene is better by a hundredth."""
    return [
        record(
            scene,
            (4, 3, 2, 1),
            category=category,
            variant=Variant(model, completion),
            accuracy=accuracy + scene / 100 * (model == "metric"),
            precision=None if model == "nearest" and scene == 0 else 0.5,
            base_rate=0.4,
            clamped_share=0.25 if model == "metric_literal" else 0.0,
        )
        for model, accuracy in ACCURACY.items()
    ]


def cells(*, completion: str = "none", category: str = "mug", scenes: int = 6) -> list[Record]:
    return [
        row
        for scene in range(scenes)
        for row in scene_records(scene, category=category, completion=completion)
    ]


@pytest.fixture
def table() -> Table:
    """Six mug scenes in both test sets, and two bowl scenes in one."""
    return table_of(
        [*cells(), *cells(completion="perturbed"), *cells(category="bowl", scenes=2)][::-1]
    )


def shown(content: RenderableType, *, width: int) -> str:
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(content)
    return console.export_text()


def lines_of(text: str, title: str) -> list[list[str]]:
    """Cells of the lines under a title, up to the next empty line."""
    block = text[text.index(title) :].split("\n\n")[0].splitlines()[1:]
    block = [line for line in block if line.strip()]
    return [re.split(r" {2,}", line.strip()) for line in block]


def test_every_class_and_test_set_lists_the_models_in_order(table: Table) -> None:
    text = shown(render_brief(table, width=100), width=100)
    titles = ["Mug SC (perturbed): 6 scenes, 6 objects, 40% of", "Mug: 6 scenes", "Bowl: 2 scenes"]
    assert [text.index(title) for title in titles] == sorted(map(text.index, titles))
    head, *rows = lines_of(text, "Mug: 6 scenes")
    assert head == [
        *("TP", "TN", "FP", "FN", "precision", "accuracy", "AUROC", "AURC", "ECE", "recal."),
        "clamped",
    ]
    assert [row[0] for row in rows] == [
        *("classic", "classic tuned", "metric literal", "metric", "network", "nearest"),
        *("defined in", "seed: classic", "seed: metric"),
    ]
    assert rows[3][:7] == ["metric", ".400", ".300", ".200", ".100", ".500", ".925"]
    assert rows[2][-1] == ".250"
    assert rows[6][5] == "5"
    assert rows[7] == ["seed: classic", ".356", ".139", ".414", ".091", ".462", ".495"]


def test_the_clamped_share_has_a_column_only_where_there_is_any() -> None:
    (classic,) = table_of([record(0, (4, 3, 2, 1), clamped_share=0.0)]).groups()
    text = shown(render_brief(table_of([record(0, (4, 3, 2, 1))]), width=100), width=100)
    assert "clamped" not in text
    assert classic[0].values["clamped_share"].mean == 0.0


@pytest.mark.parametrize("width", [40, 60, 80, 100, 160])
def test_no_width_cuts_a_number_or_a_heading(table: Table, width: int) -> None:
    text = shown(render_brief(table, width=width), width=width)
    assert "…" not in text
    assert max(len(row.rstrip()) for row in text.splitlines()) <= width
    for word in ("precision", "accuracy", "clamped", "metric - classic tuned", "[95 % interval]"):
        assert word in text
    # From 100 columns on, a verdict stands in one line with its number.
    assert bool(re.search(r"\+5\.62  not detected; alone it would be", text)) == (width >= 100)


def test_a_hundred_columns_hold_a_group_and_each_difference_in_a_line(table: Table) -> None:
    text = shown(render_brief(table, width=100), width=100)
    assert len(lines_of(text, "Mug: 6 scenes")) == 10
    head, *rows = lines_of(text, "Mug, paired differences: 6 scenes, 6 objects")
    assert head == ["mean [95 % interval]", "n", "p", "q", "effect"]
    titles = [f"metric - {name}" for name in ("classic tuned", "classic", "network", "nearest")]
    assert [row[0] for row in rows] == [
        *(cell for title in titles for cell in (title, "precision", "accuracy"))
    ]
    # Every object is better by a tenth and more: 2 of 64 changes of signs are as far out.
    mean, count, *values = rows[2][1:]
    assert re.fullmatch(r"\+\.125 \[\+\.1\d\d, \+\.1\d\d\]", mean)
    assert (count, values[0]) == ("6", ".031")
    assert rows[1][-1] == "in every scene"
    assert rows[-2][2] == "5"


def test_compared_cells_stand_under_one_heading(table: Table) -> None:
    items = [(f"{item.category} {item.completion}", item) for item in table.differences[:2]]
    text = "\n".join(line.plain for line in difference_lines(items, width=100))
    assert text.count("[95 % interval]") == 1
    assert [line for line in text.splitlines() if not line.startswith(" ")] == ["mug perturbed"] * 2
    nothing = replace(table.differences[0], values={})
    empty = {column.key: contrast(None, scenes=0) for column in DIFFERENCE_COLUMNS}
    (line,) = difference_lines([("mug", replace(nothing, values=empty))], width=100)
    assert line.plain == "no scene defines a difference"


def test_a_table_without_a_scene() -> None:
    assert "no scene was scored" in shown(render_brief(table_of([]), width=80), width=80)
    text = shown(render_brief(table_of([failed(0)]), width=80), width=80)
    assert "Mug: 0 scenes, 1 failed, 0 objects" in text


# --- differences ---


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


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.8314, ".831"), (1.0, "1.000"), (0.9996, "1.000"), (0.0, ".000"), (None, "\N{EN DASH}")],
)
def test_compact_numbers(value: float | None, text: str) -> None:
    assert compact(value) == text


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
            "detected; this run could detect .040",
            True,
        ),
        (
            contrast(0.1, p_value=0.01, q_value=0.0501, minimum_detectable=0.2),
            "not detected; alone it would be (.200)",
            False,
        ),
        (
            contrast(0.1, p_value=0.06, q_value=0.06, minimum_detectable=0.2),
            "not detected; this run could detect .200",
            False,
        ),
        (
            contrast(0.0, p_value=1.0, q_value=1.0, minimum_detectable=4e-4),
            "not detected; this run could detect <.001",
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


def test_chunks_fill_lines_and_hold_one_item_at_least() -> None:
    assert chunks("abcd", [3, 3, 3, 3], room=7) == ["ab", "cd"]
    assert chunks("abc", [9, 1, 1], room=2) == ["a", "bc"]
    assert chunks("a", [9], room=2) == ["a"]


# --- confusion ---


def confused(true: str, predicted: str, points: int, *, scene: int = 0) -> Confusion:
    return Confusion(
        scene_id=f"mug-{scene:04d}",
        model="metric",
        completion="none",
        tolerance_m=0.005,
        true=true,
        predicted=predicted,
        points=points,
    )


def test_confusion_is_normalised_by_true_category_over_all_scenes() -> None:
    rows = [
        confused("mug", "mug", 30),
        confused("mug", "bowl", 10),
        confused("mug", "mug", 50, scene=1),
        confused("mug", "free", 10, scene=1),
        confused("free", "free", 7),
    ]
    assert confusion_shares(rows) == {
        "free": (7, [1.0, 0, 0, 0, 0, 0, 0]),
        "mug": (100, [0.1, 0, 0.1, 0, 0, 0, 0.8]),
    }
    text = shown(render_confusion(rows), width=100)
    assert "Confusion, metric\n" in re.sub(" +\n", "\n", text)
    assert re.search(r"^mug +0\.100 +0\.100 +0\.800 +100 *$", text, re.MULTILINE)
    assert max(map(len, text.splitlines())) <= 100


def test_confusions_come_in_the_order_of_the_table() -> None:
    rows = [
        replace(confused("mug", "mug", 1), model=model, completion=completion)
        for model in ("network", "classic")
        for completion in ("none", "perturbed")
    ]
    text = shown(render_confusion(rows), width=100)
    assert re.findall(r"Confusion, (.*?) *\n", text) == [
        *("classic SC (perturbed)", "network SC (perturbed)", "classic", "network")
    ]
