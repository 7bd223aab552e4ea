"""What our trained networks see in rendered frames: whole, cut by the border, twice."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from harness.native import Detection, Pipeline, Segmenter
from sim_scenes import SceneSpec, load_object_set, simulate

if TYPE_CHECKING:
    import numpy.typing as npt

    Mask = npt.NDArray[np.bool_]
    # Arguments of `Segmenter.segment`, and the true masks.
    Shown = tuple[dict[str, Any], list[Mask]]

NAMES = ("maskrcnn", "maskrcnn_rgbd")


def config(name: str) -> str:
    return json.dumps({"segmenter": name, "completer": "none"})


@pytest.fixture(scope="module")
def mug() -> Shown:
    """A mug on the table."""
    scene = simulate(SceneSpec.single("mug", views=1), seed=5, objects=load_object_set())
    [frame] = scene.frames
    assert frame.instance_ids is not None
    camera = frame.intrinsics
    arguments = {
        "rgb": frame.rgb,
        "depth_m": frame.depth_m,
        "intrinsics": (camera.fx, camera.fy, camera.cx, camera.cy),
        "world_from_camera": frame.world_from_camera,
    }
    return arguments, [frame.instance_ids == 1]


def cut(shown: Shown) -> Shown:
    """Leave out the right of the image, a third of the object with it."""
    arguments, [mask] = shown
    end = int(np.quantile(np.nonzero(mask)[1], 0.67))
    kept = {name: np.ascontiguousarray(arguments[name][:, :end]) for name in ("rgb", "depth_m")}
    return arguments | kept, [mask[:, :end]]


def twice(shown: Shown) -> Shown:
    """Put the object's likeness beside it, a quarter before it."""
    arguments, [mask] = shown
    columns = np.nonzero(mask)[1]
    shift = int(0.75 * (columns.max() - columns.min()))
    shift = -shift if columns.mean() > mask.shape[1] / 2 else shift
    copy = np.roll(mask, shift, axis=1)
    rgb, depth_m = arguments["rgb"].copy(), arguments["depth_m"].copy()
    rgb[copy] = np.roll(rgb, shift, axis=1)[copy]
    depth_m[copy] = np.roll(depth_m, shift, axis=1)[copy] - np.float32(0.02)
    return arguments | {"rgb": rgb, "depth_m": depth_m}, [mask & ~copy, copy]


def overlap(one: Mask, other: Mask) -> float:
    return float((one & other).sum() / (one | other).sum())


def seen(name: str, shown: Shown, *, strays: int = 0) -> list[Detection]:
    """Detections of the true masks, in their order; with no more than so many others."""
    arguments, masks = shown
    detections = Segmenter(config(name)).segment(**arguments)
    assert len(masks) <= len(detections) <= len(masks) + strays
    found = Pipeline(config(name)).add_frame(**arguments)
    assert sorted(map(str, found)) == [str(number + 1) for number in range(len(detections))]
    overlaps = np.array([[overlap(item.mask, mask) for item in detections] for mask in masks])
    return [detections[best] for best in overlaps.argmax(axis=1)]


@pytest.mark.parametrize("name", NAMES)
def test_a_mug_is_found(name: str, mug: Shown) -> None:
    [detection] = seen(name, mug)
    assert detection.category == "mug"
    assert overlap(detection.mask, mug[1][0]) > 0.8


@pytest.mark.parametrize("name", NAMES)
def test_a_mug_that_the_border_cuts_is_found(name: str, mug: Shown) -> None:
    shown = cut(mug)
    [detection] = seen(name, shown)
    assert overlap(detection.mask, shown[1][0]) > 0.7
    # The border lies in the middle of the network's image here, and is told like any other edge.
    assert abs(detection.box[2] - (shown[1][0].shape[1] - 0.5)) <= 6.0


@pytest.mark.parametrize("name", NAMES)
def test_like_mugs_that_overlap_are_two(name: str, mug: Shown) -> None:
    shown = twice(mug)
    # Without depth the seam of the picture is now and then seen as a thing of its own.
    first, second = seen(name, shown, strays=int(name == "maskrcnn"))
    assert first is not second
    for detection, mask in zip((first, second), shown[1], strict=True):
        assert detection.category == "mug"
        assert overlap(detection.mask, mask) > 0.6


@pytest.mark.parametrize("name", NAMES)
def test_a_bare_table_holds_nothing(name: str, mug: Shown) -> None:
    arguments, _ = mug
    rgb = np.full_like(arguments["rgb"], (150, 120, 90))
    height, width = arguments["depth_m"].shape
    fx, fy, cx, cy = arguments["intrinsics"]
    # The table z = 0 as the camera sees it.
    pose = arguments["world_from_camera"]
    v, u = np.indices((height, width))
    rays = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones((height, width))], axis=-1)
    depth_m = (-pose[2, 3] / (rays @ pose[2, :3])).astype(np.float32)
    depth_m[~((depth_m > 0.2) & (depth_m < 3.0))] = np.nan
    bare = arguments | {"rgb": rgb, "depth_m": depth_m}
    assert Segmenter(config(name)).segment(**bare) == []
    assert Pipeline(config(name)).add_frame(**bare) == []
