"""Jobs on a real Ray cluster of two nodes: same bytes as here, whatever dies."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import pytest

from harness.bench import BenchOptions, run_bench
from harness.config import Config
from harness.engines.cluster import RayEngine
from harness.engines.engine import SceneDone, SceneFailed, UnusableWorkerError, Work, WorkerDied
from harness.engines.identity import code_identity
from harness.runs.code import scene_code_digest
from harness.runs.job import SceneJob
from harness.runs.progress import SilentProgress
from harness.runs.records import SceneResult
from harness.sitting import RunInterruptedError
from harness.tests import fake_scenes
from harness.tests.fake_cluster import FakeCluster, Node
from harness.tests.fake_scenes import begun, is_alive
from harness.tests.fake_wiring import WIRING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from harness.runs.job import ObjectModel

STABLE = ("records.parquet", "confusion.parquet", "table.md", "table.csv", "table.tex")
SCENES = 4
JOBS = [SceneJob(f"mug-{i:04d}", "mug", "mug_0", seed=i) for i in range(6)]


@pytest.fixture(scope="module")
def running() -> Iterator[FakeCluster]:
    cluster = FakeCluster()
    yield cluster
    cluster.close()


@pytest.fixture
def cluster(running: FakeCluster) -> FakeCluster:
    running.forget_orders()
    # A developer may edit the checkout while the tests run: nodes see it as it is now.
    code_identity.cache_clear()
    scene_code_digest.cache_clear()
    return running


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What the local engine writes."""
    folder = tmp_path_factory.mktemp("local") / "run"
    run_bench(BenchOptions(scenes=SCENES, out=folder), wiring=WIRING)
    return stable_bytes(folder)


def stable_bytes(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in STABLE}


def test_deaths_and_exceptions_are_told_as_by_the_local_engine(
    cluster: FakeCluster, tmp_path: Path
) -> None:
    orders = {1: "once die", 2: "die", 3: "raise", 5: "limits"}
    for scene, order in orders.items():
        (cluster.orders / f"mug-{scene:04d}").write_text(order, encoding="utf-8")
    work = Work(fake_scenes.SCENE_FUNCTION, SceneResult, (Config(),))
    events = list(RayEngine(cluster.address).run(work, JOBS, logs=tmp_path))
    done = [event for event in events if isinstance(event, SceneDone)]
    assert {event.job for event in done} == {JOBS[0], JOBS[1], JOBS[4]}
    for event in done:
        assert event.result == fake_scenes.run_scene(event.job, Config())
        assert 10 < event.peak_memory_mib < 10_000
    assert {event.job: event.failure for event in events if isinstance(event, SceneFailed)} == {
        JOBS[2]: "its worker died 2 times; last: crashed",
        JOBS[3]: "RuntimeError: no such luck in mug-0003",
        # A task has one core, whatever the node has.
        JOBS[5]: "RuntimeError: 1 1",
    }
    died = [event for event in events if isinstance(event, WorkerDied)]
    assert sorted(str(event) for event in died) == [
        f"worker crashed at mug-000{scene}; trying it once more (Ray cluster {cluster.address})"
        for scene in (1, 2)
    ]
    tries = [scene for _, scene in begun(cluster.orders)]
    assert {scene: tries.count(scene) for scene in set(tries)} == {
        "mug-0000": 1,
        "mug-0001": 2,
        "mug-0002": 2,
        "mug-0003": 1,
        "mug-0004": 1,
        "mug-0005": 1,
    }
    (log,) = tmp_path.iterdir()
    assert "mug-0003\nTraceback" in log.read_text(encoding="utf-8")


def test_nodes_with_other_meshes_are_refused(
    cluster: FakeCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The nodes see this machine's files, so that another content is what they are told to find.
    monkeypatch.setattr("harness.engines.choice.check_address", lambda address: None)

    def identity(model: ObjectModel) -> str:
        return f"{model.category}/{model.name} sha256:{'0' * 64}"

    monkeypatch.setattr("harness.bench.object_identity", identity)
    folder = tmp_path / "run"
    options = BenchOptions(scenes=SCENES, out=folder, engine="ray", address=cluster.address)
    with pytest.raises(
        UnusableWorkerError,
        match=r"cannot run scenes: node .* has other meshes \(/.*/fake_scenes\.py is another there",
    ):
        run_bench(options, wiring=WIRING)
    assert not (folder / "records.parquet").exists()
    assert not (cluster.orders / "begun").exists()


def test_ctrl_c_cancels_the_tasks_and_keeps_what_is_finished(
    cluster: FakeCluster, tmp_path: Path, undisturbed: dict[str, bytes]
) -> None:
    class Impatient(SilentProgress):
        def scene_done(self, scene_id: str, seconds: float) -> None:
            raise KeyboardInterrupt

    (cluster.orders / "mug-0001").write_text("once sleep", encoding="utf-8")
    folder = tmp_path / "run"
    options = BenchOptions(scenes=SCENES, out=folder, engine="ray", address=cluster.address)
    with pytest.raises(RunInterruptedError) as caught:
        run_bench(options, progress=Impatient(), wiring=WIRING)
    assert str(caught.value) == (
        "interrupted: 1 of 8 scenes are kept; continue with "
        f"`harness bench --out {folder} --engine ray --address {cluster.address}`"
    )
    deadline = time.monotonic() + 10
    while any(is_alive(pid) for pid, _ in begun(cluster.orders)):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    run_bench(BenchOptions(out=folder), wiring=WIRING)
    assert stable_bytes(folder) == undisturbed


class Notes(SilentProgress):
    def __init__(self) -> None:
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        self.notes.append(text)


def kill_at_work(node: Node, orders: Path) -> str:
    """Kill a node once it has begun a scene; returns which. The scenes wait for that."""
    deadline = time.monotonic() + 60
    while True:
        here = node.processes()
        if at_work := [scene for pid, scene in begun(orders) if pid in here]:
            break
        assert time.monotonic() < deadline
        time.sleep(0.05)
    node.kill()
    for order in orders.glob("*-*"):
        order.unlink()
    return at_work[0]


def test_a_node_that_dies_in_the_middle_of_a_run_changes_no_byte(
    cluster: FakeCluster,
    tmp_path: Path,
    undisturbed: dict[str, bytes],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # That it answers is asked by a process that imports Ray: another test does so.
    monkeypatch.setattr("harness.engines.choice.check_address", lambda address: None)
    (cluster.orders / "begun").touch()
    for category in ("mug", "bowl"):
        for index in range(SCENES):
            (cluster.orders / f"{category}-{index:04d}").write_text("wait", encoding="utf-8")
    folder, progress = tmp_path / "run", Notes()
    options = BenchOptions(scenes=SCENES, out=folder, engine="ray", address=cluster.address)
    with ThreadPoolExecutor(1) as killer:
        killed = killer.submit(kill_at_work, cluster.nodes[-1], cluster.orders)
        result = run_bench(options, progress=progress, wiring=WIRING)
        scene = killed.result()
    assert result.failures == {}
    assert any(f" at {scene}; trying it once more" in note for note in progress.notes)
    assert [name for _, name in begun(cluster.orders)].count(scene) == 2
    assert stable_bytes(folder) == undisturbed
