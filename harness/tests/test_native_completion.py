"""Completions as Python sees them, and completers that are Python functions."""

from __future__ import annotations

import json
import multiprocessing
import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from harness.native import Completion, Pipeline, check_pipeline_config, nearest_observation
from harness.tests.support import HEIGHT, LOOKING_DOWN, WIDTH, frame

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import numpy.typing as npt

    from harness.native import CompleterFunction

    Floats = npt.NDArray[np.float64]

HERE = "harness.tests.test_native_completion"
Answer = list[tuple[np.ndarray, np.ndarray | None] | None]


def measured(
    depth_m: npt.NDArray[np.float32],
    intrinsics: tuple[float, float, float, float],
    mask: npt.NDArray[np.bool_],
) -> Floats:
    """Points that an image measures on an object, camera frame."""
    fx, fy, cx, cy = intrinsics
    v, u = np.nonzero(mask & np.isfinite(depth_m))
    z = depth_m[v, u].astype(np.float64)
    return np.stack([(u - cx) / fx * z, (v - cy) / fy * z, z], axis=1)


def mirrored(
    *,
    rgb: npt.NDArray[np.uint8],
    depth_m: npt.NDArray[np.float32],
    intrinsics: tuple[float, float, float, float],
    world_from_camera: Floats,
    masks: npt.NDArray[np.bool_],
    categories: list[str],
) -> list[tuple[Floats, Floats | None] | None]:
    """Complete objects as if their far side was the mirror image of the near one.

    The mirror is upright, faces the camera and stands 3 cm behind what was seen.
    """
    rotation = world_from_camera[:3, :3]
    up = rotation.T @ [0.0, 0.0, 1.0]
    away = np.array([0.0, 0.0, 1.0]) - up[2] * up
    if np.linalg.norm(away) < 1e-6:  # A camera that looks straight down.
        away = np.array([0.0, 1.0, 0.0])
    away /= np.linalg.norm(away)
    answers: list[tuple[Floats, Floats | None] | None] = []
    for mask in masks:
        seen = measured(depth_m, intrinsics, mask)
        if len(seen) == 0:
            answers.append(None)
            continue
        distance = seen @ away
        mirror = distance.max() + 0.03
        unseen = seen + 2 * (mirror - distance)[:, None] * away
        spread_m = np.repeat([0.001, 0.01], len(seen))
        answers.append((np.concatenate([seen, unseen]), spread_m))
    return answers


def plain(**frame: Any) -> Answer:
    return [(np.array([[0.0, 0.0, 0.45], [0.01, 0.0, 0.45]]), None) for _ in frame["masks"]]


def nothing(**frame: Any) -> Answer:
    return [None for _ in frame["masks"]]


def threaded(**frame: Any) -> Answer:
    """Let another thread work, and the extension."""
    answers: Answer = []
    thread = threading.Thread(target=lambda: answers.extend(plain(**frame)))
    thread.start()
    thread.join()
    points = next(answer[0] for answer in answers if answer is not None)
    assert nearest_observation(points=points, observed=points).tolist() == [0, 0]
    return answers


def broken(**frame: Any) -> Answer:
    raise KeyError("no such shape")


def interrupted(**frame: Any) -> Answer:
    raise KeyboardInterrupt


def forgetful(**frame: Any) -> Answer:
    return []


def dict_of(**frame: Any) -> Any:
    return {"points": 1}


def number(**frame: Any) -> Any:
    return [7]


def flat(**frame: Any) -> Answer:
    return [(np.zeros(3), None)]


def single_precision(**frame: Any) -> Answer:
    return [(np.zeros((2, 3), dtype=np.float32), None)]


def infinite(**frame: Any) -> Answer:
    return [(np.array([[0.0, np.inf, 0.0]]), None)]


def empty(**frame: Any) -> Answer:
    return [(np.zeros((0, 3)), None)]


def short_spread(**frame: Any) -> Answer:
    return [(np.zeros((2, 3)), np.zeros(1))]


def negative_spread(**frame: Any) -> Answer:
    return [(np.zeros((2, 3)), np.array([0.0, -1.0]))]


def listed(**frame: Any) -> Any:
    return [([[0.0, 0.0, 0.0]], None)]


no_function = 3.0

calls: list[dict[str, Any]] = []


def recorded(**frame: Any) -> Answer:
    calls.append(frame)
    return plain(**frame)


def config(function: Callable[..., object] | str, **completion: Any) -> str:
    name = function if isinstance(function, str) else f"{HERE}.{function.__name__}"
    settings = {"refine": False} | completion
    return json.dumps(
        {"segmenter": "oracle", "completer": f"python:{name}", "completion": settings}
    )


def mapped(function: Callable[..., object], **completion: Any) -> Pipeline:
    pipeline = Pipeline(config(function, **completion))
    assert pipeline.add_frame(**frame()) == [1]
    return pipeline


