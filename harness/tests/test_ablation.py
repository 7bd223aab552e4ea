"""Ablations on scenes small enough for a fraction of a second."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import polars as pl
import pytest

from harness import cli
from harness.ablation.cells import run_cells
from harness.ablation.frame import read_cell
from harness.ablation.job import CellScene, SceneCells
from harness.ablation.run import RECORDS, AblateOptions, plan_ablation, run_ablation
from harness.ablation.spec import Cell, find_spec, read_spec, ready_grids
from harness.ablation.summary import VARIED
from harness.bench import load_objects
from harness.engines.choice import make_engine
from harness.errors import InputError
from harness.runs.directory import RunDirectory
from harness.runs.job import plan_jobs
from harness.scene_run import run_scene

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

BASE = """
[base.run]
scenes = 1
classes = ["mug"]
[base.scenes]
width = 160
height = 120
views = 2
[base.protocol]
test_points = 100
test_sets = ["box"]
[base.pipeline]
segmenter = "oracle"
completer = "none"
[base.pipeline.training]
points = 120
[base.pipeline.gp]
models = ["classic_tuned", "nearest"]
"""


def grid(tmp_path: Path, text: str, *, base: str = BASE) -> Path:
    path = tmp_path / "grid.toml"
    path.write_text(base + text, encoding="utf-8")
    return path


def cells_of(path: Path) -> list[Cell]:
    return read_spec(path).cells()


def one_scene(cells: Sequence[Cell]) -> SceneCells:
    parts = [
        CellScene(str(cell.index), plan_jobs(cell.config, load_objects(None))[0], cell.config)
        for cell in cells
    ]
    return SceneCells("mug-0000", tuple(parts))


GRID = """
[grid]
pipeline.map.resolution_m = [0.005, 0.008]
pipeline.training.points = [60, 120]
protocol.reported_tolerance_m = [0.005, 0.01]
[choices.completion.off]
[choices.completion.cloud]
protocol.test_sets = ["box", "completed"]
pipeline.completer = "cloud"
"""


def test_a_grid_is_all_combinations_the_first_axis_slowest(tmp_path: Path) -> None:
    cells = cells_of(grid(tmp_path, GRID))
    assert len(cells) == 16
    first, second, last = cells[0], cells[1], cells[-1]
    assert first.labels == {
        "pipeline.map.resolution_m": 0.005,
        "pipeline.training.points": 60,
        "protocol.reported_tolerance_m": 0.005,
        "completion": "off",
    }
    assert second.labels == {**first.labels, "completion": "cloud"}
    assert second.config.protocol.test_sets == ("box", "completed")
    assert second.config.pipeline["completer"] == "cloud"
    assert last.config.pipeline["map"]["resolution_m"] == 0.008
    assert last.config.run.record == "nothing"
    assert len({cell.config.short_hash() for cell in cells}) == 16


def test_what_cells_share_is_computed_once_and_to_the_same_bits(tmp_path: Path) -> None:
    job = one_scene(cells_of(grid(tmp_path, GRID)))
    found = run_cells(job)
    assert found.failures == {}
    assert found.computed == {
        "render": 1,
        "segment": 1,
        "map": 2,  # resolutions
        "complete": 2,  # resolutions
        "meshes": 1,
        "target": 2,  # resolutions
        "training points": 4,  # resolutions x numbers of points
        # The box's points alone, and with the completed ones of each resolution.
        "test points": 3,
        "truth": 3,
        "classify": 16,  # 4 training sets x (with completion or without) x 2 models; no tolerance
    }
    for part in job.parts:
        alone = run_scene(part.job, part.config)
        assert found.results[part.cell].records == alone.records
        assert found.results[part.cell].confusion == alone.confusion


def test_a_change_of_the_frames_shares_nothing(tmp_path: Path) -> None:
    found = run_cells(one_scene(cells_of(grid(tmp_path, "[grid]\nscenes.views = [1, 2]\n"))))
    assert set(found.computed.values()) == {2, 4}
    assert found.computed["classify"] == 4


def test_a_model_shares_what_settings_of_others_leave_alone(tmp_path: Path) -> None:
    other = "[grid]\npipeline.gp.classic_tuned.lengthscale_m = [0.01, 0.02]\n"
    found = run_cells(one_scene(cells_of(grid(tmp_path, other))))
    assert found.computed["training points"] == 1
    assert found.computed["classify"] == 4
    metric = "[grid]\npipeline.metric.lengthscale_m = [0.01, 0.02]\n"
    found = run_cells(one_scene(cells_of(grid(tmp_path, metric))))
    assert found.computed["classify"] == 2
    named = '[grid]\npipeline.gp.models = [["nearest"], ["nearest", "classic_tuned"]]\n'
    found = run_cells(one_scene(cells_of(grid(tmp_path, named))))
    assert found.computed["classify"] == 2


def test_a_cell_that_fails_takes_no_other_with_it(tmp_path: Path) -> None:
    blind = "[grid]\npipeline.map.max_range_m = [0.01, 2.0]\n"
    found = run_cells(one_scene(cells_of(grid(tmp_path, blind))))
    assert list(found.results) == ["1"]
    assert "the map holds no object where" in found.failures["0"]


@pytest.fixture(scope="module")
def ablated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A grid of two values of a noise, and the folder of its ablation."""
    folder = tmp_path_factory.mktemp("ablation")
    path = grid(folder, "[grid]\npipeline.training.points = [60, 120]\n")
    run_ablation(AblateOptions(str(path), scenes=2, out=folder / "out"))
    return path, folder / "out"


