"""Outputs of stages, kept by the content of what they depend on.

A stage is a pure function of its inputs and of some settings. Its key is a hash of both, inputs by
their own keys, so that two configurations that agree on all that a stage depends on share its
output, whatever else they differ in.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar, cast

if TYPE_CHECKING:
    from collections.abc import Callable

    from harness.stages.clock import StageClock, Times

Value = TypeVar("Value")


def stage_key(stage: str, *inputs: str, settings: object = None) -> str:
    """Name a stage's output by what it depends on.

    Parameters
    ----------
    stage
        Its name.
    inputs
        Keys of the outputs that it takes.
    settings
        What it depends on besides, as plain values.
    """
    text = json.dumps([stage, inputs, settings], sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


@dataclass(eq=False)
class Memo:
    """Outputs of the stages of one scene.

    Attributes
    ----------
    computed
        How often each stage was computed.
    """

    computed: Counter[str] = field(default_factory=Counter)
    _kept: dict[str, tuple[Any, Times]] = field(default_factory=dict)

    def get(
        self, stage: str, key: str, compute: Callable[[], tuple[Value, Times]], *, clock: StageClock
    ) -> Value:
        """Return the output of a key, computed if it is not there.

        Parameters
        ----------
        stage
            Name, for the count.
        key
            Of the output: see `stage_key`.
        compute
            Returns the output and the time that it took. An exception is not kept.
        clock
            Takes that time, also where the output was there already: it is what the output costs.
        """
        if key not in self._kept:
            self.computed[stage] += 1
            self._kept[key] = compute()
        value, times = self._kept[key]
        clock.add_all(times)
        return cast("Value", value)

    def clear(self) -> None:
        """Forget every output."""
        self._kept.clear()
