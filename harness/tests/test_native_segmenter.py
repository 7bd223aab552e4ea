"""Detections as Python sees them, and segmenters that are Python functions."""

from __future__ import annotations

import json
import multiprocessing
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from harness.native import CLASS_NAMES, Detection, Pipeline, Segmenter, check_pipeline_config
from harness.tests.support import HEIGHT, LOOKING_DOWN, WIDTH, frame

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import numpy.typing as npt

    from harness.native import Floats, SegmenterFunction

HERE = "harness.tests.test_native_segmenter"
MUG = CLASS_NAMES.index("mug") - 1
BOWL = CLASS_NAMES.index("bowl") - 1


@dataclass(frozen=True, eq=False)
class Found:
    """A detection of a segmenter's own class."""

    mask: npt.NDArray[np.bool_]
    score: float
    category: str


def by_depth(
    *,
    rgb: npt.NDArray[np.uint8],
    depth_m: npt.NDArray[np.float32],
    intrinsics: tuple[float, float, float, float],
    world_from_camera: Floats,
) -> list[dict[str, Any]]:
    """Take for a mug whatever is nearer than the table's 0.5 m."""
    mask = depth_m < 0.48
    return [{"mask": mask, "category": "mug", "score": 0.75}] if mask.any() else []


def lid() -> npt.NDArray[np.bool_]:
    mask = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    mask[16:32, 20:44] = True
    return mask


def doubtful(**frame: Any) -> list[dict[str, Any]]:
    scores = np.zeros(6)
    scores[[MUG, BOWL]] = 0.5, 0.25
    return [{"mask": lid(), "class_scores": scores}]


def unsure(**frame: Any) -> list[dict[str, Any]]:
    return [doubtful()[0] | {"score": 0.625}]


def of_own_class(**frame: Any) -> tuple[Found, ...]:
    return (Found(lid(), 1.0, "bowl"),)


def generated(**frame: Any) -> Iterator[Found]:
    yield from of_own_class()


def nothing(**frame: Any) -> list[Any]:
    return []


def broken(**frame: Any) -> list[Any]:
    raise KeyError("no such mask")


def broken_generator(**frame: Any) -> Iterator[Found]:
    yield from of_own_class()
    raise KeyError("no such mask")


def interrupted(**frame: Any) -> list[Any]:
    raise KeyboardInterrupt


def positional(rgb: Any, depth_m: Any) -> list[Any]:
    return []


def no_list(**frame: Any) -> Any:
    return None


def numbers(**frame: Any) -> list[int]:
    return [7]


def one(**change: Any) -> list[dict[str, Any]]:
    """A good detection after a changed one; what is changed to None is missing."""
    good = {"mask": lid(), "category": "mug", "score": 0.5}
    return [good, {key: value for key, value in (good | change).items() if value is not None}]


def without_mask(**frame: Any) -> Any:
    return one(mask=None)