def completed(pipeline: Pipeline, object_id: int = 1) -> Completion:
    completion = pipeline.completion(object_id)
    assert completion is not None
    return completion


def as_is(completion: Completion) -> tuple[bytes, bytes]:
    return completion.points_world.tobytes(), completion.spread_m.tobytes()


def test_a_python_function_completes_objects() -> None:
    function: CompleterFunction = mirrored
    pipeline = mapped(function)
    assert pipeline.completer == f"python:{HERE}.mirrored"
    completion = completed(pipeline)
    observed = pipeline.objects()[0].points_world
    n = 2 * len(observed)
    assert completion.points_world.shape == (n, 3)
    assert completion.category == "mug"
    assert completion.score == 1
    assert pipeline.uncompleted(1) is None
    # Seen from above, the mirror stands 3 cm beside the lid's edge, in the camera's y.
    edge = observed[:, 1].min() - 0.03
    unseen = observed * [1, -1, 1] + [0, 2 * edge, 0]
    expected = np.concatenate([observed, unseen])
    order = np.lexsort(completion.points_world.round(9).T)
    assert np.allclose(
        completion.points_world[order], expected[np.lexsort(expected.round(9).T)], atol=1e-7
    )
    seen = completion.points_world[:, 1] > edge
    assert np.array_equal(completion.spread_m, np.where(seen, 0.001, 0.01))
    assert np.allclose(completion.confidence, 1 - np.exp(-0.005 / completion.spread_m))
    # An even prefix holds as many of one half as of the other.
    assert abs(seen[:40].sum() - 20) < 8


def test_points_are_cut_at_the_configured_number() -> None:
    whole = completed(mapped(mirrored))
    cut = completed(mapped(mirrored, points=100))
    assert np.array_equal(cut.points_world, whole.points_world[:100])
    assert np.array_equal(cut.spread_m, whole.spread_m[:100])


def test_a_completer_gets_what_the_protocol_says() -> None:
    calls.clear()
    arguments = frame()
    arguments["depth_m"][0, 0] = np.nan
    Pipeline(config(recorded)).add_frame(**arguments)
    [call] = calls
    assert set(call) == {
        "rgb",
        "depth_m",
        "intrinsics",
        "world_from_camera",
        "masks",
        "categories",
    }
    assert call["rgb"].dtype == np.uint8
    assert call["rgb"].shape == (HEIGHT, WIDTH, 3)
    assert call["depth_m"].dtype == np.float32
    assert np.array_equal(call["depth_m"], arguments["depth_m"], equal_nan=True)
    assert call["intrinsics"] == arguments["intrinsics"]
    assert np.array_equal(call["world_from_camera"], LOOKING_DOWN)
    assert call["masks"].dtype == np.bool_
    assert np.array_equal(call["masks"], [arguments["instance_ids"] == 1])
    assert call["categories"] == ["mug"]


def test_a_frame_without_objects_asks_no_completer() -> None:
    calls.clear()
    blank = np.zeros((HEIGHT, WIDTH), dtype=np.uint16)
    assert Pipeline(config(recorded)).add_frame(**frame(instance_ids=blank)) == []
    assert calls == []


def test_no_spread_claims_no_doubt() -> None:
    completion = completed(mapped(plain))
    assert completion.spread_m.tolist() == [0, 0]
    assert completion.confidence.tolist() == [1, 1]


def test_an_object_that_is_not_completed_says_why() -> None:
    pipeline = mapped(nothing)
    assert pipeline.completion(1) is None
    assert pipeline.view_completions(1) == []
    assert pipeline.uncompleted(1) == f"python:{HERE}.nothing returned None for it"
    without = Pipeline('{"segmenter": "oracle", "completer": "none"}')
    without.add_frame(**frame())
    assert without.completer == "none"
    assert without.completion(1) is None
    reason = without.uncompleted(1)
    assert reason is not None
    assert "no completer is chosen" in reason
    for ask in (without.completion, without.uncompleted, without.view_completions):
        with pytest.raises(ValueError, match="there is no object 9"):
            ask(9)


def test_other_threads_and_the_extension_work_within_a_completer() -> None:
    assert len(completed(mapped(threaded)).points_world) == 2


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (broken, "raised KeyError: 'no such shape'; mend it"),
        (forgetful, "it has 0 entries; 1 instances need one each, None for those"),
        (dict_of, "it is of type dict; return a list"),
        (number, r"entry 0 is of type int; make it None or a tuple \(points_camera, spread_m\)"),
        (flat, r"points_camera of entry 0 has shape \(3,\); expected \(n, 3\)"),
        (single_precision, "points_camera of entry 0 has dtype float32; expected float64"),
        (infinite, r"points_camera of entry 0\[0\] is not finite"),
        (empty, "points_camera of entry 0 holds no point; return None"),
        (short_spread, r"spread_m of entry 0 has shape \(1,\); expected \(2,\)"),
        (negative_spread, "spread_m of entry 0 holds -1; spreads are metres, finite and not neg"),
        (listed, "points_camera of entry 0 is of type list; expected a numpy array"),
    ],
)
def test_a_completer_that_breaks_its_promise_is_named(
    function: Callable[..., object], message: str
) -> None:
    pipeline = Pipeline(config(function))
    with pytest.raises(
        ValueError, match=rf"the completer python:{HERE}\.{function.__name__} .*{message}"
    ) as caught:
        pipeline.add_frame(**frame())
    assert isinstance(caught.value.__cause__, Exception)
    assert pipeline.objects() == []


