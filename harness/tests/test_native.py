"""The compiled module beside its stub and its promises; results are tested where they belong."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import harness
from harness import native
from harness.native import MeshTruth, OccupancyMap, gp_log_likelihood, gp_posterior

if TYPE_CHECKING:
    from collections.abc import Callable


def test_the_stub_says_what_the_module_has() -> None:
    """Names, parameters, kinds and defaults, both ways."""
    root = Path(harness.__file__).parents[1]
    check = subprocess.run(
        [sys.executable, "-m", "mypy.stubtest", "harness._native"],
        cwd=root,
        capture_output=True,
        text=True,
        check=False,
    )
    assert check.returncode == 0, check.stdout + check.stderr


def test_the_door_lets_everything_through() -> None:
    compiled = sys.modules["harness._native"]
    own = {"CLASS_NAMES", "CompleterFunction", "SegmenterFunction"}
    assert set(native.__all__) == {*compiled.__all__, *own}
    assert all(getattr(native, name) is getattr(compiled, name) for name in compiled.__all__)


def test_the_class_names_are_the_modules() -> None:
    training = native.TrainingSet(np.zeros((7, 3)), np.arange(7, dtype=np.uint8))
    assert training.classes.tolist() == list(range(len(native.CLASS_NAMES)))
    with pytest.raises(ValueError, match=r"classes\[0\] is 7; .* from 1 to 6"):
        native.TrainingSet(np.zeros((1, 3)), np.array([7], dtype=np.uint8))


def large_problem() -> dict[str, Any]:
    rng = np.random.default_rng(0)
    return {
        "points": rng.uniform(size=(1500, 3)),
        "labels": (np.arange(1500) % 2).astype(np.uint8),
        "lengthscales": np.array([0.1, 0.1]),
        "outputscales": np.array([4.0, 4.0]),
        "means": np.array([-3.0, -3.0]),
    }


def posterior() -> Callable[[], object]:
    test_points = np.random.default_rng(1).uniform(size=(3000, 3))
    return lambda: gp_posterior(**large_problem(), test_points=test_points)


def log_likelihood() -> Callable[[], object]:
    return lambda: gp_log_likelihood(**large_problem())


def distances() -> Callable[[], object]:
    truth = MeshTruth(np.eye(3), np.array([[0, 1, 2]], dtype=np.uint32))
    points = np.random.default_rng(2).uniform(size=(2_000_000, 3))
    return lambda: truth.distances(points)


def scan() -> Callable[[], object]:
    tree = OccupancyMap(0.02)
    points = np.random.default_rng(3).uniform(-2, 2, size=(200_000, 3))
    return lambda: tree.insert_scan(np.zeros(3), points)


@pytest.mark.parametrize("make", [posterior, log_likelihood, distances, scan])
def test_other_threads_run_during_a_long_call(make: Callable[[], Callable[[], object]]) -> None:
    call = make()
    moments: list[float] = []
    started, stop = threading.Event(), threading.Event()

    def tick() -> None:
        while not stop.is_set():
            moments.append(time.perf_counter())
            started.set()
            time.sleep(0.001)

    ticker = threading.Thread(target=tick)
    ticker.start()
    try:
        started.wait()
        start = time.perf_counter()
        call()
        end = time.perf_counter()
    finally:
        stop.set()
        ticker.join()
    # Were the lock held, no tick would fall between the call's first and last moments.
    margin = (end - start) / 10
    during = [moment for moment in moments if start + margin < moment < end - margin]
    assert len(during) >= 3, f"{len(during)} ticks in {end - start:.3f} s"


def test_two_threads_may_ask_at_once() -> None:
    arguments = large_problem()
    arguments["test_points"] = arguments["points"][:100] + 0.01
    alone = gp_posterior(**arguments)
    answers: list[tuple[np.ndarray, np.ndarray]] = []
    threads = [
        threading.Thread(target=lambda: answers.append(gp_posterior(**arguments))) for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(answers) == 2
    for mean, variance in answers:
        assert (mean == alone[0]).all()
        assert (variance == alone[1]).all()