def small_mask(**frame: Any) -> Any:
    return one(mask=np.ones((HEIGHT // 2, WIDTH // 2), dtype=np.bool_))


def soft_mask(**frame: Any) -> Any:
    return one(mask=lid().astype(np.float32))


def listed_mask(**frame: Any) -> Any:
    return one(mask=lid().tolist())


def empty_mask(**frame: Any) -> Any:
    return one(mask=np.zeros((HEIGHT, WIDTH), dtype=np.bool_))


def no_category(**frame: Any) -> Any:
    return one(category=None)


def both(**frame: Any) -> Any:
    return one(class_scores=np.zeros(6))


def cup(**frame: Any) -> Any:
    return one(category="cup")


def sixth(**frame: Any) -> Any:
    return one(category=6)


def no_score(**frame: Any) -> Any:
    return one(score=None)


def word_score(**frame: Any) -> Any:
    return one(score="high")


def high_score(**frame: Any) -> Any:
    return one(score=1.5)


def nan_score(**frame: Any) -> Any:
    return one(score=np.nan)


def short_scores(**frame: Any) -> Any:
    return one(category=None, class_scores=np.zeros(7))


def single_scores(**frame: Any) -> Any:
    return one(category=None, class_scores=np.zeros(6, dtype=np.float32))


def large_scores(**frame: Any) -> Any:
    return one(category=None, class_scores=np.full(6, 0.5))


def negative_scores(**frame: Any) -> Any:
    return one(category=None, class_scores=np.array([-0.5, 0, 0, 0, 0, 0]))


no_function = 3.0

calls: list[dict[str, Any]] = []


def recorded(**frame: Any) -> list[dict[str, Any]]:
    calls.append(frame)
    return doubtful()


def config(function: Callable[..., object] | str) -> str:
    name = function if isinstance(function, str) else f"{HERE}.{function.__name__}"
    return json.dumps({"segmenter": f"python:{name}", "completer": "none"})


def bare(**change: Any) -> dict[str, Any]:
    """A frame of which nobody knows the truth."""
    return frame(**({"instance_ids": None, "categories": None} | change))


def found(function: Callable[..., object], **change: Any) -> list[Detection]:
    return Segmenter(config(function)).segment(**bare(**change))


def test_a_python_function_finds_objects() -> None:
    function: SegmenterFunction = by_depth
    segmenter = Segmenter(config(function))
    assert segmenter.name == f"python:{HERE}.by_depth"
    [detection] = segmenter.segment(**bare())
    assert detection.mask.dtype == np.bool_
    assert np.array_equal(detection.mask, lid())
    assert detection.box.tolist() == [19.5, 15.5, 43.5, 31.5]
    assert (detection.category, detection.score) == ("mug", 0.75)
    assert detection.class_scores.tolist() == [0.75 * (i == MUG) for i in range(6)]


def test_the_pipeline_works_with_the_same_detections() -> None:
    pipeline = Pipeline(config(by_depth))
    assert pipeline.segmenter == f"python:{HERE}.by_depth"
    assert pipeline.add_frame(**bare()) == [1]
    [item] = pipeline.objects()
    assert (item.category, item.score, item.views) == ("mug", 0.75, 1)
    assert len(item.points_world) == lid().sum()
    assert [stage for stage, _, _ in pipeline.timings()] == ["segment", "map"]


def test_class_scores_are_the_votes_of_the_voxels() -> None:
    pipeline = Pipeline(config(unsure))
    pipeline.add_frame(**bare())
    voxels = pipeline.voxels()
    own = voxels.object_ids == 1
    assert own.sum() > 100
    votes = voxels.histograms[own]
    expected = np.zeros(7)
    expected[[0, BOWL + 1, MUG + 1]] = 0.25, 0.25, 0.5
    # The lid fills its voxels, but for those that its edge divides.
    whole = np.isclose(votes.sum(axis=1), 0.625, atol=1e-12)
    assert whole.mean() > 0.6
    assert np.allclose(votes[whole], 0.625 * expected, atol=1e-12)
    assert set(voxels.classes[own][whole]) == {MUG + 1}


def test_a_segmenter_gets_what_the_protocol_says() -> None:
    calls.clear()
    arguments = bare()
    arguments["depth_m"][0, 0] = np.nan
    arguments["rgb"][3, 5] = 1, 2, 3
    Segmenter(config(recorded)).segment(**arguments)
    # What is known of the truth stays with the oracle.
    Pipeline(config(recorded)).add_frame(**frame())
    call, second = calls
    assert set(call) == {"rgb", "depth_m", "intrinsics", "world_from_camera"} == set(second)
    assert call["rgb"].dtype == np.uint8
    assert np.array_equal(call["rgb"], arguments["rgb"])
    assert call["depth_m"].dtype == np.float32
    assert np.array_equal(call["depth_m"], arguments["depth_m"], equal_nan=True)
    assert call["intrinsics"] == arguments["intrinsics"]
    assert np.array_equal(call["world_from_camera"], LOOKING_DOWN)


def test_detections_may_be_mappings_or_objects_in_any_iterable() -> None:
    for function in (of_own_class, generated):
        [detection] = found(function)
        assert (detection.category, detection.score) == ("bowl", 1.0)
        assert np.array_equal(detection.mask, lid())


def test_the_score_is_the_best_class_score_unless_it_is_given() -> None:
    [detection] = found(doubtful)
    assert (detection.category, detection.score) == ("mug", 0.5)
    assert detection.class_scores[[BOWL, MUG]].tolist() == [0.25, 0.5]
    [detection] = found(unsure)
    assert (detection.category, detection.score) == ("mug", 0.625)


def test_an_image_without_objects_has_no_detections() -> None:
    assert found(nothing) == []
    plane = np.full((HEIGHT, WIDTH), 0.5, dtype=np.float32)
    assert found(by_depth, depth_m=plane) == []
    pipeline = Pipeline(config(by_depth))
    assert pipeline.add_frame(**bare(depth_m=plane)) == []
    assert pipeline.objects() == []
    assert len(pipeline.voxels().classes) > 0


def test_an_object_at_the_border_keeps_its_box_within_the_image() -> None:
    depth_m = np.full((HEIGHT, WIDTH), 0.5, dtype=np.float32)
    depth_m[40:, 50:] = 0.45
    [detection] = found(by_depth, depth_m=depth_m)
    assert detection.box.tolist() == [49.5, 39.5, WIDTH - 0.5, HEIGHT - 0.5]
    assert Pipeline(config(by_depth)).add_frame(**bare(depth_m=depth_m)) == [1]


def test_the_oracle_returns_the_true_masks() -> None:
    instance_ids = np.zeros((HEIGHT, WIDTH), dtype=np.uint16)
    instance_ids[0, :3] = 7
    instance_ids[5:7, 60:] = 3
    oracle = Segmenter('{"segmenter": "oracle"}')
    assert oracle.name == "oracle"
    categories = {7: "can", 3: "bowl", 5: "mug"}
    found = oracle.segment(**frame(instance_ids=instance_ids, categories=categories))
    assert [(item.category, item.score) for item in found] == [("bowl", 1.0), ("can", 1.0)]
    assert np.array_equal(found[0].mask, instance_ids == 3)
    assert [item.box.tolist() for item in found] == [[59.5, 4.5, 63.5, 6.5], [-0.5, -0.5, 2.5, 0.5]]
    with pytest.raises(ValueError, match='segmenter = "oracle" needs true masks: pass instance_id'):
        oracle.segment(**bare())


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"rgb": np.zeros((64, 48, 3), np.uint8)}, ValueError, "expected (48, 64, 3)"),
        ({"rgb": np.zeros((48, 64), np.uint8)}, ValueError, "rgb has shape (48, 64); expected"),
        ({"rgb": np.zeros((48, 64, 3))}, TypeError, "rgb has dtype float64; expected uint8"),
        ({"depth_m": np.ones((48, 64))}, TypeError, "depth_m has dtype float64; expected float32"),
        ({"depth_m": np.ones((1, 1), np.float32)}, ValueError, "rgb has shape (48, 64, 3)"),
        (
            {"depth_m": np.full((48, 64), np.nan, np.float32)},
            ValueError,
            "depth_m has no valid pixel",
        ),
        ({"intrinsics": (1.0, 2.0)}, TypeError, "expected the four numbers (fx, fy, cx, cy)"),
        ({"world_from_camera": np.eye(3)}, ValueError, "has shape (3, 3); expected (4, 4)"),
    ],
)
def test_a_frame_that_is_none_is_refused(
    change: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error) as caught:
        found(by_depth, **change)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (broken, "raised KeyError: 'no such mask'; mend it, or choose another segmenter"),
        (broken_generator, "raised KeyError: 'no such mask'; mend it"),
        (positional, "raised TypeError: .*unexpected keyword argument 'intrinsics'; mend it"),
        (no_list, "it is of type NoneType; return a list of detections, empty where nothing is"),
        (
            numbers,
            "entry 0, of type int, has no mask; make it a mapping or an object with",
        ),
        (without_mask, "entry 1, of type dict, has no mask; make it a mapping or an object"),
        (small_mask, r"mask of entry 1 has shape \(24, 32\); expected \(48, 64\)"),
        (soft_mask, "mask of entry 1 has dtype float32; expected bool, as .*astype"),
        (listed_mask, "mask of entry 1 is of type list; expected a numpy array of bool"),
        (empty_mask, "entry 1: the mask of instance 1 is empty; leave the instance out"),
        (no_category, "entry 1 has neither category nor class_scores; give one of them"),
        (both, "entry 1 has both category and class_scores; give one of them"),
        (cup, "category of entry 1: unknown category 'cup'; choose one of bottle, bowl, camera"),
        (sixth, "category of entry 1 is 6; expected a category's name, such as 'mug'"),
        (no_score, "entry 1 has no score; give how probable it is that the mug is there, from 0"),
        (word_score, "score of entry 1 is of type str; expected a number"),
        (high_score, r"score of entry 1 is 1\.5; it must lie in \[0, 1\]"),
        (nan_score, r"score of entry 1 is NaN; it must lie in \[0, 1\]"),
        (short_scores, r"class_scores of entry 1 has shape \(7,\); expected \(6,\)"),
        (single_scores, "class_scores of entry 1 has dtype float32; expected float64"),
        (large_scores, "entry 1: class_scores add up to 3; .*divide them by their sum"),
        (negative_scores, r"entry 1: class_scores is -0\.5; it must lie in \[0, 1\]"),
    ],
)
def test_a_segmenter_that_breaks_its_promise_is_named(
    function: Callable[..., object], message: str
) -> None:
    segmenter, pipeline = Segmenter(config(function)), Pipeline(config(function))
    for call in (segmenter.segment, pipeline.add_frame):
        with pytest.raises(
            ValueError, match=rf"the segmenter python:{HERE}\.{function.__name__} .*{message}"
        ) as caught:
            call(**bare())
        assert isinstance(caught.value.__cause__, Exception)
    assert pipeline.objects() == []
    assert len(pipeline.voxels().classes) == 0


