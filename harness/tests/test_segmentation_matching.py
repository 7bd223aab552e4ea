"""Which detection is of which object, worked out by hand on small masks."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from harness.segmentation.masks import box, decode, encode, overlaps, pixels
from harness.segmentation.matching import match
from harness.tests.fake_segmentation import SIZE, found, mask, truth


def test_a_mask_comes_back_as_it_was_encoded() -> None:
    random = np.random.default_rng(0)
    for share in (0.0, 0.3, 1.0):
        pixels_set = random.random(SIZE) < share
        encoded = encode(pixels_set)
        assert_array_equal(decode(encoded), pixels_set)
        assert pixels(encoded) == pixels_set.sum()
    assert box(encode(mask(5, 8, top=4, height=10))) == [5, 4, 8, 10]


def test_overlaps_are_shares_of_the_union_or_of_the_find_where_ignored() -> None:
    true = [encode(mask(4)), encode(mask(4, 16))]
    seen = [encode(mask(4)), encode(mask(8))]
    of_union = np.array([[1, 8 / 16], [4 / 12, 8 / 16]])
    assert_allclose(overlaps(seen, true, ignored=[False, False]), of_union)
    of_find = np.array([[1, 1], [4 / 12, 1]])
    assert_allclose(overlaps(seen, true, ignored=[False, True]), of_find)
    assert overlaps([], true, ignored=[False, False]).shape == (0, 2)
    assert overlaps(seen, [], ignored=[]).shape == (2, 0)


def test_the_surest_detection_takes_an_object_and_a_second_of_it_is_wrong() -> None:
    matched = match([truth(4)], [found(5, score=0.6), found(6, score=0.8)])
    assert [pair.found.score for pair in matched.pairs] == [0.8, 0.6]
    assert [pair.right for pair in matched.pairs] == [True, False]
    assert matched.pairs[0].iou == pytest.approx(6 / 10)
    assert matched.missed == ()


def test_half_an_overlap_is_enough_and_less_is_not() -> None:
    # Of 8 columns 5 1/3 shared are a half of the union: 6 are enough, 5 are not.
    assert match([truth(4)], [found(6)]).hits
    matched = match([truth(4)], [found(7)])
    assert (len(matched.wrong), len(matched.missed)) == (1, 1)


def test_the_category_counts_unless_it_is_not_asked_for() -> None:
    truths, seen = [truth(4, "mug")], [found(4, "bowl")]
    assert match(truths, seen).hits == ()
    (pair,) = match(truths, seen, by_category=False).hits
    assert (pair.found.category, pair.truth) == ("bowl", truths[0])


def test_a_detection_of_what_hardly_shows_is_neither_right_nor_wrong() -> None:
    matched = match([truth(4, ignored=True)], [found(5), found(5, "can")])
    assert [(pair.right, pair.ignored) for pair in matched.pairs] == [(False, True), (False, False)]
    assert matched.missed == ()
    # An object that counts goes before one that does not.
    both = match([truth(4, width=10, ignored=True), truth(6)], [found(5)])
    assert both.hits[0].truth == truth(6)


def test_unsure_detections_are_left_out() -> None:
    assert match([truth(4)], [found(4, score=0.49)], least_score=0.5).pairs == ()
    assert match([truth(4)], [found(4, score=0.5)], least_score=0.5).hits


def test_the_quality_of_a_frame_weighs_overlaps_against_what_is_unmatched() -> None:
    truths = [truth(0), truth(10), truth(20)]
    matched = match(truths, [found(1), found(10), found(14, "can")])
    assert matched.quality == pytest.approx((7 / 9 + 1) / (2 + 0.5 + 0.5))
    assert match(truths, []).quality == 0.0
    assert match([], []).quality is None
    assert match([truth(4, ignored=True)], [found(4)]).quality is None
