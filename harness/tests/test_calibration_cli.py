"""The commands `calibration` and `threshold`, and what bad input gets."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

from harness import cli
from harness.recordings.make import missed_answers
from harness.runs.records import SCHEMA_VERSION
from harness.tests.fake_calibration import answers, recorded_run, recording

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from harness.runs.directory import RunDirectory

Harness = Callable[..., tuple[int, str, str]]

CONFIDENCE = np.linspace(0.005, 0.995, 100).tolist()


def a_run(
    folder: Path,
    *,
    objects: int,
    first: int = 0,
    false_below: float = 0.3,
    contents: Mapping[str, str] | None = None,
) -> RunDirectory:
    """Objects of both classes whose points of less than this confidence are false."""
    truth = [confidence >= false_below for confidence in CONFIDENCE]
    scenes = []
    for index in range(first, first + objects):
        category = ("mug", "bowl")[index % 2]
        of = answers(category=category, confidence=CONFIDENCE, variance=CONFIDENCE[::-1])
        scenes.append(
            recording(
                f"{category}-{index:04d}",
                object_name=f"{category}_{index}",
                category=category,
                truth=truth,
                models={"metric": of},
            )
        )
    return recorded_run(folder, scenes, contents=contents)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunDirectory:
    return a_run(tmp_path_factory.mktemp("runs") / "run", objects=20)


@pytest.fixture
def harness(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Harness:
    monkeypatch.setenv("COLUMNS", "200")

    def harness(*arguments: object) -> tuple[int, str, str]:
        code = cli.main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return code, out, err

    return harness


def refused(harness: Harness, *arguments: object) -> str:
    """The one line of an answer to bad input."""
    code, out, err = harness(*arguments)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    return err.removeprefix("harness: ").strip()


def test_the_calibration_of_a_run(harness: Harness, run: RunDirectory) -> None:
    code, out, _ = harness("calibration", run.folder)
    assert code == 0
    assert "Mug, box: 10 scenes of 10 objects, .700 of the points on the mesh" in out
    assert "Bowl, box" in out
    lines = [line.split() for line in out.splitlines()]
    # Confidences from .005 to .995 of points that are true from .3 on, in a table of each kind.
    of_confidence = [line for line in lines if line[:1] == ["confidence"]]
    assert len(of_confidence) == 4
    random = next(line for line in lines if line[:1] == ["random"])
    assert ".200" in random


def test_calibration_as_json_and_files(harness: Harness, run: RunDirectory, tmp_path: Path) -> None:
    folder = tmp_path / "new" / "calibration"
    code, out, _ = harness("calibration", run.folder, "--class", "mug", "--json", "--out", folder)
    assert code == 0
    found = json.loads(out)
    assert [cell["category"] for cell in found["cells"]] == ["mug"]
    assert json.loads((folder / "calibration.json").read_text(encoding="utf-8")) == found
    header, *lines = (folder / "calibration.csv").read_text(encoding="utf-8").splitlines()
    assert header.startswith("category,completion,model,tolerance_m,series,metric,over,value")
    assert len(lines) > 50
    # The same run gives the same bytes.
    again = tmp_path / "again"
    harness("calibration", run.folder, "--class", "mug", "--out", again)
    for name in ("calibration.json", "calibration.csv"):
        assert (folder / name).read_bytes() == (again / name).read_bytes()


def test_a_threshold_in_expectation(harness: Harness, run: RunDirectory) -> None:
    # All that is false is below .3: of k kept, k - 70 are false; with 20 objects R may be .055.
    code, out, _ = harness("threshold", run.folder, "--keep-precision", 0.9)
    assert code == 0
    assert "Keep points of confidence 0.256 and above." in out
    assert "conformal risk control; at most .099 false" in out
    assert "all" in out
    code, out, _ = harness("threshold", run.folder, "--keep-precision", 0.9, "--json")
    found = json.loads(out)
    assert found["choice"] == {
        "threshold": 0.256,
        "objects": 20,
        "least_objects": 9,
        "bound": pytest.approx((20 * 4 / 74 + 1) / 21),
    }
    assert found["kept"]["all"]["precision"]["mean"] == pytest.approx(70 / 74)
    assert found["kept"]["mug"]["kept"]["mean"] == pytest.approx(0.74)
    assert found["validation"] is None


def test_a_threshold_with_probability(harness: Harness, run: RunDirectory) -> None:
    code, out, _ = harness("threshold", run.folder, "--keep-precision", 0.8, "--delta", 0.1)
    assert code == 0
    # The greatest k with (.8 k / 70)^20 <= .1: k = 77.
    assert "Keep points of confidence 0.226 and above." in out
    said = " ".join(out.split())
    assert "with probability 0.9 over draws of these (Learn then Test; p = .078)" in said


def test_no_threshold_says_why(harness: Harness, run: RunDirectory, tmp_path: Path) -> None:
    code, out, _ = harness("threshold", run.folder, "--keep-precision", 0.99)
    assert code == 1
    assert "No threshold guarantees 99 % of kept points on the mesh." in out
    assert "20 objects are too few: 99 at least, were no point false." in out
    code, out, _ = harness("threshold", run.folder, "--delta", 0.1)
    assert code == 1
    assert "20 objects are too few: 45 at least" in out
    wrong = a_run(tmp_path / "wrong", objects=20, false_below=2.0)
    code, out, _ = harness("threshold", wrong.folder)
    assert code == 1
    assert "the best threshold has a share of false points of 1.000, above 0.05" in out
    code, out, _ = harness("threshold", wrong.folder, "--json")
    assert (code, json.loads(out)["choice"]["threshold"]) == (1, None)


def test_validation_and_another_run(harness: Harness, run: RunDirectory, tmp_path: Path) -> None:
    other = a_run(tmp_path / "other", objects=6, first=100, false_below=0.5)
    code, out, _ = harness(
        *("threshold", run.folder, "--keep-precision", 0.85),
        *("--validate", "--splits", 10, "--judge", other.folder),
    )
    assert code == 0
    # Ten of twenty objects, all alike: (10 R + 1) / 11 <= .15 at 74 kept points.
    assert "Validation on 10 random halves (10 objects to choose on, 10 to check on)" in out
    assert "thresholds 0.256 to 0.256" in out
    said = " ".join(out.split())
    assert "Mean precision on held-out objects .946, asked 0.85" in said
    assert "in 100.0 % of the halves" in said
    judged = out[out.index("judged on") :]
    # Twenty objects let 78 points be kept, of which 50 are true there.
    assert next(line for line in judged.splitlines() if line.startswith("all")).split()[1] == ".641"


def test_runs_that_cannot_be_read(harness: Harness, run: RunDirectory, tmp_path: Path) -> None:
    for command in ("calibration", "threshold"):
        nowhere = tmp_path / "nowhere"
        assert refused(harness, command, nowhere) == (
            f"{nowhere} holds no run; pass the folder that `harness bench` named"
        )
        unfinished = recorded_run(tmp_path / f"{command}-unfinished", [], finished=False).folder
        assert refused(harness, command, unfinished) == (
            f"{unfinished} is unfinished; finish it with `harness bench --out {unfinished}`"
        )
        bare = recorded_run(tmp_path / f"{command}-bare", []).folder
        assert refused(harness, command, bare) == (
            f"{bare} has no recordings: resume it with `harness bench --out {bare}`"
        )
    broken = tmp_path / "broken"
    shutil.copytree(run.folder, broken)
    path = broken / "recordings" / "mug-0004.npz"
    path.write_bytes(path.read_bytes()[:1000])
    assert refused(harness, "calibration", broken).startswith(f"{path} is damaged (")
    path.unlink()
    assert refused(harness, "threshold", broken) == (
        f"{broken} has no recording of 1 of its 20 scenes (the first: mug-0004); make them again "
        f"with `harness bench --out {broken}`"
    )


def test_a_run_of_another_record_schema(
    harness: Harness, run: RunDirectory, tmp_path: Path
) -> None:
    old = tmp_path / "old"
    shutil.copytree(run.folder, old)
    manifest = json.loads((old / "manifest.json").read_text("utf-8")) | {"schema_version": 3}
    (old / "manifest.json").write_text(json.dumps(manifest), "utf-8")
    for command in ("calibration", "threshold"):
        assert refused(harness, command, old).startswith(
            f"{old} was written with record schema 3, this version reads {SCHEMA_VERSION}; "
        )
    assert refused(harness, "threshold", run.folder, "--judge", old).startswith(
        f"{old} was written with record schema 3"
    )


def test_judging_tells_objects_by_their_files(
    harness: Harness, run: RunDirectory, tmp_path: Path
) -> None:
    # Other meshes that go by the same names are other objects.
    same_names = a_run(
        tmp_path / "others", objects=2, contents={"mug_0": "another", "bowl_1": "new"}
    )
    code, out, _ = harness(
        "threshold", run.folder, "--keep-precision", 0.85, "--judge", same_names.folder
    )
    assert code == 0
    assert f"judged on {same_names.folder}" in out
    renamed = a_run(tmp_path / "renamed", objects=2, first=100, contents={"mug_100": "mug_4"})
    assert refused(harness, "threshold", run.folder, "--judge", renamed.folder) == (
        f"{renamed.folder} shares 1 objects with {run.folder} (the first: mug_100, there called "
        "mug_4): a threshold is judged on objects that it was not chosen on"
    )


def test_an_object_that_the_manifest_does_not_list(
    harness: Harness, run: RunDirectory, tmp_path: Path
) -> None:
    broken, other = tmp_path / "broken", a_run(tmp_path / "other", objects=2, first=100)
    shutil.copytree(run.folder, broken)
    manifest = json.loads((broken / "manifest.json").read_text("utf-8"))
    manifest["objects"].remove("bowl/bowl_1 sha256:bowl_1")
    (broken / "manifest.json").write_text(json.dumps(manifest), "utf-8")
    assert refused(harness, "threshold", broken, "--judge", other.folder) == (
        f"{broken / 'manifest.json'} does not list the object bowl/bowl_1, of which the run has "
        "scenes; it is damaged: run the benchmark again, into another folder"
    )


def test_what_a_failed_scene_left_is_not_read(harness: Harness, tmp_path: Path) -> None:
    scenes = [
        recording(
            f"mug-{index:04d}",
            object_name=f"mug_{index}",
            truth=[True, False],
            models={"metric": answers(category="mug", confidence=[0.9, 0.2])},
        )
        for index in range(3)
    ]
    run = recorded_run(tmp_path / "run", scenes, classes=["mug"], failed=["mug-0001"])
    code, out, _ = harness("calibration", run.folder, "--json")
    assert code == 0
    assert json.loads(out)["cells"][0]["scenes"] == ["mug-0000", "mug-0002"]
    code, out, _ = harness("threshold", run.folder, "--keep-precision", 0.5, "--json")
    assert json.loads(out)["choice"]["objects"] == 2


def test_an_answer_that_is_no_number(harness: Harness, tmp_path: Path) -> None:
    of = answers(category="mug", confidence=[0.5, np.nan], predicted=[True, True])
    item = recording("mug-0000", object_name="m", truth=[True] * 2, models={"metric": of})
    folder = recorded_run(tmp_path / "run", [item]).folder
    for command in ("calibration", "threshold"):
        assert refused(harness, command, folder) == (
            f"{folder}: the recording of mug-0000 is damaged (its probability of metric holds what "
            "is no number); delete it and resume the run with `harness bench --out`"
        )


def test_what_a_run_does_not_have(harness: Harness, run: RunDirectory, tmp_path: Path) -> None:
    folder = run.folder
    assert refused(harness, "calibration", folder, "--model", "gp") == (
        f"{folder} has no model 'gp'; it has: metric"
    )
    assert refused(harness, "threshold", folder, "--class", "can") == (
        f"{folder} has no class 'can'; it has: mug, bowl"
    )
    assert refused(harness, "threshold", folder, "--completion", "centersnap") == (
        f"{folder} has no completion 'centersnap'; it has: none"
    )
    assert refused(harness, "calibration", folder, "--tolerance-m", "0") == (
        "a tolerance of 0.0 m is no distance; pass one such as 0.005"
    )
    # All bowls failed: no bowl has a recording.
    mug = recording(
        "mug-0000", object_name="m", truth=[True] * 4, models={"metric": missed_answers(4)}
    )
    mugs = recorded_run(tmp_path / "mugs", [mug]).folder
    assert refused(harness, "calibration", mugs, "--class", "bowl").startswith(
        f"{mugs} has no recorded scene of class 'bowl': all its scenes failed; their reasons are in"
    )
    code, out, _ = harness("calibration", mugs)
    assert code == 0
    assert "No recorded scene of: bowl." in out


def test_what_makes_no_sense(harness: Harness, run: RunDirectory, tmp_path: Path) -> None:
    folder = run.folder
    assert refused(harness, "threshold", folder, "--keep-precision", 95) == (
        "--keep-precision 95.0 is not between 0 and 1; pass one such as 0.95"
    )
    assert refused(harness, "threshold", folder, "--judge", folder).startswith(
        f"{folder} shares 20 objects with {folder} (the first: bowl_1): a threshold is judged on"
    )
    assert refused(harness, "threshold", folder, "--validate") == (
        "20 objects cannot be split for a validation: half of them are 10, and 0.95 needs 19; ask "
        "for less precision, or run scenes of more objects"
    )
    assert refused(harness, "threshold", folder, "--splits", 5) == (
        "--splits 5 goes with --validate; pass that too, or leave it out"
    )
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert refused(harness, "calibration", folder, "--out", tmp_path / "file").startswith(
        f"cannot create {tmp_path / 'file'}: "
    )
