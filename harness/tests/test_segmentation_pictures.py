"""Instances over an image: where their colours, outlines and labels are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.testing import assert_array_equal
from PIL import Image

from harness.pictures import CLASS_COLOURS
from harness.segmentation.pictures import Instance, draw_instances, write_sheet

if TYPE_CHECKING:
    from pathlib import Path

IMAGE = np.full((240, 320, 3), 100, dtype=np.uint8)


def square(left: int, top: int, *, side: int = 60) -> np.ndarray:
    pixels = np.zeros(IMAGE.shape[:2], dtype=bool)
    pixels[top : top + side, left : left + side] = True
    return pixels


def test_a_mask_is_tinted_and_rimmed_in_its_category_s_colour() -> None:
    inside = square(40, 120)
    picture = draw_instances(IMAGE, [Instance(inside, "mug", 0.9)])
    colour = np.array(CLASS_COLOURS["mug"])
    assert_array_equal(picture[120, 40:100], np.tile(colour, (60, 1)))
    assert_array_equal(picture[150, 70], (0.55 * 100 + 0.45 * colour).astype(int))
    assert_array_equal(picture[200:, :], IMAGE[200:, :])
    assert_array_equal(draw_instances(IMAGE, []), IMAGE)


def test_true_outlines_are_white_and_lie_over_the_masks() -> None:
    mask = square(40, 120)
    picture = draw_instances(IMAGE, [Instance(mask, "can", 0.9)], true_masks=[mask])
    assert (picture[120:180, 40] == 255).all()
    assert (picture[150, 70] != 255).any()


def test_labels_stand_above_what_they_name_and_cover_no_other() -> None:
    colours = {name: np.array(CLASS_COLOURS[name]) for name in ("mug", "bowl")}
    masks = (square(40, 120), square(42, 122))
    picture = draw_instances(
        IMAGE, [Instance(masks[0], "mug", 0.9), Instance(masks[1], "bowl", 0.8)]
    )
    rows = {
        name: np.flatnonzero((picture[:120] == colour).all(axis=2).sum(axis=1) > 20)
        for name, colour in colours.items()
    }
    assert rows["mug"].size > 8
    assert rows["mug"].max() < 122
    # The second label, which would cover the first, stands below it, within the masks.
    assert not set(rows["mug"]) & set(rows["bowl"])
    below = (picture[120:160] == colours["bowl"]).all(axis=2).sum(axis=1)
    assert (below > 20).any()


def test_labels_at_the_border_stay_in_the_picture() -> None:
    for left, top in ((0, 0), (260, 180)):
        picture = draw_instances(IMAGE, [Instance(square(left, top), "laptop", 1.0)])
        colour = (picture == np.array(CLASS_COLOURS["laptop"])).all(axis=2)
        assert colour.sum() > 400
    nothing = Instance(np.zeros(IMAGE.shape[:2], dtype=bool), "mug", 0.5)
    assert_array_equal(draw_instances(IMAGE, [nothing]), IMAGE)


def test_a_sheet_has_a_row_for_each_kind(tmp_path: Path) -> None:
    write_sheet(tmp_path / "sheet.png", [[(IMAGE, "best")] * 3, [(IMAGE, "worst")] * 2])
    with Image.open(tmp_path / "sheet.png") as sheet:
        assert sheet.size == (3 * 480, 2 * 360)
        assert np.asarray(sheet)[-10:, -10:].min() == 255
