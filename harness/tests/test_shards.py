"""Runs in parts: joined, they are the run in one piece; what does not belong to it is refused."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from harness import cli, cli_bench
from harness.bench import BenchOptions, BenchResult, run_bench
from harness.config import Config, RunSection
from harness.errors import InputError
from harness.merge import MergeResult, merge_shards
from harness.runs.directory import RunDirectory, default_folder
from harness.runs.job import plan_jobs, scene_ids
from harness.runs.records import SCHEMA_VERSION
from harness.runs.shards import Shard
from harness.tests import fake_scenes
from harness.tests.fake_wiring import recorded_wiring

SCENES, COUNT = 2, 3
"""Four scenes in three parts: two, one and one."""
FAILING = "mug-0001"
RECORDED = recorded_wiring()


def bench(out: Path, **options: Any) -> BenchResult:
    chosen: dict[str, Any] = {"scenes": SCENES, "workers": 1, "out": out} | options
    return run_bench(BenchOptions(**chosen), wiring=RECORDED)


def stable_bytes(folder: Path) -> dict[str, bytes]:
    """All of a run but what the clock and the machine leave in it."""
    beside = {"manifest.json", "timings.parquet", ".lock"}
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in beside and path.parent.name not in {"scenes", "logs"}
    }


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run in one piece, and its parts; one scene fails."""
    folder = tmp_path_factory.mktemp("shards")
    orders = folder / "orders"
    orders.mkdir()
    (orders / FAILING).write_text("raise", encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FAKE_SCENES", str(orders))
        bench(folder / "whole")
        for index in range(1, COUNT + 1):
            bench(folder / f"part{index}", shard=Shard(index, COUNT))
    return folder


@pytest.fixture
def parts(made: Path, tmp_path: Path) -> list[Path]:
    """Copies of the parts, to be spoilt."""
    names = [f"part{index}" for index in range(1, COUNT + 1)]
    return [Path(shutil.copytree(made / name, tmp_path / name)) for name in names]


def refused(folders: list[Path], out: Path) -> str:
    with pytest.raises(InputError) as caught:
        merge_shards(folders, out=out)
    assert not out.exists()
    return str(caught.value)


@pytest.mark.parametrize("count", [1, 2, 5, 9])
@pytest.mark.parametrize("items", [0, 1, 8, 9, 30])
def test_shards_part_a_plan(count: int, items: int) -> None:
    plan = list(range(items))
    taken = [Shard(index, count).take(plan) for index in range(1, count + 1)]
    assert sorted(item for part in taken for item in part) == plan
    assert max(map(len, taken)) - min(map(len, taken)) <= 1


def test_a_shard_is_named_by_its_number_and_theirs() -> None:
    assert Shard.parse("2/4") == Shard(2, 4)
    assert str(Shard(2, 4)) == "2/4"
    assert Shard(2, 4).take("abcdefg") == ["b", "f"]


@pytest.mark.parametrize(
    ("text", "more"),
    [
        ("", ""),
        ("2", ""),
        ("2/", ""),
        ("-1/4", ""),
        ("1.5/4", ""),
        ("1/4/8", ""),
        ("0/4", "; I runs from 1 to N"),
        ("5/4", "; I runs from 1 to N"),
        ("0/0", "; I runs from 1 to N"),
    ],
)
def test_what_is_no_shard(text: str, more: str) -> None:
    with pytest.raises(InputError) as caught:
        Shard.parse(text)
    assert str(caught.value) == (
        f"--shard {text}: should be I/N, the I-th of N parts, such as 1/4{more}"
    )


def test_the_plans_scenes_are_known_without_its_objects() -> None:
    settings = Config(run=RunSection(scenes=3, classes=("bowl", "mug")))
    assert scene_ids(settings) == [job.scene_id for job in plan_jobs(settings, fake_scenes.MODELS)]


def test_a_shard_computes_its_scenes_alone_and_says_so(made: Path) -> None:
    run = RunDirectory(made / "part2")
    assert run.manifest()["shard"] == {"index": 2, "count": COUNT}
    assert RunDirectory(made / "whole").shard() is None
    names = [sorted(path.stem for path in (made / f"part{i}" / "scenes").iterdir()) for i in (1, 3)]
    assert names == [["bowl-0001", "mug-0000"], ["bowl-0000"]]


def test_merged_shards_are_the_run_in_one_piece(made: Path, tmp_path: Path) -> None:
    folders = [made / f"part{index}" for index in (2, 3, 1)]
    result = merge_shards(folders, out=tmp_path / "out")
    assert stable_bytes(tmp_path / "out") == stable_bytes(made / "whole")
    assert len(RunDirectory(tmp_path / "out").recorded()) == 3
    assert (result.shards, result.scenes, result.notes) == (3, 4, [])
    assert result.failures == {FAILING: f"RuntimeError: no such luck in {FAILING}"}
    manifest = RunDirectory(tmp_path / "out").manifest()
    assert len(manifest["sessions"]) == 4
    assert manifest["shard"] is None
    # Recordings are not stored twice where the disk is the same.
    name = "recordings/bowl-0000.npz"
    assert (tmp_path / "out" / name).samefile(made / "part3" / name)


def test_a_merged_run_goes_on_like_any_other(made: Path, tmp_path: Path) -> None:
    folders = [made / f"part{index}" for index in (1, 2, 3)]
    merge_shards(folders, out=tmp_path / "out")
    bench(tmp_path / "out")
    bench(tmp_path / "whole")
    assert stable_bytes(tmp_path / "out") == stable_bytes(tmp_path / "whole")
    # The shards, whose files it shares, are what they were.
    assert stable_bytes(made / "part2") == stable_bytes(folders[1])
    assert not (folders[1] / "scenes" / f"{FAILING}.json").exists()


def test_an_interrupted_merge_is_done_again(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = [made / f"part{index}" for index in (1, 2, 3)]

    def fail(source: Path, target: Path) -> None:
        raise OSError("another disk")

    def interrupt(*arguments: object, **named: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(os, "link", fail)
        patch.setattr("harness.merge.conclude_run", interrupt)
        with pytest.raises(KeyboardInterrupt):
            merge_shards(folders, out=tmp_path / "out")
    name = "recordings/bowl-0000.npz"
    assert not (tmp_path / "out" / name).samefile(made / "part3" / name)
    for _ in range(2):
        merge_shards(folders, out=tmp_path / "out")
        assert stable_bytes(tmp_path / "out") == stable_bytes(made / "whole")
        assert len(RunDirectory(tmp_path / "out").manifest()["sessions"]) == 4


def test_missing_shards_are_named(parts: list[Path], tmp_path: Path) -> None:
    assert refused(parts[1:2], tmp_path / "out") == (
        f"shards 1/3, 3/3 of {parts[1]}'s plan are missing; pass their folders too, or compute "
        f"them with `harness bench --config {parts[1]}/config.toml --shard 1/3`"
    )
    assert refused([], tmp_path / "out") == "no shard to merge; pass the folders of all of them"


def test_double_shards_are_named(parts: list[Path], tmp_path: Path) -> None:
    again = Path(shutil.copytree(parts[0], tmp_path / "again"))
    assert refused([*parts, again], tmp_path / "out") == (
        f"{parts[0]} and {again} are both shard 1/3; pass one of them"
    )


def test_an_unfinished_shard_is_refused(parts: list[Path], tmp_path: Path) -> None:
    remedy = f"finish it with `harness bench --out {parts[0]}`"
    (parts[0] / "scenes" / "mug-0000.json").write_text("{}\n", encoding="utf-8")
    message = refused(parts, tmp_path / "out")
    assert message.startswith(f"{parts[0]}: mug-0000 is damaged (KeyError: 'schema_version')")
    assert message.endswith(remedy)
    (parts[0] / "scenes" / "mug-0000.json").unlink()
    assert refused(parts, tmp_path / "out") == (
        f"{parts[0]}: the file of mug-0000 is missing; {remedy}"
    )
    (parts[0] / "records.parquet").unlink()
    assert refused(parts, tmp_path / "out") == f"{parts[0]} is unfinished; {remedy}"


def test_a_shards_lost_recording_is_noticed(parts: list[Path], tmp_path: Path) -> None:
    (parts[2] / "recordings" / "bowl-0000.npz").unlink()
    assert "bowl-0000 is damaged (its recording is missing or another)" in refused(
        parts, tmp_path / "out"
    )


def test_shards_of_different_plans_are_refused(parts: list[Path], tmp_path: Path) -> None:
    bench(tmp_path / "other", seed=5, shard=Shard(2, COUNT))
    between = f"{parts[0]} and {tmp_path / 'other'} are shards of different plans"
    assert refused([parts[0], tmp_path / "other", parts[2]], tmp_path / "out") == (
        f"{between}: run.seed (0 in the first, 5 in the second); pass shards of one plan"
    )
    bench(tmp_path / "fourth", shard=Shard(4, 4))
    assert refused([*parts, tmp_path / "fourth"], tmp_path / "out").endswith(
        "are shards of different plans: of 3 parts and of 4; pass shards of one plan"
    )
    rewrite(parts[1], objects=["mug/mug_9 sha256:0"])
    assert "of other objects (first difference: bowl/bowl_0 sha256:" in refused(
        parts, tmp_path / "out"
    )


def test_folders_that_are_no_shards_are_refused(
    made: Path, parts: list[Path], tmp_path: Path
) -> None:
    assert refused([*parts[:2], made / "whole"], tmp_path / "out") == (
        f"{made / 'whole'} holds a whole run, not a shard; pass folders of `harness bench --shard`"
    )
    assert refused([*parts, tmp_path], tmp_path / "out") == (
        f"{tmp_path} holds no run; pass the folder of `harness bench --shard`"
    )
    rewrite(parts[1], schema_version=1)
    assert refused(parts, tmp_path / "out") == (
        f"{parts[1]} was written with record schema 1, this version merges {SCHEMA_VERSION}; "
        "compute the shard again, or merge with the version that wrote it"
    )


def rewrite(folder: Path, **values: object) -> None:
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(manifest | values), encoding="utf-8")


def test_shards_that_other_code_computed_are_said(parts: list[Path], tmp_path: Path) -> None:
    manifest = RunDirectory(parts[1]).manifest()
    manifest["sessions"][-1]["python"] = "3.11.0rc1"
    rewrite(parts[1], **manifest)
    result = merge_shards(parts, out=tmp_path / "out")
    (note,) = result.notes
    assert note.startswith(f"{parts[1]} was computed with other python than {parts[0]}: ")
    assert note.endswith("-> 3.11.0rc1")


def test_a_shard_is_continued_as_it_was_begun(parts: list[Path]) -> None:
    (parts[0] / "scenes" / "mug-0000.json").unlink()
    assert run_bench(BenchOptions(out=parts[0]), wiring=RECORDED).scenes == 2
    with pytest.raises(InputError) as caught:
        bench(parts[0], shard=Shard(2, 3))
    assert str(caught.value) == (
        f"{parts[0]} holds shard 1/3, not shard 2/3; pass another --out, or --out alone to "
        "continue it as it was"
    )


def test_more_shards_than_scenes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--shard 1/5: the run has 4 scenes, too few for 5 shar"):
        bench(tmp_path / "run", shard=Shard(1, 5))
    assert not (tmp_path / "run").exists()


def test_shards_that_begin_at_the_same_moment_have_folders_of_their_own() -> None:
    assert default_folder(Config(), shard=Shard(3, 8)).name.endswith("-3-of-8")


def test_the_command_line_computes_shards_and_merges_them(
    made: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cli_bench, "wiring", RECORDED)
    command = ["bench", "--scenes", "2", "--workers", "1", "--shard", "3/3", "--json"]
    assert cli.main([*command, "--out", str(tmp_path / "part3")]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert set(answer) == {"folder", "table", "failures", "scenes", "seconds"}
    assert (answer["scenes"], answer["failures"]) == (1, {})
    folders = [str(folder) for folder in (made / "part1", made / "part2", tmp_path / "part3")]
    assert cli.main(["merge", *folders, "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert f"4 scenes of 3 shards, 1 of them failed, written to {tmp_path / 'out'}" in printed
    assert "Mug" in printed
    assert cli.main(["merge", *folders, "--out", str(tmp_path / "again"), "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == set(MergeResult.__annotations__)
    assert cli.main(["merge", folders[0], "--out", str(tmp_path / "none")]) == 2
    assert "harness: shards 2/3, 3/3 of " in capsys.readouterr().err
    assert cli.main([*command[:-3], "--shard", "4/3"]) == 2
    assert "harness: --shard 4/3: should be I/N" in capsys.readouterr().err
