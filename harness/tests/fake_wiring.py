"""The benchmark on fake scenes; apart from them, so that workers need not import the benchmark."""

from __future__ import annotations

from dataclasses import replace

from harness.bench import Wiring
from harness.tests.fake_scenes import (
    MODELS,
    RECORDED_FUNCTION,
    SCENE_FUNCTION,
    VARIANTS_FUNCTION,
)

WIRING = Wiring(
    scene_function=SCENE_FUNCTION,
    variants_function=VARIANTS_FUNCTION,
    load_objects=lambda _: MODELS,
    check_pipeline=lambda text: text,
)


def recorded_wiring() -> Wiring:
    """Wire scenes that have recordings too."""
    return replace(WIRING, scene_function=RECORDED_FUNCTION)
