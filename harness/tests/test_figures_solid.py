"""Pictures in 3-D, of cameras, points and voxels of which every pixel is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from harness.cubes import View
from harness.figures.panels import Layout, picture_grid, scale_bar, show_picture
from harness.figures.solid import (
    FAINT_GREYS,
    PAPER,
    RIM,
    Window,
    best_view,
    camera_view,
    completed_points,
    completed_voxels,
    direction_to_cameras,
    draw_completed_map,
    draw_mesh,
    draw_spheres,
    draw_voxels,
    near_target,
    tint,
    view_from_behind,
    window_around,
)
from harness.figures.style import publication
from harness.figures.tracked import LabelBox, label_boxes, marker_place, spread_markers
from harness.pictures import CLASS_COLOURS
from harness.recordings.recording import RecordedView, RecordedVoxels
from harness.tests.fake_html_report import MISSED, job, recording

BLOCK = recording(job("mug", 0))
RED, BLUE = (255, 0, 0), (0, 0, 255)


def tilted() -> RecordedView:
    """A camera of 64 by 48 pixels that looks along -x, rolled by 90 degrees: its x axis is up."""
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([(0, 0, 1), (0, 1, 0), (-1, 0, 0)])
    pose[:3, 3] = (1.0, 0.2, 0.3)
    return replace(
        BLOCK.views[0],
        world_from_camera=pose,
        intrinsics=np.array([60.0, 60.0, 30.0, 20.0]),
    )


def pixel(view: RecordedView, point: np.ndarray) -> np.ndarray:
    fx, fy, cx, cy = view.intrinsics
    x, y, z = view.world_from_camera[:3, :3].T @ (point - view.world_from_camera[:3, 3])
    return np.array([fx * x / z + cx, fy * y / z + cy])


def test_a_tilted_cameras_pixels_fall_where_it_saw_them() -> None:
    shot = tilted()
    window = Window(left=10, top=6, right=50, bottom=36)
    for point in np.array([[0.0, 0.2, 0.3], [0.1, 0.4, 0.25], [-0.5, 0.1, 0.6]]):
        u, v = pixel(shot, point)
        whole = camera_view(shot, width_px=128)
        assert whole.size == (128, 96)
        # Twice as large; the centre of a recorded pixel is whole, that of a drawn one has a half.
        assert_allclose(whole.project(point), [2 * (u + 0.5), 2 * (v + 0.5)])
        part = camera_view(shot, window=window, width_px=40)
        assert part.size == (40, 30)
        assert_allclose(part.project(point), [u + 0.5 - 10, v + 0.5 - 6])


def test_a_window_holds_its_points_inside_the_image() -> None:
    shot = BLOCK.views[0]
    corners = BLOCK.target.vertices_world.astype(np.float64)
    window = window_around(shot, corners, aspect=4 / 3, margin=0.1)
    across, down = window.right - window.left, window.bottom - window.top
    assert abs(across / down - 4 / 3) < 0.1
    assert 0 <= window.left < window.right <= 64
    assert 0 <= window.top < window.bottom <= 48
    for point in corners:
        u, v = pixel(shot, point)
        if 0 <= u < 64 and 0 <= v < 48:
            assert window.left - 1 <= u <= window.right
            assert window.top - 1 <= v <= window.bottom
    assert window.of(shot.rgb).shape == (down, across, 3)
    everything = window_around(shot, corners, aspect=4 / 3, margin=9.0)
    assert everything == Window(0, 0, 64, 48)


def test_best_view_shows_most_of_the_target() -> None:
    first = BLOCK.views[0]
    less = replace(first, true_ids=np.where(np.arange(64) < 30, first.true_ids, 0))
    assert best_view(replace(BLOCK, views=(less, first, first))) is first


def test_near_spheres_cover_far_ones() -> None:
    # At 1 m, a metre is 1.6 * 60 = 96 pixels: a radius of 0.05 m is 4.8.
    view = View(np.array([0.0, -1.0, 0.0]), np.zeros(3), size=(80, 60))
    paper = np.full((60, 80, 3), PAPER, dtype=np.uint8)
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.5, 0.0]])
    for order in ([0, 1], [1, 0]):
        colours = np.array([RED, BLUE], dtype=np.uint8)[order]
        picture = draw_spheres(points[order], colours, radius_m=0.05, view=view, over=paper)
        assert_array_equal(picture[30, 40], RED)
        assert_array_equal(picture[30, 50], PAPER)
        # The outline's pixel is a fifth paper.
        assert picture[30, 35, 0] < 0.8 * 255 * RIM + 0.2 * 255 + 20, "an outline is darker"


def test_meshes_are_faint_on_paper() -> None:
    view = view_from_behind(BLOCK, size=(60, 60))
    picture = draw_mesh(BLOCK.objects, view=view)
    assert_array_equal(picture[0, 0], PAPER)
    low, high = FAINT_GREYS
    assert low <= picture[30, 30].min() <= picture[30, 30].max() <= high


def test_behind_is_away_from_the_cameras_and_where_a_target_is_widest() -> None:
    # Cameras along +x; the target is long in the direction of 40 degrees from x, so that it looks
    # widest from -50 degrees or 130: of the turns behind, 140 is the nearest.
    eye = np.eye(4)
    eye[:3, 3] = (1.0, 0.0, 0.5)
    angle = np.deg2rad(40.0)
    rod = 0.1 * np.array([np.cos(angle), np.sin(angle), 0.0]) * np.array([[-1.0], [0.5], [1.0]])
    target = replace(
        BLOCK.target,
        vertices_world=rod.astype(np.float32),
        faces=np.array([[0, 1, 2]], dtype=np.int32),
    )
    scene = replace(
        BLOCK,
        views=(replace(BLOCK.views[0], world_from_camera=eye),),
        objects=(target,),
        target_id=None,
    )
    towards = direction_to_cameras(scene, np.zeros(3))
    assert_allclose(np.arctan2(towards[1], towards[0]), 0.0, atol=1e-12)
    assert_allclose(np.linalg.norm(towards), 1.0)
    view = view_from_behind(scene, size=(60, 60))
    offset = view.eye_world - view.focus_world
    assert np.rad2deg(np.arctan2(offset[1], offset[0])) == pytest.approx(140.0, abs=1e-3)


def test_completed_voxels_are_those_that_the_map_leaves_free() -> None:
    mapped = RecordedVoxels(
        size_m=0.01,
        centres_world=np.array([[0.005, 0.005, 0.005], [0.025, 0.005, 0.005]], dtype=np.float32),
        rgb=np.zeros((2, 3), np.uint8),
        classes=np.array([6, 0], np.uint8),
        object_ids=np.array([1, 0], np.uint32),
        confidence=np.zeros(2, np.float32),
        first_view=np.zeros(2, np.uint8),
    )
    points = np.array([[0.001, 0.002, 0.003], [0.012, 0.0, 0.0], [0.019, 0.009, 0.0]])
    onto_table = np.array([[0.021, 0.001, 0.001]])
    found = completed_voxels(np.concatenate([points, onto_table]).astype(np.float32), mapped)
    # The first is the mug's already; the next two share one voxel; the table's is taken over.
    assert_allclose(found, [[0.015, 0.005, 0.005], [0.025, 0.005, 0.005]])


def test_a_completion_is_pale_in_the_map() -> None:
    near = near_target(BLOCK)
    assert 0 < len(near.voxels.classes) <= len(BLOCK.voxels.classes)
    view = view_from_behind(near, size=(90, 90), with_map=True)
    plain, completed = draw_voxels(near.voxels, view=view), draw_completed_map(near, view=view)
    mug, pale = np.array(CLASS_COLOURS["mug"]), tint(CLASS_COLOURS["mug"])
    assert (plain == mug).all(axis=2).any()
    assert not (plain == pale).all(axis=2).any()
    assert (completed == pale).all(axis=2).any()


def test_completed_points_are_found_where_there_are_any() -> None:
    assert completed_points(BLOCK) == slice(8, 16)
    assert completed_points(replace(BLOCK, test_sets=BLOCK.test_sets[:1])) is None
    missed = job("bowl", 4)
    assert missed.scene_id == MISSED
    assert completed_points(recording(missed)) is None


def test_scale_bar_is_as_long_as_it_says() -> None:
    # At 1 m, a metre is 1.6 * 60 = 96 pixels: of 80 pixels a quarter holds 20 cm.
    view = View(np.array([0.0, -1.0, 0.0]), np.zeros(3), size=(80, 60))
    with publication():
        grid = picture_grid(1, 1, layout=Layout(width=2.0, aspect=4 / 3))
        (axes,) = grid.axes[0]
        show_picture(axes, np.zeros((60, 80, 3), np.uint8))
        scale_bar(axes, view=view, at_world=np.zeros(3))
    (bar,) = axes.lines
    ends = np.asarray(bar.get_xdata(), dtype=np.float64)
    assert [text.get_text() for text in axes.texts] == ["20 cm"]
    assert ends[1] - ends[0] == pytest.approx(0.2 * 96)


def test_panels_have_their_size_in_print() -> None:
    layout = Layout(width=3.5, aspect=2.0, left=0.25, right=0.25, gap=0.5, top=0.2, under=0.1)
    grid = picture_grid(2, 3, layout=layout)
    # (3.5 - 0.5 - 2 * 0.5) / 3 inches wide, half as high, at 300 pixels to the inch.
    assert grid.panel_px == (200, 100)
    assert grid.figure.get_figwidth() == 3.5
    assert grid.figure.get_figheight() == pytest.approx(0.2 + 2 * (1 / 3 + 0.1) + 0.02)


def test_names_are_spread_until_none_hides_another() -> None:
    view = View(np.array([0.0, -1.0, 0.3]), np.zeros(3), size=(500, 480))
    places = np.array([[0.0, 0.0, 0.1], [0.01, 0.1, 0.1], [0.3, 0.0, 0.1]])
    names = ["#1 mug", "#2 mug", "#3 bowl"]
    shown = np.array([[-0.3, -0.1, 0.0], [0.4, 0.2, 0.0]])

    def boxes(markers: np.ndarray, seen: View) -> list[LabelBox]:
        return label_boxes(markers, names=names, view=seen, radius_m=0.01)

    first, second, third = boxes(places, view.fitted_to(shown))
    assert first.meets(second)
    assert not first.meets(third)
    markers, fitted = spread_markers(
        places, names=names, shown_world=shown, view=view, radius_m=0.01
    )
    first, second, third = boxes(markers, fitted)
    assert not (first.meets(second))
    assert not (first.meets(third))
    assert not (second.meets(third))
    assert_array_equal(markers[:, :2], places[:, :2])
    assert_array_equal(markers[2], places[2])
    assert (markers[:, 2] >= places[:, 2]).all()
    for box in (first, second, third):
        assert 0 <= box.top < box.bottom <= 480


def test_a_marker_stands_clear_of_its_object() -> None:
    (cloud,) = BLOCK.tracked
    points = cloud.observed_world.astype(np.float64)
    place = marker_place(cloud)
    assert_array_equal(place[:2], cloud.centroid_world[:2])
    # 3 cm and 0.35 of 10 cm over its highest point.
    assert place[2] == pytest.approx(points[:, 2].max() + 0.03 + 0.035)
