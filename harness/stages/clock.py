"""How long the stages of a scene take."""

from __future__ import annotations

import time
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from harness.runs.records import Timing

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from harness.native import Pipeline

Times = tuple[tuple[str, str | None, float], ...]
"""(stage, model, seconds) in the order in which the stages ran."""


@dataclass
class StageClock:
    """Wall time per stage, in the order in which the stages ended."""

    scene_id: str
    timings: list[Timing] = field(default_factory=list)

    @contextmanager
    def stage(self, name: str, *, model: str | None = None) -> Iterator[None]:
        """Time the block as one stage."""
        start = time.perf_counter()
        yield
        self.add(name, time.perf_counter() - start, model=model)

    def add(self, name: str, seconds: float, *, model: str | None = None) -> None:
        """Note a stage that was timed elsewhere; what one stage takes adds up."""
        for index, timing in enumerate(self.timings):
            if (timing.stage, timing.model) == (name, model):
                self.timings[index] = replace(timing, seconds=timing.seconds + seconds)
                return
        self.timings.append(
            Timing(scene_id=self.scene_id, stage=name, model=model, seconds=seconds)
        )

    def add_all(self, times: Times) -> None:
        """Note stages that were timed elsewhere."""
        for stage, model, seconds in times:
            self.add(stage, seconds, model=model)


def spent_since(pipeline: Pipeline, before: Sequence[tuple[str, str | None, float]]) -> Times:
    """Time that a pipeline has spent since its `Pipeline.timings` were `before`."""
    earlier = {(stage, model): seconds for stage, model, seconds in before}
    spent = (
        (stage, model, seconds - earlier.get((stage, model), 0.0))
        for stage, model, seconds in pipeline.timings()
    )
    return tuple(item for item in spent if item[2] > 0)
