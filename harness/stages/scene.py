"""The stages of one scene under one configuration, each computed only if no other shared it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.asked import gather_test_sets
from harness.protocol import COMPLETED
from harness.stages.clock import spent_since
from harness.stages.keys import StageKeys
from harness.stages.mapping import map_in_stages
from harness.truth import SceneFailure, TargetMissedError, find_mapped, mesh_truth

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import TypeVar

    from harness.asked import AskedPoints, MissingPoints
    from harness.config import Config
    from harness.native import MappedObject, MeshTruth, Predictions, TrainingSet
    from harness.runs.job import SceneJob
    from harness.stages.clock import StageClock, Times
    from harness.stages.mapping import Mapped
    from harness.stages.memo import Memo
    from sim_scenes import Scene

    Value = TypeVar("Value")

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Question:
    """What every model is asked about a target.

    Attributes
    ----------
    item
        The target in the map.
    training
        What the models learn from.
    asked, missing
        The test sets that have points, and those that have none.
    points_world : (n, 3) float64
        The points of all test sets, metres.
    distances_m : (objects, n) float64
        Of each to each true mesh.
    completer_confidence : (n,) float64 or None
        How sure the completer is of each; None where the protocol does not use it.
    """

    item: MappedObject
    training: TrainingSet
    asked: Sequence[AskedPoints]
    missing: Sequence[MissingPoints]
    points_world: Floats
    distances_m: Floats
    completer_confidence: Floats | None


class SceneStages:
    """Stages of a scene, in the order of their methods.

    Parameters
    ----------
    scene
        Frames and truth; the target is its first object.
    job, config
        Which scene, and a configuration with the pipeline's defaults written out.
    clock
        Takes the time of every stage, also of those that another configuration had computed.
    memo
        Keeps what the stages yield.
    """

    def __init__(
        self, scene: Scene, *, job: SceneJob, config: Config, clock: StageClock, memo: Memo
    ) -> None:
        self.scene = scene
        self.job = job
        self.config = config
        self.clock = clock
        self._keys = StageKeys(config, job)
        self._memo = memo

    @cached_property
    def mapped(self) -> Mapped:
        """The map, with completed shapes."""
        return map_in_stages(
            self.scene, config=self.config, keys=self._keys, memo=self._memo, clock=self.clock
        )

    @cached_property
    def truths(self) -> Sequence[MeshTruth]:
        """The true meshes of the scene's objects."""
        return self._timed(
            "meshes", self._keys.meshes, lambda: [mesh_truth(item) for item in self.scene.objects]
        )

    def find_target(self) -> MappedObject | TargetMissedError:
        """Find the mapped object that is the target."""

        def find() -> MappedObject | TargetMissedError:
            objects = self.mapped.pipeline.objects()
            try:
                return find_mapped(objects, self.truths, name=self.scene.objects[0].name)
            except TargetMissedError as missed:
                return missed

        return self._timed("target", self._keys.target, find)

    def ask(self, item: MappedObject) -> Question:
        """Draw training and test points, and measure the latter.

        Raises
        ------
        SceneFailure
            No test set has points.
        """
        protocol, pipeline = self.config.protocol, self.mapped.pipeline
        training = self._of_pipeline(
            "training points",
            self._keys.training,
            lambda: pipeline.training_set(item.id, seed=self.job.seed),
        )
        asked, missing = self._of_pipeline(
            "test points",
            self._keys.points,
            lambda: gather_test_sets(
                protocol.test_sets,
                target=self.scene.objects[0],
                object_id=item.id,
                pipeline=pipeline,
                count=protocol.test_points,
                seed=self.job.seed,
            ),
        )
        if not asked:
            raise SceneFailure(missing[0].reason)
        points = np.concatenate([part.points_world for part in asked])
        use_spread = protocol.use_spread and COMPLETED in protocol.test_sets
        return Question(
            item=item,
            training=training,
            asked=asked,
            missing=missing,
            points_world=points,
            distances_m=self._timed(
                "truth",
                self._keys.distances,
                lambda: np.stack([truth.distances(points) for truth in self.truths]),
            ),
            completer_confidence=(
                np.concatenate([part.confidence for part in asked]) if use_spread else None
            ),
        )

    def classify(self, question: Question, *, model: str) -> Predictions:
        """Ask a model about the test points."""
        pipeline = self.mapped.pipeline
        return self._of_pipeline(
            "classify",
            self._keys.predictions(model),
            lambda: pipeline.classify(
                question.item.id,
                question.training,
                question.points_world,
                model=model,
                completion_confidence=question.completer_confidence,
            ),
        )

    def _timed(self, stage: str, key: str, compute: Callable[[], Value]) -> Value:
        """Compute a stage of the truth, timed here."""

        def timed() -> tuple[Value, Times]:
            start = time.perf_counter()
            value = compute()
            return value, (("truth", None, time.perf_counter() - start),)

        return self._memo.get(stage, key, timed, clock=self.clock)

    def _of_pipeline(self, stage: str, key: str, compute: Callable[[], Value]) -> Value:
        """Compute a stage that the pipeline times."""

        def timed() -> tuple[Value, Times]:
            before = self.mapped.pipeline.timings()
            value = compute()
            return value, spent_since(self.mapped.pipeline, before)

        return self._memo.get(stage, key, timed, clock=self.clock)
