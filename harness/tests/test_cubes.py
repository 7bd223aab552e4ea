"""Voxels in perspective, on scenes of which every pixel is known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from harness.cubes import BACKGROUND, BRIGHTNESS, View, draw_cubes

# From 1 m before the origin along y; at depth d, a metre is 1.6 * 30 / d = 48 / d pixels.
VIEW = View(np.array([0.0, -1.0, 0.0]), np.zeros(3), size=(40, 30))
RED, BLUE = (255, 0, 0), (0, 0, 255)


def draw(*cubes: tuple[tuple[float, float, float], tuple[int, int, int]]) -> np.ndarray:
    centres = np.array([centre for centre, _ in cubes], dtype=float).reshape(-1, 3)
    colours = np.array([colour for _, colour in cubes], dtype=np.uint8).reshape(-1, 3)
    return draw_cubes(centres, colours, size_m=0.1, view=VIEW)


def shaded(colour: tuple[int, int, int], *, axis: int) -> list[int]:
    return [int(value * BRIGHTNESS[axis]) for value in colour]


def test_the_focus_is_the_middle_and_up_is_up() -> None:
    points = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0, 0.1], [0.1, 1, 0]])
    expected = np.array([[20, 15], [24.8, 15], [20, 10.2], [22.4, 15]])
    assert_allclose(VIEW.project(points), expected)


def test_a_fitted_view_is_filled_up_to_its_margin() -> None:
    # 1 and 3 m away: slopes of -0.1 and 0.3 across, of -0.2 and 0.1 down. Of 32 x 24 free pixels
    # the width takes 32 / 0.4 = 80 a unit slope, the height 24 / 0.3 = 80.
    points = np.array([[-0.1, 0.0, 0.2], [0.9, 2.0, -0.3]])
    fitted = VIEW.fitted_to(points)
    assert fitted.focal * 30 == pytest.approx(80)
    assert_allclose(fitted.project(points), [[4, 3], [36, 27]])
    # Halved in height, the width still decides.
    fitted = VIEW.fitted_to(points * (1, 1, 0.5))
    assert_allclose(fitted.project(points * (1, 1, 0.5)), [[4, 9], [36, 21]])
    assert_allclose(VIEW.fitted_to(points[:1]).project(points[:1]), [[20, 15]])


def test_nothing_is_the_background() -> None:
    assert_array_equal(draw(), np.broadcast_to(BACKGROUND, (30, 40, 3)))


def test_a_cube_covers_the_pixels_of_its_face() -> None:
    picture = draw(((0.0, 0.0, 0.0), RED))
    # Its face is 0.95 m away: 0.05 * 48 / 0.95 = 2.53 pixels to either side of (20, 15).
    assert (picture[13:17, 18:22] == shaded(RED, axis=1)).all()
    outside = np.ones((30, 40), dtype=bool)
    outside[12:18, 17:23] = False
    assert (picture[outside] == BACKGROUND).all()


@pytest.mark.parametrize("near_first", [True, False])
def test_a_cube_in_front_hides_the_one_behind(*, near_first: bool) -> None:
    near, far = ((0.0, -0.1, 0.0), RED), ((0.0, 0.0, 0.0), BLUE)
    picture = draw(near, far) if near_first else draw(far, near)
    assert_array_equal(picture, draw(near))
    assert_array_equal(picture[15, 20], shaded(RED, axis=1))


def test_a_cube_beside_another_hides_nothing() -> None:
    picture = draw(((-0.2, 0.0, 0.0), BLUE), ((0.2, 0.0, 0.0), RED))
    # Their faces stand 0.2 * 48 / 0.95 = 10.1 pixels to either side of the middle.
    assert_array_equal(picture[15, 10], shaded(BLUE, axis=1))
    assert_array_equal(picture[15, 30], shaded(RED, axis=1))
    assert_array_equal(picture[15, 20], BACKGROUND)


def test_three_faces_are_seen_from_a_corner_each_in_its_shade() -> None:
    view = View(np.array([0.3, -0.3, 0.3]), np.zeros(3), size=(80, 60))
    grey = np.array([[200, 200, 200]], dtype=np.uint8)
    picture = draw_cubes(np.zeros((1, 3)), grey, size_m=0.1, view=view)
    shades = [int(200 * brightness) for brightness in BRIGHTNESS]
    assert min((picture == shade).all(axis=-1).sum() for shade in shades) > 20
    # The side x is on the right of the picture, the top above, the side y on the left.
    for shade, face in zip(shades, np.diag([0.05, -0.05, 0.05]), strict=True):
        u, v = view.project(face)
        assert_array_equal(picture[int(v), int(u)], [shade] * 3)
