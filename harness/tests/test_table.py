"""The table: numbers worked out by hand, and how each rendering shows them."""

from __future__ import annotations

import csv
import io
import itertools
import re
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from harness.runs.job import SceneJob
from harness.runs.records import Record, Variant
from harness.table.columns import COLUMNS, PARTS, SWEEP_COLUMNS
from harness.table.flat import HEADINGS, render_csv
from harness.table.latex import escape, render_latex
from harness.table.markdown import render_markdown
from harness.table.seed import seed_numbers
from harness.table.summary import Table, summarise
from harness.table.terminal import render_full

CLASSIC = Variant("classic")
LITERAL_SC = Variant("metric_literal", completion="centersnap")


def record(
    scene: int,
    counts: tuple[int, int, int, int],
    *,
    category: str = "mug",
    variant: Variant = CLASSIC,
    tolerance_m: float = 0.005,
    **values: Any,
) -> Record:
    tp, tn, fp, fn = counts
    return Record(
        scene_id=f"{category}-{scene:04d}",
        category=category,
        object_name=f"{category}_{scene}",
        seed=scene,
        model=variant.model,
        completion=variant.completion,
        segmenter=variant.segmenter,
        views=3,
        tolerance_m=tolerance_m,
        test_points=sum(counts),
        tp=tp,
        tn=tn,
        fp=fp,
        fn=fn,
        **values,
    )


def failed(scene: int, *, category: str = "mug", tolerance_m: float = 0.005) -> Record:
    job = SceneJob(f"{category}-{scene:04d}", category, f"{category}_0", scene)
    return Record.failed(job, variant=CLASSIC, views=3, tolerance_m=tolerance_m, failure="lost")


def table_of(records: list[Record]) -> Table:
    return summarise(records, reported_tolerance_m=0.005, classes=("mug", "bowl"), seed=0)


@pytest.fixture
def table() -> Table:
    """Three mug scenes, one failed, and one bowl scene, all at two tolerances."""
    return table_of(
        [
            row
            for tolerance_m in (0.005, 0.01)
            for row in (
                record(0, (4, 3, 2, 1), tolerance_m=tolerance_m, precision=4 / 6, auroc=0.9),
                record(1, (0, 8, 0, 2), tolerance_m=tolerance_m, precision=None, auroc=0.7),
                failed(2, tolerance_m=tolerance_m),
                record(0, (1, 1, 1, 1), category="bowl", tolerance_m=tolerance_m, precision=0.5),
            )
        ]
    )


def test_means_are_over_scored_scenes_and_counts_are_fractions(table: Table) -> None:
    mug, bowl = table.rows
    assert (mug.label, mug.scenes, mug.failed, mug.objects) == ("Mug classic", 2, 1, 2)
    assert mug.values["tp"].mean == pytest.approx((0.4 + 0.0) / 2)
    assert mug.values["tn"].mean == pytest.approx((0.3 + 0.8) / 2)
    assert mug.values["auroc"].mean == pytest.approx(0.8)
    assert (mug.values["auroc"].low, mug.values["auroc"].high) == (None, None)
    assert (mug.values["precision"].mean, mug.values["precision"].count) == (4 / 6, 1)
    assert (mug.values["f1"].mean, mug.values["f1"].count) == (None, 0)
    assert (bowl.label, bowl.scenes, bowl.failed) == ("Bowl classic", 1, 0)
    assert [row.tolerance_m for row in table.sweep] == [0.005, 0.01, 0.005, 0.01]


@pytest.fixture
def five() -> Table:
    """Ten scenes of five objects, each object's twice."""
    records = [record(i, (i % 5, 5, 2, 1), auroc=(i % 5) / 10) for i in range(10)]
    return table_of([replace(row, object_name=f"mug_{row.seed % 5}") for row in records])


def test_an_interval_is_that_of_the_objects(five: Table) -> None:
    once = table_of([record(i, (i, 5, 2, 1), auroc=i / 10) for i in range(5)])
    (twice,), (single,) = five.rows, once.rows
    assert (twice.scenes, twice.objects, single.objects) == (10, 5, 5)
    ours, theirs = twice.values["auroc"], single.values["auroc"]
    assert ours.mean == pytest.approx(0.2)
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high))
    assert 0.0 <= (ours.low or 0.0) < 0.2 < (ours.high or 0.0) <= 0.4


