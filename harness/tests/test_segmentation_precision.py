"""Average precision: pycocotools' own, by hand where that can be done, and of resamples."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pycocotools.cocoeval import COCOeval

from harness.segmentation.precision import (
    HALF,
    LEAST_OVERLAPS,
    RECALLS,
    THREE_QUARTERS,
    _datasets,
    average_precision,
    judge,
)
from harness.segmentation.resampling import Resamples
from harness.tests.fake_segmentation import found, truth

if TYPE_CHECKING:
    from harness.segmentation.rows import Found, Truth

    Frames = list[tuple[list[Truth], list[Found]]]

CATEGORIES = ("mug", "bowl", "can")


def random_frames(seed: int, *, count: int = 12, ties: bool = True) -> Frames:
    random = np.random.default_rng(seed)
    frames: Frames = []
    for _ in range(count):
        truths, seen = [], []
        for left in (0, 11, 22):
            category = str(random.choice(CATEGORIES))
            if random.random() < 0.8:
                truths.append(truth(left, category, ignored=bool(random.random() < 0.2)))
            for _ in range(int(random.integers(0, 3))):
                name = category if random.random() < 0.8 else str(random.choice(CATEGORIES))
                score = float(random.integers(1, 11)) / 10 if ties else float(random.random())
                seen.append(found(left + int(random.integers(0, 3)), name, score=score))
        frames.append((truths, seen))
    return frames


def by_pycocotools(frames: Frames) -> np.ndarray:
    """Average precision (categories, overlaps), NaN where undefined."""
    with redirect_stdout(io.StringIO()):
        evaluation = COCOeval(*_datasets(frames), iouType="segm")
        evaluation.evaluate()
        evaluation.accumulate()
    precision = evaluation.eval["precision"][:, :, :, 0, -1]
    return np.where(precision[:, 0] < 0, np.nan, precision.mean(axis=1)).T


def ours(frames: Frames, weights: np.ndarray) -> np.ndarray:
    return np.stack([average_precision(of, weights) for of in judge(frames)])


@pytest.mark.parametrize("seed", range(5))
def test_it_is_what_pycocotools_accumulates(seed: int) -> None:
    frames = random_frames(seed)
    assert_allclose(ours(frames, np.ones((1, len(frames))))[:, 0], by_pycocotools(frames))


@pytest.mark.parametrize("seed", range(3))
def test_a_frame_of_weight_two_is_one_that_is_there_twice(seed: int) -> None:
    # Which of a frame's equal scores comes first is of no meaning, and differs.
    frames = random_frames(seed, ties=False)
    weights = np.random.default_rng(seed).integers(0, 3, size=len(frames))
    drawn = [frame for frame, times in zip(frames, weights, strict=True) for _ in range(times)]
    assert_allclose(
        ours(frames, weights[None].astype(float))[:, 0], by_pycocotools(drawn), rtol=1e-12
    )


def test_it_is_the_mean_of_the_best_precisions_at_101_recalls() -> None:
    # By falling score right, wrong, right: of three objects two are found.
    frames: Frames = [
        ([truth(4)], [found(4, score=0.9)]),
        ([truth(4)], [found(4, "mug", score=0.7), found(20, "mug", score=0.8)]),
        ([truth(4)], []),
    ]
    mug = judge(frames)[-1]
    assert mug.category == "mug"
    expected = np.where(RECALLS <= 1 / 3, 1.0, np.where(RECALLS <= 2 / 3, 2 / 3, 0.0)).mean()
    assert_allclose(average_precision(mug, np.ones((1, 3))), expected)


def test_an_overlap_of_three_quarters_counts_up_to_it() -> None:
    # 7 of 9 columns are shared: .78.
    values = ours([([truth(4)], [found(5)])], np.ones((1, 1)))[-1, 0]
    assert_allclose(values, (LEAST_OVERLAPS < 7 / 9).astype(float))
    assert values[[HALF, THREE_QUARTERS]] == pytest.approx(1)


def test_without_detections_it_is_nought_and_without_objects_undefined() -> None:
    nothing_found = ours([([truth(4)], [])], np.ones((1, 1)))[:, 0, HALF]
    assert_allclose(nothing_found, [np.nan] * 5 + [0.0])
    nothing_there = ours([([], [found(4)]), ([], [])], np.ones((1, 2)))
    assert np.isnan(nothing_there).all()


def test_a_draw_takes_objects_with_all_that_is_theirs() -> None:
    objects = ["a", "a", "b", "c", "c", "c"]
    draws = Resamples.draw(objects, seed=3, resamples=50)
    assert draws.objects == 3
    assert_allclose(draws.weights[0], 1)
    for times in draws.weights:
        by_object = [{times[place] for place in places} for places in ((0, 1), (2,), (3, 4, 5))]
        assert all(len(values) == 1 for values in by_object)
        assert sum(values.pop() for values in by_object) == 3
    assert_allclose(Resamples.draw(objects, seed=3, resamples=50).weights, draws.weights)


def test_few_objects_or_an_undefined_value_have_no_interval() -> None:
    values = np.linspace(0, 1, 101)
    few = Resamples.draw(list("abcd"), seed=0, resamples=100).estimate(values, count=7)
    assert (few.mean, few.low, few.high, few.count) == (0.0, None, None, 7)
    draws = Resamples.draw(list("abcde"), seed=0, resamples=100)
    enough = draws.estimate(values, count=7)
    assert (enough.low, enough.high) == pytest.approx((0.03475, 0.97525))
    assert draws.estimate(values, count=7, objects=4).low is None
    undefined = draws.estimate(np.full(101, np.nan), count=7)
    assert (undefined.mean, undefined.count) == (None, 0)
