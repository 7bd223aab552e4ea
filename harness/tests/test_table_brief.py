"""The short table, its differences and the confusion: numbers by hand, and what fits a terminal."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from rich.console import Console

from harness.runs.confusion import Confusion
from harness.runs.records import Record, Variant
from harness.table.brief import render_brief
from harness.table.cells import (
    chunks,
    compact,
)
from harness.table.confusion import confusion_shares, render_confusion
from harness.table.summary import MODEL_ORDER, Table
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


def test_a_table_without_a_scene() -> None:
    assert "no scene was scored" in shown(render_brief(table_of([]), width=80), width=80)
    text = shown(render_brief(table_of([failed(0)]), width=80), width=80)
    assert "Mug: 0 scenes, 1 failed, 0 objects" in text


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.8314, ".831"), (1.0, "1.000"), (0.9996, "1.000"), (0.0, ".000"), (None, "\N{EN DASH}")],
)
def test_compact_numbers(value: float | None, text: str) -> None:
    assert compact(value) == text


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
