"""Runs killed with kill -9 in the middle of what they write resume to the same bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from harness.benchmarks.kill_resume import (
    STEPS,
    TABLE_FILES,
    Kill,
    NotKilledError,
    Subject,
    draw_kill,
    stable_files,
    try_kill,
)

if TYPE_CHECKING:
    from pathlib import Path

import numpy as np

FILES = 2 + 1 + 2 * 2 + TABLE_FILES
"""Configuration and manifest, the sitting's manifest, two scenes with recordings, the tables."""


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    config = tmp_path_factory.mktemp("killed") / "config.toml"
    config.write_text("[run]\nscenes = 1\nworkers = 1\n", encoding="utf-8")
    return Subject(config, "harness.tests.fake_wiring:recorded_wiring")


@pytest.fixture(scope="module")
def truth(subject: Subject, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("truth") / "run"
    subject.resume(folder)
    files = stable_files(folder)
    assert len(files) == 1 + 2 + TABLE_FILES - 1
    return files


@pytest.mark.parametrize(
    ("step", "kept"),
    [
        (STEPS + 2, 0),  # the manifest, written but not yet in its place
        (4 * STEPS + 1, 0),  # the first scene, after its recording
        ((FILES - TABLE_FILES) * STEPS + 2, 2),  # the records
        (FILES * STEPS - 1, 2),  # the last table, before it is in its place
    ],
)
def test_a_run_killed_while_it_writes_resumes_to_the_same_bytes(
    subject: Subject, truth: dict[str, bytes], tmp_path: Path, step: int, kept: int
) -> None:
    kill = Kill("write", step=step)
    trial = try_kill(subject, kill, folder=tmp_path / "run", truth=truth)
    assert (trial.kept, trial.differing) == (kept, [])
    assert not list(tmp_path.rglob("*.partial"))


def test_a_run_that_ends_before_its_moment_is_no_trial(
    subject: Subject, truth: dict[str, bytes], tmp_path: Path
) -> None:
    with pytest.raises(NotKilledError, match="the run ended with code 0 before it was killed"):
        try_kill(
            subject, Kill("write", step=FILES * STEPS + 1), folder=tmp_path / "run", truth=truth
        )


def test_moments_are_drawn_over_the_whole_run_and_often_in_the_tables() -> None:
    random = np.random.default_rng(0)
    kills = [draw_kill(random, seconds=10.0, steps=100) for _ in range(600)]
    assert {kill.kind for kill in kills} == {"parent", "worker", "write"}
    timed = [kill.seconds for kill in kills if kill.kind != "write"]
    assert min(timed) < 0.2
    assert 9.8 < max(timed) < 10.0
    steps = [kill.step for kill in kills if kill.kind == "write"]
    assert 1 <= min(steps) < 5
    assert max(steps) == 100
    in_tables = np.mean([step > 100 - TABLE_FILES * STEPS for step in steps])
    assert in_tables == pytest.approx(0.5 + 0.5 * 0.24, abs=0.08)
