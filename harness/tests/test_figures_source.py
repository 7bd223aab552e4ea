from __future__ import annotations

import json
import os
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from harness.errors import InputError
from harness.figures.source import (
    Cell,
    NothingToDrawError,
    RunSource,
    median_scene,
    newest_run,
    order_models,
)
from harness.tests.fake_html_report import job, record, write_run

if TYPE_CHECKING:
    from pathlib import Path

    from harness.runs.records import Record


def scored(index: int, accuracy: float, *, model: str = "metric", completion: str) -> Record:
    made = record(job("mug", index), model="metric", completion=completion, accuracy=accuracy)
    return replace(made, model=model)


def test_median_scene_by_hand() -> None:
    completed = [scored(i, a, completion="cloud") for i, a in enumerate((0.9, 0.1, 0.5, 0.6))]
    assert median_scene(completed, "mug") == "mug-0002", "of four the second by accuracy: 0.5"
    assert median_scene(completed[:3], "mug") == "mug-0002"
    assert median_scene(completed[:1], "mug") == "mug-0000"
    assert median_scene(completed, "bowl") is None
    ties = [scored(i, 0.5, completion="cloud") for i in (3, 1, 2)]
    assert median_scene(ties, "mug") == "mug-0002", "ties go by id"


def test_median_goes_by_the_metric_model_on_completed_points() -> None:
    records = [
        *(scored(i, a, completion="cloud") for i, a in enumerate((0.1, 0.2, 0.3))),
        *(scored(i, a, completion="none") for i, a in enumerate((0.5, 0.1, 0.9))),
        *(scored(i, a, model="classic", completion="cloud") for i, a in enumerate((0.9, 0.8, 0.7))),
    ]
    assert median_scene(records, "mug") == "mug-0001"
    boxes = [item for item in records if item.completion == "none"]
    assert median_scene(boxes, "mug") == "mug-0000", "without a completion by the box"
    foreign = [
        scored(i, a, model="classic", completion="none") for i, a in enumerate((0.3, 0.1, 0.2))
    ]
    assert median_scene(foreign, "mug") == "mug-0002", "without the metric model by the first"


def test_models_are_in_the_tables_order() -> None:
    assert order_models({"zoo", "nearest", "mine", "classic"}) == [
        "classic",
        "nearest",
        "mine",
        "zoo",
    ]


def test_a_run_is_read(tmp_path: Path) -> None:
    source = RunSource.open(write_run(tmp_path / "run").folder)
    assert [item.category for item in source.cells] == ["mug", "mug", "bowl", "bowl"]
    assert source.cells[0] == Cell("mug", "cloud")
    assert source.cells[1].label == "mug, points in the box"
    assert source.models == ["classic_tuned", "metric", "nearest"]
    # Accuracies are equal: of mugs 0 to 5 the third, of bowls 0 to 3 (4 was missed, 5 failed) the
    # second.
    assert [item.scene_id for item in source.chosen] == ["mug-0002", "bowl-0001"]
    assert source.most_tracked is source.chosen, "a run without neighbours tracks one object"
    assert source.points.cells["bowl", "none", "metric"][-1].scene_id == "bowl-0004"


def test_a_run_without_recordings_has_nothing_to_choose(tmp_path: Path) -> None:
    source = RunSource.open(write_run(tmp_path / "run", record_scenes=False).folder)
    for what in ("chosen", "points"):
        with pytest.raises(NothingToDrawError, match="no recordings: resume it"):
            getattr(source, what)


def test_newest_run_is_the_one_written_last(tmp_path: Path) -> None:
    old, new = (write_run(tmp_path / name, objects=1).folder for name in ("b", "a"))
    (tmp_path / "notes").mkdir()
    for age, folder in enumerate((new, old)):
        os.utime(folder / "records.parquet", ns=(0, 10**18 - age))
    assert newest_run(tmp_path) == new


def test_folders_that_hold_no_finished_run_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere holds no finished run with recordings; run"):
        newest_run(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"holds no run; pass the folder that `harness bench`"):
        RunSource.open(tmp_path)
    run = write_run(tmp_path / "run", objects=1).folder
    (run / "records.parquet").unlink()
    with pytest.raises(InputError, match=r"run is unfinished; finish it with `harness bench --out"):
        RunSource.open(run)
    with pytest.raises(InputError, match="holds no finished run"):
        newest_run(tmp_path)


def test_a_run_of_another_record_schema_is_refused(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", objects=1, record_scenes=False).folder
    old = json.loads((run / "manifest.json").read_text("utf-8")) | {"schema_version": 3}
    (run / "manifest.json").write_text(json.dumps(old), "utf-8")
    with pytest.raises(InputError, match="run was written with record schema 3, this version"):
        RunSource.open(run)