def test_an_exceptions_own_traceback_is_kept() -> None:
    with pytest.raises(ValueError, match="no such shape") as caught:
        Pipeline(config(broken)).add_frame(**frame())
    cause = caught.value.__cause__
    assert isinstance(cause, KeyError)
    assert cause.__traceback__ is not None
    assert cause.__traceback__.tb_frame.f_code.co_name == "broken"


def test_an_interrupt_is_none_of_the_completers_faults() -> None:
    with pytest.raises(KeyboardInterrupt):
        Pipeline(config(interrupted)).add_frame(**frame())


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("not.there.f", r"cannot import not\.there: ModuleNotFoundError: .*put the folder that"),
        (f"{HERE}.not_there", rf"the module {HERE} has no not_there; name a function"),
        (f"{HERE}.no_function", r"\.no_function is of type float; name a function"),
    ],
)
@pytest.mark.parametrize("make", [Pipeline, check_pipeline_config])
def test_a_completer_that_cannot_be_imported_is_found_at_once(
    make: Callable[[str], object], name: str, message: str
) -> None:
    with pytest.raises(ValueError, match=rf'completer = "python:{name}": .*{message}'):
        make(config(name))


@pytest.mark.parametrize("name", ["clod", "python:", "python:complete", "python:a-b.c", "a.b"])
def test_a_completer_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(
        ValueError,
        match=rf'completer is "{name}"; expected one of `none`.* "python:module\.function"',
    ):
        Pipeline(json.dumps({"completer": name}))


def test_each_views_completion_and_its_registration() -> None:
    pipeline = mapped(mirrored, refine=True)
    moved = LOOKING_DOWN.copy()
    moved[0, 3] = 0.01
    pipeline.add_frame(**frame(world_from_camera=moved, instance_ids=shifted()))
    views = pipeline.view_completions(1)
    assert len(views) == 2
    for view in views:
        assert view.residual_before_m is not None
        assert view.residual_after_m is not None
        assert 0 <= view.residual_after_m <= view.residual_before_m < 0.001
    fused = completed(pipeline)
    assert fused.residual_before_m is None
    assert fused.residual_after_m is None
    stages = [stage for stage, _, _ in pipeline.timings()]
    assert stages == ["segment", "complete", "refine", "map", "fuse"]


def shifted() -> npt.NDArray[np.uint16]:
    """The lid's mask seen from 1 cm to the right: 1.33 pixels to the left."""
    instance_ids = np.zeros((HEIGHT, WIDTH), dtype=np.uint16)
    instance_ids[16:32, 19:43] = 1
    return instance_ids


def test_an_object_without_depth_is_not_mapped_and_one_at_the_border_is_completed() -> None:
    arguments = frame()
    arguments["depth_m"][arguments["instance_ids"] == 1] = np.nan
    assert Pipeline(config(mirrored, refine=True)).add_frame(**arguments) == [None]
    cut = np.roll(frame()["instance_ids"], 24, axis=1)
    cut[:, :10] = 0
    assert cut[:, -1].any()
    depth_m = np.where(cut == 1, 0.45, 0.5).astype(np.float32)
    pipeline = Pipeline(config(mirrored, refine=True))
    assert pipeline.add_frame(**frame(instance_ids=cut, depth_m=depth_m)) == [1]
    assert len(completed(pipeline).points_world) == 2 * cut.sum()


def test_the_file_holds_points_and_spreads(tmp_path: Path) -> None:
    completion = completed(mapped(mirrored))
    path = tmp_path / "mug.ply"
    completion.write_ply(path)
    header, _, data = path.read_bytes().partition(b"end_header\n")
    assert b"property double z\nproperty double spread\n" in header
    rows = np.frombuffer(data, dtype="<f8").reshape(-1, 4)
    assert np.array_equal(rows[:, :3], completion.points_world)
    assert np.array_equal(rows[:, 3], completion.spread_m)
    with pytest.raises(OSError, match="nowhere"):
        completion.write_ply(tmp_path / "nowhere" / "mug.ply")


def work(text: str) -> tuple[bytes, bytes]:
    """What a worker process does."""
    pipeline = Pipeline(text)
    pipeline.add_frame(**frame())
    return as_is(completed(pipeline))


def test_worker_processes_import_the_completer_themselves() -> None:
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        [found] = pool.map(work, [config(mirrored)])
    assert found == as_is(completed(mapped(mirrored)))
