"""Two runs side by side: which scenes are the same, and what is left out."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from harness.bench import BenchOptions, run_bench
from harness.errors import InputError
from harness.results import Comparison, compare_runs, is_cluttered, show_run
from harness.runs.job import SceneJob
from harness.runs.records import SCHEMA_VERSION, Record, read_records, write_records
from harness.tests.fake_wiring import WIRING

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = BenchOptions(scenes=3, workers=1, out=tmp_path_factory.mktemp("runs") / "run")
    return run_bench(options, wiring=WIRING).folder


@pytest.fixture
def folder(tmp_path: Path, finished: Path) -> Path:
    return shutil.copytree(finished, tmp_path / "run")


@pytest.fixture
def changed(tmp_path: Path, folder: Path) -> Callable[[Callable[[Record], Record | None]], Path]:
    """The same run with other records: a function of each, None to lose it."""

    def changed(change: Callable[[Record], Record | None]) -> Path:
        other = shutil.copytree(folder, tmp_path / "other")
        records = map(change, read_records(other / "records.parquet"))
        write_records([row for row in records if row is not None], other / "records.parquet")
        return other

    return changed


def test_a_better_run_differs_by_as_much(
    folder: Path, changed: Callable[[Callable[[Record], Record | None]], Path]
) -> None:
    other = changed(lambda row: replace(row, accuracy=(row.accuracy or 0.0) - 0.25))
    found = compare_runs(folder, other, model_a="metric", model_b="metric")
    assert (found.scenes, found.unlike, found.only_first, found.only_second) == (6, [], 0, 0)
    assert found.settings == []
    assert [(item.category, item.scenes, item.objects) for item in found.differences] == [
        ("mug", 3, 3),
        ("bowl", 3, 3),
    ]
    for item in found.differences:
        assert item.tolerance_m == 0.005
        assert item.values["accuracy"].mean == pytest.approx(0.25)
    assert (found.first, found.model_b, found.empty) == (folder, "metric", [])


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"redraws": 1}, "mug-0001: its redraws is 0 in the one and 1 in the other"),
        ({"object_name": "x"}, "mug-0001: its object name is mug_1 in the one and x in the other"),
        ({"base_rate": 0.5}, "mug-0001: its base rate is None in the one and 0.5 in the other"),
    ],
)
def test_a_scene_that_is_another_in_the_other_run_is_left_out(
    folder: Path,
    changed: Callable[[Callable[[Record], Record | None]], Path],
    change: dict[str, object],
    why: str,
) -> None:
    other = changed(
        lambda row: replace(row, **change) if row.scene_id == "mug-0001" else row  # type: ignore[arg-type]
    )
    found = compare_runs(folder, other, model_a="metric", model_b="classic")
    assert (found.scenes, found.unlike) == (5, [why])
    assert [item.scenes for item in found.differences] == [2, 3]


def test_completers_are_compared_each_on_its_own_points(
    folder: Path, changed: Callable[[Callable[[Record], Record | None]], Path]
) -> None:
    other = changed(lambda row: replace(row, completion="centersnap", base_rate=0.5, accuracy=0.25))
    records = read_records(folder / "records.parquet")
    mine = [replace(row, completion="cloud", base_rate=0.75, accuracy=0.5) for row in records]
    write_records(mine, folder / "records.parquet")
    found = compare_runs(folder, other, model_a="metric", model_b="metric")
    assert (found.scenes, found.unlike) == (6, [])
    assert [item.completion for item in found.differences] == ["cloud less centersnap"] * 2
    assert {item.values["accuracy"].mean for item in found.differences} == {0.25}
    # Points of a box are another test set.
    write_records(records, folder / "records.parquet")
    with pytest.raises(InputError, match="share no scene that both scored; run both with the same"):
        compare_runs(folder, other, model_a="metric", model_b="metric")


def test_segmenters_are_compared_on_the_same_scenes(
    folder: Path, changed: Callable[[Callable[[Record], Record | None]], Path]
) -> None:
    other = changed(lambda row: replace(row, segmenter="net", accuracy=0.25))
    found = compare_runs(other, folder, model_a="metric", model_b="metric")
    assert (found.scenes, found.unlike) == (6, [])
    assert [item.segmenter for item in found.differences] == ["net less oracle"] * 2


def test_scenes_of_one_run_alone_are_counted(
    folder: Path, changed: Callable[[Callable[[Record], Record | None]], Path]
) -> None:
    other = changed(lambda row: None if row.scene_id.startswith("bowl") else row)
    found = compare_runs(folder, other, model_a="metric", model_b="metric")
    assert (found.scenes, found.only_first, found.only_second) == (3, 3, 0)


def test_runs_without_a_scene_in_common_are_refused(
    folder: Path, changed: Callable[[Callable[[Record], Record | None]], Path]
) -> None:
    other = changed(lambda row: replace(row, redraws=2))
    with pytest.raises(InputError, match=r"share no scene that both scored \(its redraws is 0 in"):
        compare_runs(folder, other, model_a="metric", model_b="metric")


def test_a_tolerance_that_the_second_lacks_is_named(tmp_path: Path, folder: Path) -> None:
    config = tmp_path / "wide.toml"
    config.write_text("[protocol]\ntolerances_m = [0.01]\nreported_tolerance_m = 0.01\n", "utf-8")
    options = BenchOptions(scenes=3, workers=1, out=tmp_path / "wide", config=config)
    wide = run_bench(options, wiring=WIRING).folder
    with pytest.raises(
        InputError, match=r"was not scored at 0\.005 m, the tolerance that .* repor"
    ):
        compare_runs(folder, wide, model_a="metric", model_b="metric")
    assert compare_runs(wide, folder, model_a="metric", model_b="metric").scenes == 6
    assert not is_cluttered(wide)


# --- bad input ---


def compare(first: Path, second: Path) -> Comparison:
    return compare_runs(first, second, model_a="metric", model_b="metric")


def test_an_unfinished_run_is_named(
    folder: Path, changed: Callable[[Callable[[Record], Record | None]], Path]
) -> None:
    other = changed(lambda row: row)
    (other / "records.parquet").unlink()
    for runs in ((folder, other), (other, folder)):
        with pytest.raises(InputError) as caught:
            compare(*runs)
        assert str(caught.value) == (
            f"{other} is unfinished; finish it with `harness bench --out {other}`"
        )


@pytest.mark.parametrize("sessions", [True, False])
def test_another_schema_version_is_said_before_its_tables_are_read(
    folder: Path,
    changed: Callable[[Callable[[Record], Record | None]], Path],
    *,
    sessions: bool,
) -> None:
    other = changed(lambda row: row)
    manifest = json.loads((other / "manifest.json").read_text(encoding="utf-8"))
    manifest["schema_version"] = 3
    # What an earlier version configured need not be readable either.
    manifest["config"] = {"scenes": {"fog": 1}}
    manifest["sessions"] = [{"git": {"revision": "abc"}}] if sessions else []
    (other / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    (other / "records.parquet").write_bytes(b"old")
    by = " (git revision abc)" if sessions else ""
    message = (
        f"{other} was written with record schema 3, this version reads {SCHEMA_VERSION}; read it "
        f"with the version that wrote it{by}, or run it again with `harness bench --config "
        f"{other / 'config.toml'}`"
    )
    with pytest.raises(InputError) as caught:
        compare(folder, other)
    assert str(caught.value) == message
    with pytest.raises(InputError) as caught:
        show_run(other)
    assert str(caught.value) == message


def test_corrupt_parquet_is_named(
    folder: Path, changed: Callable[[Callable[[Record], Record | None]], Path]
) -> None:
    other = changed(lambda row: row)
    path = other / "records.parquet"
    whole = path.read_bytes()
    for content in (whole[:-30], whole[: len(whole) // 2], b"", b"PAR1" * 10):
        path.write_bytes(content)
        with pytest.raises(InputError) as caught:
            compare(folder, other)
        assert str(caught.value).startswith(f"{path} is damaged (")
        assert str(caught.value).endswith(
            f"); delete it and resume the run with `harness bench --out {other}`"
        )


def test_a_class_without_a_scored_scene_is_named(
    folder: Path, changed: Callable[[Callable[[Record], Record | None]], Path]
) -> None:
    jobs = {
        record.scene_id: SceneJob(record.scene_id, record.category, record.object_name, record.seed)
        for record in read_records(folder / "records.parquet")
    }

    def lose_bowls(row: Record) -> Record:
        if row.category != "bowl":
            return row
        return Record.failed(
            jobs[row.scene_id],
            variant=row.variant,
            views=row.views,
            tolerance_m=row.tolerance_m,
            failure="lost",
        )

    other = changed(lose_bowls)
    found = compare(folder, other)
    assert [item.category for item in found.differences] == ["mug"]
    assert found.empty == [
        f"No scene of class 'bowl' is compared: {folder} scored 3 of its 3 scenes, {other} scored "
        "0 of its 3 scenes; failed scenes are tried again with `harness bench --out RUN`"
    ]