def test_every_cell_is_a_run(ablated: tuple[Path, Path]) -> None:
    path, out = ablated
    cells = read_spec(path).cells()
    frame = pl.read_parquet(out / RECORDS)
    assert frame["cell"].unique().sort().to_list() == [0, 1]
    assert frame["grid.pipeline.training.points"].unique().sort().to_list() == [60, 120]
    assert len(frame) == 2 * 2 * 2  # cells x scenes x models, at one tolerance
    folders = sorted((out / "cells").iterdir())
    assert len(folders) == len(cells)
    for folder in folders:
        assert cli.main(["show", str(folder)]) == 0
        assert len(read_cell(RunDirectory(folder))) == 4
        assert not (folder / "recordings").exists()


def test_the_same_ablation_again_does_no_stage(ablated: tuple[Path, Path]) -> None:
    path, out = ablated
    files = {file: file.stat().st_mtime_ns for file in out.rglob("scenes/*.json")}
    before = (out / RECORDS).read_bytes()
    again = run_ablation(AblateOptions(str(path), scenes=2, out=out))
    assert (again.stages, again.computed, again.scenes, again.failures) == ({}, 0, 4, {})
    assert {file: file.stat().st_mtime_ns for file in out.rglob("scenes/*.json")} == files
    assert (out / RECORDS).read_bytes() == before


def test_a_larger_grid_computes_what_is_new(ablated: tuple[Path, Path], tmp_path: Path) -> None:
    path, out = ablated
    larger = tmp_path / "larger.toml"
    larger.write_text(path.read_text().replace("[60, 120]", "[60, 90, 120]"), encoding="utf-8")
    found = run_ablation(AblateOptions(str(larger), scenes=2, out=out))
    assert (found.computed, found.scenes) == (2, 6)
    assert found.stages["render"] == 2
    assert found.stages["classify"] == 4


def test_a_lost_scene_is_computed_again_to_the_same_bytes(
    ablated: tuple[Path, Path], tmp_path: Path
) -> None:
    path, _out = ablated
    first = run_ablation(AblateOptions(str(path), scenes=2, out=tmp_path / "first"))
    whole = (tmp_path / "first" / RECORDS).read_bytes()
    lost = next((tmp_path / "first" / "cells").rglob("mug-0001.json"))
    lost.write_bytes(lost.read_bytes()[:-10])
    (tmp_path / "first" / RECORDS).unlink()
    second = run_ablation(AblateOptions(str(path), scenes=2, out=tmp_path / "first"))
    assert (first.computed, second.computed) == (4, 1)
    assert (tmp_path / "first" / RECORDS).read_bytes() == whole


def test_differences_are_paired_with_the_first_cell(ablated: tuple[Path, Path]) -> None:
    path, out = ablated
    found = run_ablation(AblateOptions(str(path), scenes=2, out=out))
    frame = pl.read_parquet(out / RECORDS)
    entry = next(
        item
        for item in found.summary.entries
        if (item.cell, item.group[2], item.metric) == (1, "classic_tuned", "accuracy")
    )
    of_model = frame.filter(pl.col("model") == "classic_tuned").sort("cell", "scene_id")
    first, second = of_model["accuracy"].to_list()[:2], of_model["accuracy"].to_list()[2:]
    assert entry.estimate.mean == pytest.approx(sum(second) / 2)
    assert entry.difference is not None
    assert entry.difference.mean == pytest.approx((sum(second) - sum(first)) / 2)
    assert entry.difference.scenes == 2
    lines = (out / "summary.csv").read_text().splitlines()
    assert lines[0].startswith("cell,grid.pipeline.training.points,category,test_set")
    # 2 cells x 2 models x 6 metrics
    assert len(lines) == 1 + 24


