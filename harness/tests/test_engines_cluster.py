"""The tasks of a cluster against a Ray that is played here, for what a real one does rarely."""

from __future__ import annotations

import hashlib
import importlib
import itertools
import pickle
import platform
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from harness.engines import cluster as engine_module, identity
from harness.engines.cluster import RayEngine
from harness.engines.engine import SceneDone, SceneFailed, UnusableWorkerError, Work
from harness.engines.remote import serve
from harness.engines.worker import Done, Unusable
from harness.errors import InputError
from harness.runs.job import SceneJob

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

exceptions: Any = importlib.import_module("ray.exceptions")
WORK = Work("builtins:len", str, files={"/mug.obj": "0" * 64})


def job(index: int) -> SceneJob:
    return SceneJob(f"mug-{index:05d}", "mug", "mug_0", seed=index)


class FakeRay:
    """Answers the task that was submitted first; `errors` are raised in place of answers."""

    exceptions = exceptions

    def __init__(
        self, *, cpus: float = 2.0, errors: dict[str, list[Exception]] | None = None
    ) -> None:
        self._cpus, self._errors = cpus, errors or {}
        self._names = itertools.count()
        self._jobs: dict[int, SceneJob] = {}
        self.files: list[dict[str, str]] = []
        self.most = 0
        self.open = False
        self.cancelled: list[int] = []

    def init(self, **options: Any) -> None:
        self.open = True
        assert options["runtime_env"]["env_vars"]["RAYON_NUM_THREADS"] == "1"

    def shutdown(self) -> None:
        self.open = False

    def cluster_resources(self) -> dict[str, float]:
        return {"CPU": self._cpus} if self._cpus else {}

    def remote(self, **options: Any) -> Any:
        assert options["max_retries"] == 0
        return lambda function: SimpleNamespace(remote=self._submit)

    def _submit(self, expected: dict[str, str], files: dict[str, str], packed: bytes) -> int:
        name = next(self._names)
        self.files.append(files)
        self._jobs[name] = pickle.loads(packed)[1]
        return name

    def wait(self, names: list[int], **_: Any) -> tuple[list[int], list[int]]:
        self.most = max(self.most, len(names))
        return names[:1], names[1:]

    def get(self, name: int) -> Done:
        scene_id = self._jobs[name].scene_id
        if self._errors.get(scene_id):
            raise self._errors[scene_id].pop(0)
        return Done(scene_id, 0.1, 1.0)

    def cancel(self, name: int, *, force: bool) -> None:
        assert force
        self.cancelled.append(name)


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    def run(ray: FakeRay, *, jobs: int = 3, workers: int | None = None) -> Any:
        monkeypatch.setattr(engine_module, "import_ray", lambda: ray)
        engine = RayEngine("head:6379", workers=workers)
        return engine.run(WORK, [job(i) for i in range(jobs)], logs=tmp_path)

    return run


def test_only_so_many_tasks_are_at_the_cluster_as_keep_it_busy(run: Any) -> None:
    ray = FakeRay(cpus=3)
    events = list(run(ray, jobs=1000))
    assert [event.result for event in events] == [job(i).scene_id for i in range(1000)]
    assert ray.most == 6
    assert not ray.open
    limited = FakeRay(cpus=3)
    list(run(limited, jobs=10, workers=2))
    assert limited.most == 2


@pytest.fixture
def mesh(tmp_path: Path) -> Iterator[Path]:
    path = tmp_path / "mug.obj"
    path.write_bytes(b"v 0 0 0")
    yield path
    identity.file_digest.cache_clear()


def served(files: dict[str, str], *, target: str = "builtins:len", **other: str) -> Any:
    """What a node answers that is asked for the length of a word."""
    return serve(identity.code_identity() | other, files, pickle.dumps((target, "abc", ())))


def test_a_node_computes_with_the_callers_code_and_files_alone(mesh: Path) -> None:
    digest = hashlib.sha256(b"v 0 0 0").hexdigest()
    answer = served({str(mesh): digest})
    assert isinstance(answer, Done)
    assert answer.result == 3
    node, again = platform.node(), "give it the same"
    missing = str(mesh.with_name("bowl.obj"))
    for files, why in (
        ({str(mesh): "0" * 64}, f"{mesh} is another there"),
        ({str(mesh): digest, missing: digest}, f"{missing} is missing there"),
        ({missing: digest, str(mesh): "0" * 64}, f"{missing} is missing there and 1 more"),
    ):
        refused = served(files)
        assert isinstance(refused, Unusable)
        assert refused.reason == (
            f"node {node} has other meshes ({why}); {again} objects under the same paths, or take "
            "it out of the cluster"
        )
    refused = served({}, Python="3.11.99")
    assert isinstance(refused, Unusable)
    assert refused.reason == (
        f"node {node} has other code (Python {platform.python_version()} there, 3.11.99 here); "
        f"{again} checkout, built wheel and virtual environment, or take it out of the cluster"
    )
    refused = served({}, target="builtins:no_such_function")
    assert isinstance(refused, Unusable)
    assert refused.reason.startswith(f"node {node}: AttributeError: ")


def test_a_worker_reads_each_file_once(mesh: Path) -> None:
    files = {str(mesh): hashlib.sha256(b"v 0 0 0").hexdigest()}
    for _ in range(3):
        assert identity.other_files(files) == ""
    assert identity.file_digest.cache_info().misses == 1


def test_every_task_is_told_the_files(run: Any) -> None:
    ray = FakeRay()
    list(run(ray))
    assert ray.files == [dict(WORK.files)] * 3 != [{}] * 3


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (exceptions.NodeDiedError("x"), "lost with its node"),
        (exceptions.OutOfMemoryError("x"), "killed by Ray for want of memory"),
        (
            exceptions.ObjectReconstructionFailedError("00", None, None),
            "lost with its node before the result was fetched",
        ),
    ],
)
def test_every_kind_of_death_is_tried_once_more(run: Any, error: Exception, reason: str) -> None:
    died, *done = run(FakeRay(errors={"mug-00000": [error]}), jobs=1)
    assert (died.reason, [type(event) for event in done]) == (reason, [SceneDone])
    _, failed = run(FakeRay(errors={"mug-00000": [error, error]}), jobs=1)
    assert failed == SceneFailed(job(0), f"its worker died 2 times; last: {reason}")


def test_a_cluster_that_is_lost_is_said_with_how_to_go_on(run: Any) -> None:
    ray = FakeRay(errors={"mug-00001": [exceptions.RaySystemError("the head is gone")]})
    events = run(ray)
    assert isinstance(next(events), SceneDone)
    with pytest.raises(InputError) as caught:
        list(events)
    assert str(caught.value).startswith("lost the Ray cluster at head:6379 (RaySystemError: ")
    assert str(caught.value).endswith("run the command once more with the same --out to continue")
    assert (ray.cancelled, ray.open) == ([2], False)


def test_workers_that_cannot_be_started(run: Any) -> None:
    ray = FakeRay(errors={"mug-00000": [exceptions.RuntimeEnvSetupError("no disk")]})
    with pytest.raises(UnusableWorkerError, match=r"cannot start workers: RuntimeEnvSetupError: "):
        list(run(ray))


def test_a_cluster_without_cpus_is_waited_for_and_given_up(
    run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert len(list(run(FakeRay(cpus=0)))) == 3
    monkeypatch.setattr(engine_module, "PATIENCE_S", 0.0)
    with pytest.raises(InputError, match=r"at head:6379 has had no CPU for 0 s; start a node"):
        list(run(FakeRay(cpus=0)))
