"""Every array argument of the compiled module, spoilt in turn: the error names it and the cure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from harness.native import (
    MeshTruth,
    OccupancyMap,
    Pipeline,
    TrainingSet,
    binary_metrics,
    gp_log_likelihood,
    gp_posterior,
    nearest_observation,
)
from harness.tests.support import frame

Call = Callable[..., object]


def new_scan(**arrays: Any) -> None:
    OccupancyMap(0.1).insert_scan(**arrays)


def flat_mesh() -> MeshTruth:
    return MeshTruth(np.eye(3), np.array([[0, 1, 2]], dtype=np.uint32))


GP: dict[str, Any] = {
    "points": np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]),
    "labels": np.array([0, 1, 0, 1], dtype=np.uint8),
    "lengthscales": np.array([0.1, 0.1]),
    "outputscales": np.array([1.0, 1.0]),
    "means": np.array([0.0, 0.0]),
}
TEST = {"test_points": np.zeros((1, 3))}
FLAGS = {"predicted": np.array([True, False]), "truth": np.array([True, True])}
HALVES = np.array([0.5, 0.5])
# Everything that takes arrays, with sound ones: each is spoilt in turn.
CALLS: list[tuple[Call, dict[str, Any]]] = [
    (lambda **a: Pipeline().add_frame(**a), frame()),
    (gp_log_likelihood, GP),
    (gp_posterior, GP | TEST),
    (MeshTruth, {"vertices": np.eye(3), "faces": np.array([[0, 1, 2]], dtype=np.uint32)}),
    (lambda **a: flat_mesh().distances(**a), {"points": np.zeros((2, 3))}),
    (
        lambda **a: flat_mesh().ray_depths(**a),
        {"origins": np.zeros((2, 3)), "directions": np.ones((2, 3))},
    ),
    (nearest_observation, {"points": np.zeros((2, 3)), "observed": np.ones((2, 3))}),
    (binary_metrics, FLAGS | {"probability": HALVES, "decision_confidence": HALVES}),
    (TrainingSet, {"points_world": np.eye(3), "classes": np.array([0, 6, 6], dtype=np.uint8)}),
    (new_scan, {"origin_world": np.zeros(3), "points_world": np.ones((2, 3))}),
]
ARGUMENTS = [
    pytest.param(call, arrays, name, id=f"{number}-{name}")
    for number, (call, arrays) in enumerate(CALLS)
    for name, value in arrays.items()
    if isinstance(value, np.ndarray)
]
POINTS = [
    pytest.param(call, arrays, name, id=f"{number}-{name}")
    for number, (call, arrays) in enumerate(CALLS)
    for name, value in arrays.items()
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and value.shape[1:] == (3,)
]


@pytest.mark.parametrize(("call", "arrays"), CALLS)
def test_sound_arrays_are_taken(call: Call, arrays: dict[str, Any]) -> None:
    call(**arrays)


@pytest.mark.parametrize(("call", "arrays", "name"), ARGUMENTS)
def test_dtypes_name_the_argument_and_the_cure(
    call: Call, arrays: dict[str, Any], name: str
) -> None:
    sound = arrays[name]
    wrong = sound.astype(np.float32 if sound.dtype == np.float64 else np.float64)
    with pytest.raises(TypeError) as caught:
        call(**arrays | {name: wrong})
    assert str(caught.value) == (
        f"{name} has dtype {wrong.dtype}; expected {sound.dtype}, "
        f"as {name}.astype(numpy.{sound.dtype}) gives"
    )
    swapped = sound.astype(sound.dtype.newbyteorder(">"))
    if swapped.dtype != sound.dtype:
        with pytest.raises(TypeError, match=rf"{name} has dtype >..; expected {sound.dtype}, as "):
            call(**arrays | {name: swapped})


@pytest.mark.parametrize(("call", "arrays", "name"), ARGUMENTS)
def test_shapes_name_the_argument(call: Call, arrays: dict[str, Any], name: str) -> None:
    with pytest.raises(ValueError, match=rf"{name} has shape \(.*\); expected \(.*\)$"):
        call(**arrays | {name: arrays[name][None]})


@pytest.mark.parametrize(("call", "arrays", "name"), ARGUMENTS)
def test_memory_order_is_never_guessed(call: Call, arrays: dict[str, Any], name: str) -> None:
    sound = arrays[name]
    scattered = [np.repeat(sound, 2, axis=0)[::2]] if len(sound) > 1 else []
    if min(sound.shape) > 1 and sound.ndim > 1:
        scattered.append(np.asfortranarray(sound))
    for array in scattered:
        assert np.array_equal(array, sound)
        with pytest.raises(ValueError, match=rf"{name} .*; pass numpy.ascontiguousarray\({name}\)"):
            call(**arrays | {name: array})


@pytest.mark.parametrize(("call", "arrays", "name"), POINTS)
def test_points_that_are_not_finite_are_named_by_row(
    call: Call, arrays: dict[str, Any], name: str
) -> None:
    row = rf"{name}\[{len(arrays[name]) - 1}\]"
    for value in (np.nan, np.inf):
        spoilt = arrays[name].copy()
        spoilt[-1, 1] = value
        with pytest.raises(ValueError, match=rf"{row} (is not finite; remove|has the coordinate)"):
            call(**arrays | {name: spoilt})
