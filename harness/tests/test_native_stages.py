"""Stages that are computed once and used again: kept detections, and reconfigured pipelines."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from harness.native import CLASS_NAMES, Detection, Pipeline, Segmenter
from harness.tests.support import HEIGHT, LOOKING_DOWN, WIDTH, frame

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

HERE = "harness.tests.test_native_stages"
MUG = CLASS_NAMES.index("mug") - 1
TEST_POINTS = np.array([[0.0, 0.0, -0.45], [0.05, 0.02, -0.45], [0.0, 0.0, -0.43]])
REPEATED = "the segmenter was asked again"


def lid() -> npt.NDArray[np.bool_]:
    mask = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    mask[16:32, 20:44] = True
    return mask


def unsure(**frame: Any) -> list[dict[str, Any]]:
    """Numbers that no decimal holds: they must go to Python and back."""
    scores = np.full(6, 0.1 / 3)
    scores[MUG] = 2 / 3
    return [{"mask": lid(), "class_scores": scores, "score": 0.7}]


def unwilling(**frame: Any) -> list[dict[str, Any]]:
    raise RuntimeError(REPEATED)


def below(**frame: Any) -> list[tuple[np.ndarray, np.ndarray | None] | None]:
    """Complete what is seen by itself, 2 cm deeper."""
    fx, fy, cx, cy = frame["intrinsics"]
    answers: list[tuple[np.ndarray, np.ndarray | None] | None] = []
    for mask in frame["masks"]:
        v, u = np.nonzero(mask)
        z = frame["depth_m"][mask].astype(np.float64) + 0.02
        points = np.stack([(u - cx) / fx * z, (v - cy) / fy * z, z], axis=1)
        answers.append((points, np.full(len(points), 0.003)))
    return answers


def config(**change: Any) -> str:
    settings = {
        "segmenter": f"python:{HERE}.unsure",
        "completer": "none",
        "training": {"points": 400},
        "gp": {"fit_points": 200},
        "metric": {"table_height_m": -0.5},
    }
    return json.dumps(settings | change)


BELOW: dict[str, Any] = {"completer": f"python:{HERE}.below", "completion": {"refine": False}}


def views() -> list[dict[str, Any]]:
    """The lid from above, and from 5 mm to the side: less than a pixel of it."""
    moved = LOOKING_DOWN.copy()
    moved[0, 3] = 0.005
    unlabelled = {"instance_ids": None, "categories": None}
    return [frame(**unlabelled), frame(world_from_camera=moved, **unlabelled)]


def detections(view: dict[str, Any]) -> list[Detection]:
    return Segmenter(config()).segment(**view)


def kept(detection: Detection) -> Detection:
    """A detection that was arrays in between."""
    return Detection(
        mask=detection.mask, class_scores=detection.class_scores, score=detection.score
    )


def with_views(pipeline: Pipeline) -> Pipeline:
    for view in views():
        assert pipeline.add_frame(**view) == [1]
    return pipeline


def completed_again(pipeline: Pipeline) -> Pipeline:
    for index, view in enumerate(views()):
        pipeline.complete_frame(index, **view, detections=[kept(d) for d in detections(view)])
    return pipeline


def said(pipeline: Pipeline) -> list[bytes | str | None]:
    """All that a pipeline says, to the bit."""
    voxels = pipeline.voxels()
    training = pipeline.training_set(1, seed=5)
    predictions = pipeline.classify(1, training, TEST_POINTS, model="classic")
    completion = pipeline.completion(1)
    completions = ([] if completion is None else [completion]) + pipeline.view_completions(1)
    arrays: list[np.ndarray] = [
        voxels.centres_world,
        voxels.histograms,
        voxels.object_ids,
        *(item.points_world for item in pipeline.objects()),
        training.points_world,
        predictions.probabilities,
        predictions.confidence,
        *(item.points_world for item in completions),
        *(item.spread_m for item in completions),
    ]
    return [*(array.tobytes() for array in arrays), pipeline.uncompleted(1)]


def stages(pipeline: Pipeline) -> list[str]:
    return [stage for stage, _, _ in pipeline.timings()]


def test_a_detection_is_its_mask_its_class_scores_and_its_score() -> None:
    [found] = detections(views()[0])
    again = kept(found)
    assert again.mask.dtype == np.bool_
    assert np.array_equal(again.mask, lid())
    assert again.class_scores.tobytes() == found.class_scores.tobytes()
    assert (again.category, again.score) == ("mug", 0.7)
    assert again.box.tolist() == found.box.tolist() == [19.5, 15.5, 43.5, 31.5]


@pytest.mark.parametrize("completer", ["none", "cloud"])
def test_kept_detections_give_the_bits_of_the_segmenter(completer: str) -> None:
    found = with_views(Pipeline(config(completer=completer)))
    segmented = Pipeline(config(completer=completer, segmenter=f"python:{HERE}.unwilling"))
    with pytest.raises(ValueError, match=REPEATED):
        segmented.add_frame(**views()[0])
    for view in views():
        again = tuple(kept(detection) for detection in detections(view))
        assert segmented.add_frame(**view, detections=again) == [1]
    assert said(segmented) == said(found)
    assert stages(segmented)[0] == ("map" if completer == "none" else "complete")


def test_no_detections_are_none_and_not_the_segmenters() -> None:
    pipeline = Pipeline(config())
    assert pipeline.add_frame(**views()[0], detections=[]) == []
    assert pipeline.objects() == []
    assert len(pipeline.voxels().classes) > 0


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"mask": lid()[:0]}, ValueError, "mask is empty; leave out what covers no pixel"),
        ({"mask": ~lid() & lid()}, ValueError, "mask is empty; leave out what covers no pixel"),
        ({"mask": lid()[0]}, ValueError, r"mask has shape \(64,\); expected \(height, width\)"),
        ({"mask": lid().T}, ValueError, "mask is not C-contiguous"),
        ({"mask": lid().astype(int)}, TypeError, "mask has dtype int64; expected bool"),
        ({"class_scores": np.zeros(7)}, ValueError, r"class_scores has shape \(7,\); expected"),
        ({"class_scores": np.full(6, 0.5)}, ValueError, "class_scores add up to 3"),
        ({"score": 1.5}, ValueError, r"score is 1\.5; it must lie in \[0, 1\]"),
        ({"score": np.nan}, ValueError, r"score is NaN; it must lie in \[0, 1\]"),
    ],
)
def test_a_detection_of_what_is_none_is_refused(
    change: dict[str, Any], error: type[Exception], message: str
) -> None:
    good: dict[str, Any] = {"mask": lid(), "class_scores": np.zeros(6), "score": 0.5}
    with pytest.raises(error, match=message):
        Detection(**(good | change))


def small() -> Detection:
    return Detection(mask=np.ones((24, 32), dtype=np.bool_), class_scores=np.zeros(6), score=1.0)


@pytest.mark.parametrize(
    ("listed", "error", "message"),
    [
        (
            [small()],
            ValueError,
            r"the mask of detections\[0\] has shape \(24, 32\); the frame's images have \(48, 64\)",
        ),
        ([{"mask": lid()}], TypeError, r"detections\[0\] is of type dict; expected a Detection"),
        (7, TypeError, "detections is of type int; expected a list of detections, as Segmenter"),
    ],
)
def test_detections_of_another_frame_are_refused(
    listed: Any, error: type[Exception], message: str
) -> None:
    view = views()[0]
    pipeline = with_views(Pipeline(config()))
    copy = pipeline.reconfigured(config(**BELOW))
    calls: list[Callable[[], object]] = [
        lambda: pipeline.add_frame(**view, detections=listed),
        lambda: copy.complete_frame(0, **view, detections=listed),
    ]
    for call in calls:
        with pytest.raises(error, match=message):
            call()
    assert copy.frames_to_complete == [0, 1]
    assert pipeline.objects()[0].views == 2


def test_the_same_configuration_gives_the_same_bits() -> None:
    original = with_views(Pipeline(config(**BELOW)))
    copy = original.reconfigured(config(**BELOW))
    assert copy.timings() == []
    assert copy.frames_to_complete == []
    assert len(copy.view_completions(1)) == 2
    assert said(copy) == said(original)
    assert stages(copy) == ["training points", "fit", "posterior", "fuse"]


@pytest.mark.parametrize("change", [{"completer": "cloud"}, BELOW])
def test_frames_completed_again_are_as_if_added_under_the_configuration(
    change: dict[str, Any],
) -> None:
    base = with_views(Pipeline(config()))
    again = base.reconfigured(config(**change))
    assert again.frames_to_complete == [0, 1]
    assert completed_again(again).frames_to_complete == []
    assert "segment" not in stages(again)
    assert "map" not in stages(again)
    from_the_start = with_views(Pipeline(config(**change)))
    assert said(again) == said(from_the_start)
    assert again.completion(1) is not None
    assert with_views(again).objects()[0].views == 4


def test_the_original_is_untouched() -> None:
    original = with_views(Pipeline(config(**BELOW)))
    before, timings = said(original), original.timings()
    copy = original.reconfigured(config(**BELOW))
    moved = views()[0] | {"depth_m": np.full((HEIGHT, WIDTH), 0.48, dtype=np.float32)}
    copy.add_frame(**moved)
    training = copy.training_set(1, seed=5)
    predictions = copy.classify(1, training, TEST_POINTS, model="nearest")
    copy.annotate(1, TEST_POINTS, predictions)
    assert original.timings() == timings
    assert said(original) == before
    assert said(copy) != before


def test_a_part_of_the_frames_is_no_answer() -> None:
    again = with_views(Pipeline(config())).reconfigured(config(**BELOW))
    view = views()[0]
    again.complete_frame(0, **view, detections=detections(view))
    calls: list[Callable[[], object]] = [
        lambda: again.completion(1),
        lambda: again.view_completions(1),
        lambda: again.uncompleted(1),
        lambda: again.add_frame(**view),
    ]
    for call in calls:
        with pytest.raises(ValueError, match=r"1 of 2 frames are completed .* frame 1 next"):
            call()
    for index in (0, 2):
        with pytest.raises(ValueError, match=f"frame {index} cannot be .*: frame 1 is the next"):
            again.complete_frame(index, **view, detections=detections(view))
    with pytest.raises(ValueError, match="frame 1 was mapped with another pose of the camera"):
        again.complete_frame(1, **view, detections=detections(view))
    with pytest.raises(ValueError, match=r"another number of detections \(1, not 0\)"):
        again.complete_frame(1, **views()[1], detections=[])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"segmenter": "oracle"}, 'segmenter is "oracle", but the frames were mapped with "python'),
        ({"segmentation": {"least_score": 0.25}}, "segmentation.least_score is 0.25, but"),
        ({"map": {"association": "centroid"}}, 'map.association is "centroid", but'),
        ({"gp": {"models": []}}, "gp.models is empty"),
        ({"completer": "clod"}, 'completer is "clod"; expected one of'),
        ({"completer": f"python:{HERE}.nowhere"}, f"the module {HERE} has no nowhere"),
    ],
)
def test_a_configuration_that_cannot_be_is_refused(change: dict[str, Any], message: str) -> None:
    pipeline = Pipeline(config())
    with pytest.raises(ValueError, match=message):
        pipeline.reconfigured(config(**change))
