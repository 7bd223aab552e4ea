from __future__ import annotations

import numpy as np
import pytest

from sim_scenes.geometry import (
    Floats,
    apply,
    inverse,
    look_at,
    quaternion_from_rotation,
    rigid,
    rotation_angle,
    rotation_from_quaternion,
)
from sim_scenes.streams import stream


def random_rotations(count: int) -> list[np.ndarray]:
    quaternions = np.random.default_rng(0).standard_normal((count, 4))
    # Half turns, where the trace says nothing, and nearly none.
    special = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [1e-9, 0, 0, 1]]
    return [rotation_from_quaternion(q) for q in [*quaternions, *special]]


@pytest.mark.parametrize("rotation", random_rotations(20))
def test_rotations_survive_the_trip_through_quaternions(rotation: Floats) -> None:
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1)
    back = rotation_from_quaternion(quaternion_from_rotation(rotation))
    np.testing.assert_allclose(back, rotation, atol=1e-14)


def test_a_quarter_turn_about_z() -> None:
    half = np.sqrt(0.5)
    turn = rotation_from_quaternion([0, 0, half, half])
    np.testing.assert_allclose(turn, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)
    assert rotation_angle(turn) == pytest.approx(np.pi / 2)


def test_inverse_undoes() -> None:
    pose = rigid(rotation=random_rotations(1)[0], translation=[1, 2, 3])
    points = np.array([[0.1, 0.2, 0.3], [-1, 0, 2]])
    np.testing.assert_allclose(apply(inverse(pose), apply(pose, points)), points, atol=1e-14)


def test_look_at_is_upright_and_centred() -> None:
    pose = look_at(eye=np.array([0.0, -1.0, 1.0]), target=np.array([0.0, 0.0, 0.0]))
    half = np.sqrt(0.5)
    # Right is the world's x; down the image is down the slope; forward is towards the target.
    expected = np.array([[1, 0, 0], [0, -half, half], [0, -half, -half]])
    np.testing.assert_allclose(pose[:3, :3], expected, atol=1e-15)
    np.testing.assert_array_equal(pose[:3, 3], [0, -1, 1])


def test_streams_depend_on_seed_and_purpose_alone() -> None:
    first = stream(3, "a").random(4)
    np.testing.assert_array_equal(first, stream(3, "a").random(4))
    assert not np.array_equal(first, stream(3, "b").random(4))
    assert not np.array_equal(first, stream(4, "a").random(4))