def test_the_command_lists_runs_and_explains(
    ablated: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = ablated
    assert cli.main(["ablate", "--list"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in ("table3", "views", "noise", "training_points"))
    assert cli.main(["ablate", str(path), "--dry-run"]) == 0
    assert capsys.readouterr().out.splitlines()[0].strip().startswith("0 points 60 (")
    assert cli.main(["ablate", str(path), "--scenes", "2", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "accuracy: mug, box" in said
    assert "stages computed: none" in said
    assert cli.main(["ablate", str(path), "--scenes", "2", "--out", str(out), "--json"]) == 0
    assert '"computed": 0' in capsys.readouterr().out


@pytest.mark.parametrize("name", sorted(ready_grids()))
def test_ready_grids_are_whole(name: str) -> None:
    spec = read_spec(find_spec(name))
    assert spec.about
    assert len(spec.cells()) >= 3


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[grid]\nscenes.vews = [1]\n", r"grid\.toml \(scenes\.vews = 1\): unknown key 'vews' in"),
        ("[grid]\npipeline.gp.kernel = [1]\n", r"grid\.toml \(pipeline\.gp\.kernel = 1\).*kernel"),
        ("[grid]\nscenes.views = [1, 99]\n", r"scenes\.views = 99\): scenes\.views = 99"),
        ("[grid]\nscenes.views = 3\n", r"\[grid\] scenes\.views = 3: give a list of at least one"),
        ("[grid]\nscenes.views = []\n", r"scenes\.views = \[\]: give a list of at least one"),
        ("[grid]\nscenes.views = [1, 1]\n", r"scenes\.views has 1 twice; list each value once"),
        ("[axes]\na = 1\n", r"unknown table 'axes'; an ablation has \[base\], \[grid\]"),
        ("[choices.a]\nb = 1\n", r"\[choices\.a\] should hold a table for each step"),
        ("grid = 3\n", r"grid should be a table"),
        (
            "[grid]\nrun.seed.x = [1]\nrun.classes.y = [1]\n",
            r"key 'run\.classes\.y' leads through 'classes', which is no table",
        ),
    ],
)
def test_what_spans_no_grid_is_refused(tmp_path: Path, text: str, complaint: str) -> None:
    base = "" if text.startswith("grid =") else BASE
    with pytest.raises(InputError, match=complaint):
        cells_of(grid(tmp_path, text, base=base))


def test_a_grid_that_is_nowhere_names_the_ready_ones() -> None:
    with pytest.raises(InputError, match=r"viwes: no such file, and no ready grid .*views"):
        find_spec("viwes")


def test_too_many_cells_are_a_slip(tmp_path: Path) -> None:
    many = ", ".join(map(str, range(50)))
    text = f"[grid]\nrun.seed = [{many}]\npipeline.training.points = [{many}]\n"
    with pytest.raises(InputError, match="spans 2500 cells; 2000 at most"):
        read_spec(grid(tmp_path, text))


def test_cells_of_one_configuration_share_a_run(tmp_path: Path) -> None:
    text = "[choices.a.one]\n[choices.a.two]\nscenes.views = 2\n"
    found = run_ablation(AblateOptions(str(grid(tmp_path, text)), out=tmp_path / "out"))
    assert (len(found.cells), found.computed) == (2, 1)
    frame = pl.read_parquet(tmp_path / "out" / RECORDS)
    assert frame["grid.a"].to_list() == ["one", "one", "two", "two"]
    assert replace(found.cells[0], index=1, labels={"a": "two"}) == found.cells[1]


def test_a_completer_that_looks_at_the_table_completes_again(tmp_path: Path) -> None:
    text = """
[grid]
pipeline.metric.table_height_m = [0.0, 0.005]
[choices.completion.cloud]
protocol.test_sets = ["completed"]
pipeline.completer = "cloud"
"""
    job = one_scene(cells_of(grid(tmp_path, text)))
    found = run_cells(job)
    assert found.failures == {}
    assert (found.computed["map"], found.computed["complete"]) == (1, 2)
    for part in job.parts:
        assert found.results[part.cell].records == run_scene(part.job, part.config).records


@pytest.mark.parametrize(
    ("text", "options", "complaint"),
    [
        (
            '[grid]\npipeline.completer = ["none"]\n[choices.c.on]\npipeline.completer = "cloud"\n',
            {},
            r"grid\.toml: pipeline\.completer and c both set pipeline\.completer; leave it to one",
        ),
        ("[grid]\nrun.seed = [0, 1]\n", {"seed": 5}, r"run\.seed and --seed both set run\.seed"),
        ("[choices]\na = {}\n", {}, r"\[choices\.a\] should hold a table for each step"),
        (
            '[grid]\nprotocol.test_sets = [["completed"]]\n',
            {},
            r"grid\.toml \(protocol\.test_sets = 'completed'\): .*completer is 'none'",
        ),
    ],
)
def test_axes_that_contradict_each_other_are_refused(
    tmp_path: Path, text: str, options: dict[str, Any], complaint: str
) -> None:
    with pytest.raises(InputError, match=complaint):
        plan_ablation(AblateOptions(str(grid(tmp_path, text)), **options))


def test_a_base_that_is_no_table_is_refused(tmp_path: Path) -> None:
    path = grid(tmp_path, "[base]\nrun = 3\n[grid]\nscenes.views = [1]\n", base="")
    with pytest.raises(InputError, match=r"base\.run = 3: should be a table; write \[base\.run\]"):
        read_spec(path)


def test_models_can_be_an_axis(tmp_path: Path) -> None:
    text = '[grid]\npipeline.gp.models = [["nearest"], ["classic_tuned"]]\n'
    found = run_ablation(AblateOptions(str(grid(tmp_path, text)), out=tmp_path / "out"))
    (entry,) = (
        item for item in found.summary.entries if item.cell == 1 and item.metric == "accuracy"
    )
    assert entry.group == ("mug", "box", VARIED)
    assert entry.difference is not None
    assert entry.difference.scenes == 1


def test_an_interrupted_conclusion_is_made_up_for(
    ablated: tuple[Path, Path], tmp_path: Path
) -> None:
    path, _ = ablated
    out = tmp_path / "out"
    run_ablation(AblateOptions(str(path), scenes=1, out=out))
    (cell, _) = sorted((out / "cells").iterdir())
    whole = {file.name: file.read_bytes() for file in cell.glob("*.parquet")}
    for lost in ("records.parquet", "confusion.parquet", "table.md"):
        (cell / lost).unlink()
    # Records that are older than a scene are of another sitting.
    other = sorted((out / "cells").iterdir())[1]
    stale = other / "records.parquet"
    stale.write_bytes(b"stale")
    os.utime(stale, (0, 0))
    again = run_ablation(AblateOptions(str(path), scenes=1, out=out))
    assert again.computed == 0
    assert (cell / "table.md").exists()
    assert stale.read_bytes() != b"stale"
    for name, content in whole.items():
        assert name == "timings.parquet" or (cell / name).read_bytes() == content


def test_cells_of_other_code_are_not_mixed_in_silence(
    ablated: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, _ = ablated
    options = AblateOptions(str(path), scenes=1, out=tmp_path / "out")
    run_ablation(options)
    for module in ("harness.ablation.run", "harness.runs.manifest"):
        monkeypatch.setattr(f"{module}.scene_code_digest", lambda: "another")
    with pytest.raises(InputError, match=r"was computed by other code .* now another\); pass"):
        run_ablation(options)
    monkeypatch.undo()
    # A refusal leaves no trace that would refuse its own code later.
    assert run_ablation(options).computed == 0
    monkeypatch.setattr("harness.ablation.run.scene_code_digest", lambda: "another")
    assert run_ablation(replace(options, keep_old=True)).computed == 0


def test_no_workers_are_refused() -> None:
    with pytest.raises(InputError, match="--workers -1: should be at least 1"):
        make_engine("local", address=None, workers=-1)


def test_cells_are_compared_with_the_first_that_asks_the_same(tmp_path: Path) -> None:
    text = """
[choices.completion.off]
[choices.completion.one]
protocol.test_sets = ["perturbed"]
[choices.completion.two]
protocol.test_sets = ["perturbed"]
pipeline.training.points = 60
"""
    found = run_ablation(AblateOptions(str(grid(tmp_path, text)), out=tmp_path / "out"))
    compared = {
        (item.cell, item.group[1]): item.difference is not None
        for item in found.summary.entries
        if item.metric == "accuracy" and item.group[2] == "nearest"
    }
    assert compared == {(0, "box"): False, (1, "perturbed"): False, (2, "perturbed"): True}
