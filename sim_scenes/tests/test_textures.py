from __future__ import annotations

import numpy as np
import pytest

from sim_scenes.streams import stream
from sim_scenes.textures import (
    FLOOR_PATTERNS,
    OBJECT_PATTERNS,
    TABLE_PATTERNS,
    Pattern,
    paint,
    plain,
    uniform,
)

ALL = sorted({*OBJECT_PATTERNS, *TABLE_PATTERNS, *FLOOR_PATTERNS}, key=lambda p: p.__name__)


@pytest.mark.parametrize("pattern", ALL, ids=lambda p: p.__name__)
def test_patterns_paint_their_stream(pattern: Pattern) -> None:
    first = paint(stream(1, "x"), (pattern,))
    assert first.shape == (256, 256, 3)
    assert first.dtype == np.uint8
    np.testing.assert_array_equal(first, paint(stream(1, "x"), (pattern,)))
    assert not np.array_equal(first, paint(stream(2, "x"), (pattern,)))
    # Beyond the fine noise of 1.5 %, all but the plain one show two colours in most draws.
    spread = np.mean([paint(stream(s, "x"), (pattern,)).std(axis=(0, 1)).max() for s in range(8)])
    assert (spread > 8) == (pattern is not plain)


def test_uniform_is_its_colour() -> None:
    assert np.unique(uniform(np.array([0.0, 0.5, 1.0])).reshape(-1, 3), axis=0).tolist() == [
        [0, 128, 255]
    ]
