"""The command line: what it prints, and the one line and exit code that bad input gets."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from dataclasses import replace
from types import ModuleType
from typing import TYPE_CHECKING

import pytest

from harness import cli, cli_bench
from harness.bench import load_objects
from harness.tests.fake_wiring import WIRING

if TYPE_CHECKING:
    from pathlib import Path


INTERRUPTED = """
import sys
from harness import cli, cli_bench
from harness.tests.fake_wiring import WIRING
cli_bench.wiring = WIRING
sys.exit(cli.main(["bench", "--scenes", "1", "--workers", "2", "--out", sys.argv[1]]))
"""


Harness = Callable[..., tuple[int, str, str]]


@pytest.fixture(autouse=True)
def fakes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli_bench, "wiring", WIRING)
    monkeypatch.setenv("COLUMNS", "200")


@pytest.fixture
def harness(capsys: pytest.CaptureFixture[str]) -> Harness:
    def harness(*arguments: object) -> tuple[int, str, str]:
        code = cli.main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return code, out, err

    return harness


def refused(harness: Harness, *arguments: object) -> str:
    """The one line of an answer to bad input."""
    code, out, err = harness(*arguments)
    assert code == 2
    assert out == ""
    assert err.startswith("harness: ")
    assert err.count("\n") == 1
    return err.removeprefix("harness: ").rstrip()


def test_bench_prints_the_table_and_where_the_run_is(harness: Harness, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    code, out, err = harness("bench", "--scenes", "1", "--workers", "1", "--out", folder)
    assert code == 0
    assert "Mug: 1 scene, 1 object" in out
    assert re.search(r"^seed: classic +\.356 +\.139", out, re.MULTILINE)
    assert out.splitlines()[-1].startswith("2 scenes in ")
    assert f"written to {folder} " in out.splitlines()[-1]
    assert re.findall(r"^(\d/2 \w+-0000) in [\d.]+ s$", err, re.MULTILINE) == [
        "1/2 mug-0000",
        "2/2 bowl-0000",
    ]
    code, shown, _ = harness("show", folder)
    assert code == 0
    assert shown == out.removesuffix(out.splitlines(keepends=True)[-1])
    assert "Confusion" not in shown


def test_show_has_more_when_asked(harness: Harness, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    harness("bench", "--scenes", "1", "--workers", "1", "--out", folder)
    _, everything, _ = harness("show", folder, "--all")
    for word in ("95 % from", "By tolerance", "risk@50", "gate", "Bowl, paired differences"):
        assert word in everything
    assert "Confusion" not in everything
    _, confusion, _ = harness("show", folder, "--confusion")
    assert "Confusion, classic" in confusion
    assert "Confusion, metric" in confusion


@pytest.fixture
def runs(harness: Harness, tmp_path: Path) -> tuple[Path, Path]:
    """Two runs of the same scenes."""
    config = tmp_path / "two.toml"
    config.write_text("[scenes]\nviews = 2\n", encoding="utf-8")
    folders = tmp_path / "a", tmp_path / "b"
    settings = "--scenes", "6", "--workers", "1"
    harness("bench", *settings, "--out", folders[0])
    harness("bench", *settings, "--config", config, "--out", folders[1])
    return folders


def test_compare_pairs_the_scenes_of_two_runs(harness: Harness, runs: tuple[Path, Path]) -> None:
    code, out, _ = harness("compare", *runs, "--model-b", "classic")
    assert code == 0
    assert out.startswith(f"metric of {runs[0]} less classic of {runs[1]}\n")
    assert re.findall(r"^(\w+): 6 scenes, 3 objects$", out, re.MULTILINE) == ["Mug", "Bowl"]
    assert "not tested: 6 objects are needed\n" in out
    assert "scenes.views: 3 in the first, 2 in the second\n" in out
    # The fakes do not look at the views: the same model in both runs measures the same.
    _, out, _ = harness("compare", *runs)
    lines = re.findall(r"^  accuracy +(.*) the same +in every scene$", out, re.MULTILINE)
    dash = "\N{EN DASH}"
    assert [line.split() for line in lines] == [["+.000", f"[{dash}]", "1.000", "1.000", dash]] * 2
    code, out, _ = harness("compare", *runs, "--model-b", "classic", "--json")
    assert code == 0
    found = json.loads(out)
    assert (found["first"], found["second"]) == (str(runs[0]), str(runs[1]))
    assert (found["model_a"], found["model_b"]) == ("metric", "classic")
    assert (found["scenes"], found["empty"], found["settings"]) == (
        12,
        [],
        [["scenes.views", 3, 2]],
    )
    mug, bowl = found["differences"]
    assert (mug["category"], bowl["category"], mug["objects"]) == ("mug", "bowl", 3)
    assert set(mug["values"]["accuracy"]) == {
        *("mean", "low", "high", "p_value", "q_value", "effect_size", "minimum_detectable"),
        *("scenes", "objects"),
    }
    assert mug["values"]["accuracy"]["p_value"] is None


def test_compare_refuses_in_one_line(harness: Harness, runs: tuple[Path, Path]) -> None:
    other = runs[0].parent / "c"
    harness("bench", "--scenes", "1", "--seed", "5", "--workers", "1", "--out", other)
    assert refused(harness, "compare", runs[0], other) == (
        f"{runs[0]} and {other} share no scene that both scored (its seed is "
        + refused(harness, "compare", runs[0], other).split("(its seed is ")[1]
    )
    message = refused(harness, "compare", *runs, "--model-a", "metal")
    assert message == f"{runs[0]} has no records of model 'metal'; it has: classic, metric"
    assert "holds no run" in refused(harness, "compare", runs[0], runs[0].parent)


def test_a_run_without_a_scored_scene_fails(harness: Harness, tmp_path: Path, orders: Path) -> None:
    for scene in ("mug-0000", "bowl-0000"):
        (orders / scene).write_text("raise", encoding="utf-8")
    code, out, err = harness("bench", "--scenes", "1", "--workers", "1", "--out", tmp_path / "run")
    assert code == 1
    assert f"2 scenes, 2 failed (tracebacks: {tmp_path / 'run' / 'logs'}), in " in out
    assert "1/2 mug-0000 failed: RuntimeError: no such luck in mug-0000" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bench", "--scenes", "0"], "--scenes 0: should be greater than or equal to 1"),
        (["bench", "--workers", "0"], "--workers 0: should be greater than or equal to 1"),
        (["bench", "--seed", "-1"], "--seed -1: should be greater than or equal to 0"),
        (["bench", "--quick", "--scenes", "3"], "--quick means --scenes 8; pass one of the two"),
        (["bench", "--scenes", "many"], "'many' is not a whole number; pass one such as 8"),
        (["bench", "--scens", "3"], "No such option: --scens"),
        (["bench", "--config", "none.toml"], "cannot read the configuration none.toml: No such"),
        (["show", "nowhere"], "nowhere holds no run; pass the folder that `harness bench` named"),
        (["show"], "Missing argument 'RUN'"),
        (["bnech"], "No such command 'bnech'"),
    ],
)
def test_bad_input_gets_one_line(harness: Harness, arguments: list[str], message: str) -> None:
    assert message in refused(harness, *arguments)


def test_a_misspelt_key_gets_one_line(harness: Harness, tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    path.write_text("[run]\nscens = 3\n", encoding="utf-8")
    assert refused(harness, "bench", "--config", path).startswith(
        f"{path}: unknown key 'scens' in [run]; nearest is 'scenes'"
    )


def test_an_unwritable_folder_gets_one_line_before_any_scene(
    harness: Harness, tmp_path: Path, orders: Path
) -> None:
    file = tmp_path / "file"
    file.write_text("mine", encoding="utf-8")
    message = refused(harness, "bench", "--out", file / "run")
    assert message == (
        f"cannot create a run in {file / 'run'}: Not a directory; pass a writable --out"
    )
    assert not (orders / "begun").exists()


def test_a_mesh_that_cannot_be_used_gets_one_line_before_any_scene(
    harness: Harness, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(cli_bench, "wiring", replace(WIRING, load_objects=load_objects))
    assert f"{tmp_path}: no manifest.json" in refused(harness, "bench", "--objects", tmp_path)
    (tmp_path / "manifest.json").write_text('[{"path": "a.obj", "category": "mug"}]', "utf-8")
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    message = refused(harness, "bench", "--objects", tmp_path)
    assert message.startswith(f"{tmp_path / 'a.obj'}: 2 m large, over 1 m; scale it to metres")


@pytest.fixture
def generated(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Path, dict[str, object]]]:
    """Calls of the asset generator, which a fake one notes."""
    calls = []

    def generate_assets(out: Path, **settings: object) -> list[str]:
        assert callable(settings.pop("progress"))
        calls.append((out, settings))
        if settings["seed"] == 13:
            raise ValueError("no mug can be made of seed 13; pass another --seed")
        return ["a", "b"]

    module = ModuleType("harness.assets")
    monkeypatch.setattr(module, "generate_assets", generate_assets, raising=False)
    monkeypatch.setitem(sys.modules, "harness.assets", module)
    return calls


def test_assets_passes_its_options_on(
    harness: Harness, generated: list[tuple[Path, dict[str, object]]], tmp_path: Path
) -> None:
    code, out, _ = harness("assets", "--out", tmp_path, "--split", "test", "--count", 3)
    assert (code, out) == (0, f"2 meshes in {tmp_path}\n")
    harness("assets", "--out", tmp_path, "--seed", 5, "--per-category", 4, "--benchmark")
    assert generated == [
        (tmp_path, {"split": "test", "seed": 0, "per_category": 3, "benchmark": False}),
        (tmp_path, {"split": "train", "seed": 5, "per_category": 4, "benchmark": True}),
    ]


def test_assets_that_cannot_be_made_get_one_line(
    harness: Harness, generated: list[tuple[Path, dict[str, object]]], tmp_path: Path
) -> None:
    assert refused(harness, "assets", "--out", tmp_path, "--seed", 13) == (
        "no mug can be made of seed 13; pass another --seed"
    )
    assert "'exam'" in refused(harness, "assets", "--out", tmp_path, "--split", "exam")
    assert "'--out'" in refused(harness, "assets")
    assert len(generated) == 1


@pytest.mark.parametrize("version", [(3, 12, 0), (3, 13, 1), (4, 0, 0)])
def test_a_python_without_pybullet_gets_one_line(
    harness: Harness, monkeypatch: pytest.MonkeyPatch, version: tuple[int, int, int]
) -> None:
    monkeypatch.setattr(sys, "version_info", version)
    assert refused(harness, "bench") == (
        f"Python {version[0]}.{version[1]} is too new: PyBullet has no wheel above 3.11; "
        "make a virtual environment with python3.11 and install there"
    )


def test_ctrl_c_exits_with_130_and_says_how_to_go_on(tmp_path: Path, orders: Path) -> None:
    (orders / "bowl-0000").write_text("once sleep", encoding="utf-8")
    folder = tmp_path / "run"
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 30
    while not list(folder.glob("scenes/mug-0000.json")) or (orders / "bowl-0000").exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(2)
    out, err = process.communicate(timeout=20)
    assert process.returncode == 130
    assert out == ""
    assert err.splitlines()[-1] == (
        "harness: interrupted: 1 of 2 scenes are kept; "
        f"continue with `harness bench --out {folder}`"
    )
    assert "Traceback" not in err


def test_a_full_disk_under_the_output_gets_one_line(harness: Harness, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    assert harness("bench", "--scenes", "1", "--workers", "1", "--out", folder)[0] == 0
    command = [sys.executable, "-c", "import sys; from harness import cli; sys.exit(cli.main())"]
    with open("/dev/full", "wb") as full:  # noqa: PTH123 - a device, no path of ours
        done = subprocess.run(
            [*command, "show", str(folder)], stdout=full, stderr=subprocess.PIPE, check=False
        )
    assert done.returncode == 2
    assert done.stderr.decode() == (
        "harness: cannot read or write the output: No space left on device; "
        "check the path and the disk\n"
    )


def test_clutter_is_asked_for_on_the_command_line(harness: Harness, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    code, _, _ = harness("bench", "--cluttered", "--scenes", "1", "--workers", "1", "--out", folder)
    assert code == 0
    config = tomllib.loads((folder / "config.toml").read_text(encoding="utf-8"))
    assert config["scenes"]["cluttered"] is True
    assert "Confusion, classic" in harness("show", folder)[1]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], ["bench", "show"]),
        (["bench"], ["--quick", "--objects", "harness bench --out", "Exit codes", "[run]"]),
        (["show"], ["harness show results/RUN", "--all", "--confusion"]),
        (["compare"], ["harness compare", "--model-a", "same seed"]),
        (["assets"], ["--benchmark", "--split", "harness assets --out"]),
    ],
)
def test_help_teaches(harness: Harness, arguments: list[str], words: list[str]) -> None:
    code, out, _ = harness(*arguments, "--help")
    assert code == 0
    for word in words:
        assert word in out


def test_no_argument_is_a_call_for_help(harness: Harness) -> None:
    assert harness() == harness("--help")