def test_an_exceptions_own_traceback_is_kept() -> None:
    with pytest.raises(ValueError, match="no such mask") as caught:
        found(broken)
    cause = caught.value.__cause__
    assert isinstance(cause, KeyError)
    assert cause.__traceback__ is not None
    assert cause.__traceback__.tb_frame.f_code.co_name == "broken"


def test_an_interrupt_is_none_of_the_segmenters_faults() -> None:
    with pytest.raises(KeyboardInterrupt):
        found(interrupted)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("not.there.f", r"cannot import not\.there: ModuleNotFoundError: .*put the folder that"),
        (f"{HERE}.not_there", rf"the module {HERE} has no not_there; name a function"),
        (f"{HERE}.no_function", r"\.no_function is of type float; name a function"),
    ],
)
@pytest.mark.parametrize("make", [Pipeline, Segmenter, check_pipeline_config])
def test_a_segmenter_that_cannot_be_imported_is_found_at_once(
    make: Callable[[str], object], name: str, message: str
) -> None:
    with pytest.raises(ValueError, match=rf'segmenter = "python:{name}": .*{message}'):
        make(config(name))


@pytest.mark.parametrize("name", ["orakel", "python:", "python:find", "python:a-b.c", "a.b"])
@pytest.mark.parametrize("make", [Pipeline, Segmenter])
def test_a_segmenter_that_is_none_is_refused(make: Callable[[str], object], name: str) -> None:
    with pytest.raises(
        ValueError,
        match=rf'segmenter is "{name}"; expected one of .*`oracle`.* "python:module\.function"',
    ):
        make(json.dumps({"segmenter": name}))


def work(text: str) -> list[int]:
    """What a worker process does."""
    return [int(item.mask.sum()) for item in Segmenter(text).segment(**bare())]


def test_worker_processes_import_the_segmenter_themselves() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        [found] = pool.map(work, [config(by_depth)])
    assert found == [lid().sum()]
