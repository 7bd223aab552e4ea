"""Clouds over a surface of which every pixel is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from harness.completion.pictures import draw_panels, draw_scene, write_sheet
from harness.cubes import View
from harness.native import MeshTruth
from harness.surface_picture import (
    COMPLETED_COLOUR,
    GROUND,
    OBSERVED_COLOUR,
    SURFACE_GREY,
    Backdrop,
    Dots,
    two_sides,
)

if TYPE_CHECKING:
    from pathlib import Path

# A square of 0.2 m in the plane y = 0, 1 m before the viewer: 0.1 * 1.6 * 60 = 9.6 pixels from the
# middle to each side.
CORNERS = 0.1 * np.array([[-1.0, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
SQUARE = MeshTruth(CORNERS, np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32))
VIEW = View(np.array([0.0, -1.0, 0.0]), np.zeros(3), size=(80, 60))


def dot(x: float, y: float, z: float, colour: tuple[int, int, int] = COMPLETED_COLOUR) -> Dots:
    return Dots(np.array([[x, y, z]]), colour)


def test_rays_lead_to_the_points_that_project_there() -> None:
    rays = VIEW.rays()
    assert rays.shape == (60, 80, 3)
    points = VIEW.eye_world + 0.7 * rays
    np.testing.assert_allclose(VIEW.project(points)[20, 30], [30.5, 20.5])
    np.testing.assert_allclose(VIEW.depths(points), 0.7)


def test_a_surface_is_grey_on_the_ground() -> None:
    picture = Backdrop(SQUARE, VIEW).draw([Dots(np.zeros((0, 3)), COMPLETED_COLOUR)])
    assert (picture[21:39, 31:49] > SURFACE_GREY[0]).all()
    assert (picture[30, 40] >= SURFACE_GREY[1] - 1).all()
    outside = np.ones((60, 80), dtype=bool)
    outside[20:41, 30:51] = False
    assert (picture[outside] == GROUND).all()


@pytest.mark.parametrize(("y", "shown"), [(-0.01, True), (0.0015, True), (0.01, False)])
def test_a_point_well_behind_the_surface_is_hidden(y: float, *, shown: bool) -> None:
    picture = Backdrop(SQUARE, VIEW).draw([dot(0.0, y, 0.0)])
    assert (picture[30, 40] == COMPLETED_COLOUR).all() == shown


def test_the_nearer_point_is_on_top_and_one_beside_the_surface_shows() -> None:
    near, far = dot(0.0, -0.02, 0.0, OBSERVED_COLOUR), dot(0.0, -0.01, 0.0)
    for clouds in ([near, far], [far, near]):
        picture = Backdrop(SQUARE, VIEW).draw([*clouds, dot(0.3, 0.5, 0.0), dot(9.0, 0.0, 0.0)])
        assert (picture[30, 40] == OBSERVED_COLOUR).all()
        # At a depth of 1.5 m: 0.3 / 1.5 * 96 = 19.2 pixels to the right.
        assert (picture[30, 59] == COMPLETED_COLOUR).all()


def test_the_views_are_the_camera_s_side_and_the_one_behind() -> None:
    camera = np.array([0.0, -0.5, 0.4])
    front, back = two_sides(CORNERS, camera_world=camera, size=(80, 60))
    assert front.eye_world[1] < -0.3
    assert back.eye_world[1] > 0.3
    for view in (front, back):
        pixels = view.project(CORNERS)
        assert (pixels >= 0).all()
        assert (pixels <= (80, 60)).all()


def test_a_scene_has_a_line_for_each_completer(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    seen = random.uniform(-0.1, 0.1, size=(300, 3)) * (1, 0, 1)
    arguments = {
        "surface_world": CORNERS,
        "observed_world": seen,
        "camera_world": np.array([0.0, -1.0, 0.5]),
    }
    panels = draw_panels(SQUARE, clouds={"a": seen + 0.01, "b": seen}, size=(50, 40), **arguments)
    assert list(panels) == ["a", "b"]
    assert {picture.shape for pair in panels.values() for picture in pair} == {(40, 50, 3)}
    assert list(draw_panels(SQUARE, clouds={}, size=(50, 40), **arguments)) == ["observed"]
    paths = []
    for number in range(3):
        path = tmp_path / f"mug-{number:04d}.png"
        draw_scene(path, SQUARE, title=path.stem, clouds={"a": seen}, **arguments)
        paths.append(path)
    write_sheet(tmp_path / "sheet.png", paths)
    with Image.open(paths[0]) as one, Image.open(tmp_path / "sheet.png") as sheet:
        assert one.size == (720, 360)
        assert sheet.size == (1440, 720)