def test_every_rendering_counts_objects_and_shows_an_interval_or_a_dash(
    table: Table, five: Table
) -> None:
    assert "  10 scenes\n  5 objects\n" in re.sub(" +\n", "\n", shown(five, width=200))
    assert "10 scenes; 5 objects" in render_latex(five)
    assert re.search(r"\| 10 \| 5 \| 0 \| 0\.[0-9]{3} \[0\.[0-9]{3}, 0\.", render_markdown(five))
    assert "interval" in render_markdown(five)
    assert set(line(shown(table, width=200), "95 % from")[1:]) == {"\N{EN DASH}"}
    assert "| 0.200 [\N{EN DASH}] |" in render_markdown(table)
    assert "none (\N{EN DASH}) below 5 objects" in render_markdown(table)


def test_the_seed_stands_beside_ours(table: Table) -> None:
    mug, _ = table.rows
    assert mug.seed["tp"] == 0.356
    assert mug.difference("tp") == pytest.approx(0.2 - 0.356)
    assert mug.difference("auroc") is None


def test_the_seeds_numbers_are_consistent() -> None:
    for category, model, completion in itertools.product(
        ("mug", "bowl"), ("classic", "metric"), ("none", "centersnap")
    ):
        row = seed_numbers(category=category, variant=Variant(model, completion))
        assert row["tp"] + row["tn"] + row["fp"] + row["fn"] == pytest.approx(1, abs=0.0021)
        assert row["tp"] / (row["tp"] + row["fp"]) == pytest.approx(row["precision"], abs=0.0021)
        assert row["tp"] + row["tn"] == pytest.approx(row["accuracy"], abs=0.0021)
    assert seed_numbers(category="can", variant=CLASSIC) == {}
    assert seed_numbers(category="mug", variant=Variant("random")) == {}
    literal = seed_numbers(category="mug", variant=LITERAL_SC)
    assert literal == seed_numbers(category="mug", variant=Variant("metric", "other"))
    assert literal["precision"] == 0.659


def test_rows_come_in_the_seeds_order_and_absent_models_have_none() -> None:
    variants = [Variant("metric"), CLASSIC, LITERAL_SC, Variant("classic", "centersnap")]
    rows = table_of(
        [
            record(0, (1, 1, 1, 1), category=category, variant=variant)
            for category in ("can", "bowl", "mug")
            for variant in variants
        ]
    ).rows
    assert [row.label for row in rows[:4]] == [
        "Mug classic SC (centersnap)",
        "Mug metric literal SC (centersnap)",
        "Mug classic",
        "Mug metric",
    ]
    assert [row.category for row in rows] == ["mug"] * 4 + ["bowl"] * 4 + ["can"] * 4


def test_the_order_of_the_records_changes_nothing(table: Table) -> None:
    records = [record(i, (i, 5, 2, 1), auroc=i / 7) for i in range(6)]
    assert table_of(records) == table_of(records[::-1])


def test_a_label_names_a_segmenter_that_is_not_the_oracle() -> None:
    (row,) = table_of([record(0, (1, 1, 1, 1), variant=Variant("classic", segmenter="cnn"))]).rows
    assert row.label == "Mug classic [cnn]"


def shown(table: Table, *, width: int) -> str:
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(render_full(table, width=width))
    return console.export_text()


def line(text: str, start: str) -> list[str]:
    found = next(line for line in text.splitlines() if line.strip().startswith(start))
    return re.split(r" {2,}", found.strip())


def test_terminal(table: Table) -> None:
    text = shown(table, width=200)
    assert line(text, "TP")[:4] == ["TP", "TN", "FP", "FN"]
    assert line(text, "Mug classic")[1:6] == ["0.200", "0.550", "0.100", "0.150", "0.667"]
    assert line(text, "seed")[1:] == ["0.356", "0.139", "0.414", "0.091", "0.462", "0.495"]
    assert line(text, "ours less seed")[1:3] == ["-0.156", "+0.411"]
    assert line(text, "defined in")[5] == "1"
    assert "2 scenes, 1 failed" in text
    assert "1 scene\n  1 object\n" in re.sub(" +\n", "\n", text)
    assert "Mug classic, 10 mm" in text


