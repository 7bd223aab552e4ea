"""Our own networks as segmenters: what does not depend on how well they were trained."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from harness.native import Detection, Pipeline, Segmenter, check_pipeline_config
from harness.tests.support import frame

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

NAMES = ("maskrcnn", "maskrcnn_rgbd")
HEIGHT, WIDTH = 240, 320


def config(name: str, **segmentation: Any) -> str:
    return json.dumps({"segmenter": name, "completer": "none", "segmentation": segmentation})


def picture(**change: Any) -> dict[str, Any]:
    """A flat frame of coloured patches, of which nobody knows the truth."""
    patches = np.random.default_rng(0).integers(256, size=(6, 8, 3), dtype=np.uint8)
    return frame(
        **(
            {
                "rgb": np.ascontiguousarray(patches.repeat(40, axis=0).repeat(40, axis=1)),
                "depth_m": np.full((HEIGHT, WIDTH), 0.5, dtype=np.float32),
                "intrinsics": (308.0, 308.0, 159.75, 119.75),
                "instance_ids": None,
                "categories": None,
            }
            | change
        )
    )


def found(name: str, *, frame: dict[str, Any] | None = None, **settings: Any) -> list[Detection]:
    return Segmenter(config(name, **settings)).segment(**(frame or picture()))


@pytest.mark.parametrize("name", NAMES)
def test_a_network_comes_with_the_library(name: str) -> None:
    segmenter = Segmenter(config(name))
    assert segmenter.name == name == Pipeline(config(name)).segmenter
    assert segmenter.temperature is not None
    assert segmenter.temperature > 0
    assert Segmenter(config(name, calibrated=False)).temperature == 1.0
    assert Segmenter('{"segmenter": "oracle"}').temperature is None


@pytest.mark.parametrize("name", NAMES)
def test_detections_are_sound(name: str) -> None:
    detections = found(name, least_score=0)
    for detection in detections:
        assert detection.mask.shape == (HEIGHT, WIDTH)
        assert detection.mask.any()
        left, top, right, bottom = detection.box
        assert -0.5 <= left < right <= WIDTH - 0.5
        assert -0.5 <= top < bottom <= HEIGHT - 0.5
        assert detection.class_scores.sum() <= 1 + 1e-6
        assert detection.score == detection.class_scores.max()
    scores = [item.score for item in detections]
    assert scores == sorted(scores, reverse=True)
    least = scores[len(scores) // 2] if scores else 0.5
    kept = [item.score for item in found(name, least_score=least)]
    assert kept == [score for score in scores if score >= least]


@pytest.mark.parametrize("name", NAMES)
def test_an_all_black_image_holds_nothing(name: str) -> None:
    black = {"rgb": np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)}
    assert found(name, frame=picture(**black)) == []
    pipeline = Pipeline(config(name))
    assert pipeline.add_frame(**picture(**black)) == []
    assert pipeline.objects() == []
    assert len(pipeline.voxels().classes) > 0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"rgb": np.zeros((320, 240, 3), np.uint8)}, ValueError, "expected (240, 320, 3)"),
        (
            {"rgb": np.zeros((240, 320, 3), np.float32)},
            TypeError,
            "rgb has dtype float32; expected",
        ),
        ({"depth_m": np.zeros((240, 320), np.float32)}, ValueError, "depth_m is 0 at pixel (0, 0)"),
    ],
)
def test_an_image_of_wrong_size_or_type_is_refused(
    name: str, change: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error) as caught:
        found(name, frame=picture(**change))
    assert message in str(caught.value)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("make", [Segmenter, Pipeline, check_pipeline_config])
def test_weights_that_are_missing_or_damaged_are_found_at_once(
    make: Callable[[str], object], name: str, tmp_path: Path
) -> None:
    path = tmp_path / "mine.safetensors"
    with pytest.raises(OSError, match=r"mine\.safetensors"):
        make(config(name, weights=str(path)))
    path.write_bytes(b"no weights")
    with pytest.raises(ValueError, match=r"mine\.safetensors"):
        make(config(name, weights=str(path)))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"least_score": 1.5}, r"segmentation\.least_score is 1\.5; it must lie in \[0, 1\]"),
        ({"least_score": "high"}, r"segmentation\.least_score is \"high\"; expected a number"),
        ({"weights": ""}, r"segmentation\.weights is empty; name a file of weights"),
        ({"calibrate": False}, r"did you mean segmentation\.calibrated\?"),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Segmenter(config("maskrcnn", **settings))
