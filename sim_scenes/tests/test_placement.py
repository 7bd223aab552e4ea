from __future__ import annotations

import numpy as np

from sim_scenes.placement import _fits

TARGET = np.array([0.5, 0.0])


def test_a_wide_object_may_stand_right_beside_the_target() -> None:
    # Its middle is 0.31 m from the target's, 1 cm more than both radii.
    beside = np.array([0.45, 0.306])
    assert _fits(beside, 0.25, [TARGET], [0.05])
    assert not _fits(beside, 0.27, [TARGET], [0.05])


def test_a_small_object_stands_near_the_target() -> None:
    assert _fits(np.array([0.5, 0.12]), 0.05, [TARGET], [0.05])
    assert not _fits(np.array([0.45, 0.306]), 0.05, [TARGET], [0.01])