@pytest.mark.parametrize("width", [40, 60, 80, 100, 140, 200, 300])
def test_no_width_cuts_a_number_or_a_heading(table: Table, width: int) -> None:
    text = shown(table, width=width)
    assert "…" not in text
    assert max(len(row) for row in text.splitlines()) <= width
    for column in COLUMNS:
        assert column.heading in text
    tables = text.split("By tolerance")[0].count("\N{BOX DRAWINGS LIGHT HORIZONTAL}\n")
    assert (tables == 1) == (width >= 300)


@pytest.mark.parametrize("width", [80, 100, 120])
def test_a_confidence_stands_beside_its_baselines(width: int) -> None:
    values: dict[str, Any] = {"aurc": 0.1, "random_aurc": 0.4, "nearest_aurc": 0.3}
    text = shown(table_of([record(0, (1, 1, 1, 1), **values)]), width=width)
    assert line(text, "AURC") == ["AURC", "random", "nearest", "risk@50", "risk@80"]
    below = text[text.index("AURC   ") :]
    assert line(below, "Mug classic")[1:4] == ["0.100", "0.400", "0.300"]


def test_terminal_without_a_scene() -> None:
    assert "no scene was scored" in shown(table_of([]), width=80)
    (row,) = table_of([failed(0)]).rows
    assert (row.scenes, row.failed) == (0, 1)
    assert "0 scenes, 1 failed" in shown(table_of([failed(0)]), width=80)


def test_markdown(table: Table) -> None:
    lines = render_markdown(table).splitlines()
    mug = next(line for line in lines if line.startswith("| **Mug classic**"))
    assert mug.startswith("| **Mug classic** | 2 | 2 | 1 | 0.200 [\N{EN DASH}] | 0.550 [")
    assert "| 0.667 [\N{EN DASH}] n=1 |" in mug
    assert "| seed |  |  |  | 0.356 | 0.139 | 0.414 | 0.091 | 0.462 | 0.495 |" in lines
    for block in "\n".join(lines).split("\n\n"):
        rows = [line for line in block.splitlines() if line.startswith("|")]
        assert len({line.count("|") for line in rows}) <= 1


def test_latex(table: Table) -> None:
    text = render_latex(table)
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") == len(PARTS) + 1
    assert r"Mug classic & 0.200 & 0.550 & 0.100 & 0.150 & 0.667 & -- \\" in text
    assert text.count(r"\toprule") == text.count(r"\bottomrule") == len(PARTS) + 1
    body = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert {line.count(" & ") for line in body} == {len(part) for part in PARTS} | {
        len(SWEEP_COLUMNS) + 1
    }


def test_latex_sets_special_characters_as_they_are() -> None:
    assert escape(r"a_b 95 % {x} & # $ ^ ~ \y") == (
        r"a\_b 95 \% \{x\} \& \# \$ \textasciicircum{} \textasciitilde{} \textbackslash{}y"
    )


def test_csv(table: Table) -> None:
    lines = list(csv.DictReader(io.StringIO(render_csv(table))))
    assert tuple(lines[0]) == HEADINGS
    assert len(lines) == 2 * 2 * len(COLUMNS)
    tp = next(line for line in lines if line["metric"] == "tp")
    assert (tp["category"], tp["model"], tp["tolerance_m"]) == ("mug", "classic", "0.005")
    assert float(tp["mean"]) == pytest.approx(0.2)
    assert (tp["scenes_defined"], tp["scenes"], tp["objects"], tp["failed"]) == ("2", "2", "2", "1")
    assert float(tp["ours_less_seed"]) == pytest.approx(0.2 - 0.356)
    f1 = next(line for line in lines if line["metric"] == "f1")
    assert (f1["mean"], f1["scenes_defined"], f1["seed"]) == ("", "0", "")
    swept = next(line for line in lines if line["tolerance_m"] == "0.01")
    assert swept["seed"] == ""
