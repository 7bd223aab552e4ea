"""What training pictures are made of: layouts, distractors, surfaces, lights."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

from sim_scenes.camera import d435_intrinsics
from sim_scenes.geometry import apply, inverse, look_at
from sim_scenes.pictures.distractors import KINDS, LARGEST_M, distractor, unwrap
from sim_scenes.pictures.layout import (
    CLEARANCE_M,
    Counts,
    Footprint,
    Layout,
    Standing,
    draw_counts,
    draw_layout,
    table_fills,
)
from sim_scenes.pictures.picture import draw_light, picture_intrinsics
from sim_scenes.pictures.surfaces import collage, floor_surface, object_surface, table_surface
from sim_scenes.world import TABLE_CENTRE_M, TABLE_HALF_M

if TYPE_CHECKING:
    from collections.abc import Iterator

Draw = Callable[[np.random.Generator], Any]
THINGS = [Footprint(0.03 + 0.02 * k, 0.05 + 0.03 * k) for k in range(7)]


def layouts(counts: Counts, number: int) -> Iterator[Layout]:
    for seed in range(number):
        layout = draw_layout(
            counts,
            objects=THINGS,
            distractors=THINGS[:5],
            intrinsics=picture_intrinsics(),
            random=np.random.default_rng(seed),
        )
        if layout is not None:
            yield layout


def test_shares_of_pictures_are_as_documented() -> None:
    random = np.random.default_rng(0)
    counts = [draw_counts(random) for _ in range(4000)]
    objects = np.array([item.objects for item in counts])
    # 4 standard deviations of a share of 4000 draws are at most 0.032.
    assert np.mean(objects == 0) == pytest.approx(0.03, abs=0.011)
    assert np.mean(objects == 1) == pytest.approx(0.4, abs=0.032)
    assert set(objects) == set(range(7))
    distracted = np.mean([item.distractors > 0 for item in counts if item.objects])
    assert distracted == pytest.approx(0.4, abs=0.032)
    assert {item.distractors for item in counts} == set(range(6))


def test_things_stand_apart_on_the_table_and_clear_of_the_lens() -> None:
    seen = 0
    for layout in layouts(Counts(6, 5), 60):
        circles = [
            *((THINGS[item.thing], np.array(item.place_m)) for item in layout.objects),
            *((THINGS[item.thing], np.array(item.place_m)) for item in layout.distractors),
        ]
        for (one, here), (two, there) in itertools.combinations(circles, 2):
            assert math.hypot(*(here - there)) >= one.radius_m + two.radius_m
        eye = layout.world_from_camera[:3, 3]
        for footprint, place in circles:
            assert (np.abs(place - TABLE_CENTRE_M[:2]) <= TABLE_HALF_M[:2]).all()
            beside = math.hypot(*(eye[:2] - place)) > footprint.radius_m + CLEARANCE_M
            assert beside or eye[2] > footprint.height_m + CLEARANCE_M
        for items in (layout.objects, layout.distractors):
            assert len({item.thing for item in items}) == len(items)
        seen += len(circles)
    assert seen > 200


def test_a_camera_is_nearly_upright_and_sees_a_single_object_most_often() -> None:
    camera = picture_intrinsics()
    middles = []
    for layout in layouts(Counts(1, 0), 200):
        pose = layout.world_from_camera
        # The image's right stays within a few standard deviations of the roll.
        assert abs(pose[2, 0]) < math.sin(math.radians(20))
        place = np.array([[*layout.objects[0].place_m, 0.03]])
        point = apply(inverse(pose), place)
        if point[0, 2] > 0:
            u, v = camera.project(point)[0]
            middles.append(0 <= u < camera.width and 0 <= v < camera.height)
    assert np.mean(middles) > 0.9


def test_an_empty_table_still_has_a_camera() -> None:
    layout = next(layouts(Counts(0, 0), 20))
    assert layout.objects == ()
    assert layout.distractors == ()


def test_a_standing_thing_is_turned_about_the_vertical() -> None:
    pose = Standing(0, (0.4, 0.1), math.pi / 2).world_from_thing
    np.testing.assert_allclose(apply(pose, np.array([[0.1, 0.0, 0.2]])), [[0.4, 0.2, 0.2]])


def test_the_table_fills_the_image_only_when_all_corners_end_on_it() -> None:
    camera = d435_intrinsics(width=320, height=240)

    def fills(eye: tuple[float, float, float], target: tuple[float, float, float]) -> bool:
        top = np.array([*TABLE_CENTRE_M[:2], 0.0])
        return table_fills(look_at(eye=top + eye, target=top + target), camera)

    assert fills((0.01, 0, 0.4), (0, 0, 0))
    assert not fills((0.01, 0.65, 0.4), (0, 0.65, 0))
    # The upper rays do not come down at all.
    assert not fills((-0.3, 0, 0.2), (0, 0, 0.2))


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_a_distractor_is_closed_and_of_the_size_it_should_be(kind: Draw) -> None:
    for seed in range(8):
        mesh = kind(np.random.default_rng(seed))
        parts = mesh.split(only_watertight=False)
        assert all(part.is_volume for part in parts)
        # A stack's blocks add up.
        assert 0.02 <= max(mesh.extents) <= 1.1 * LARGEST_M


def test_distractors_stand_on_the_table_with_normals_and_texture() -> None:
    random = np.random.default_rng(0)
    for _ in range(30):
        shape = distractor(random)
        low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
        np.testing.assert_allclose(low[2], 0, atol=1e-12)
        np.testing.assert_allclose((low + high)[:2], 0, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(shape.normals, axis=1), 1, atol=1e-6)
        assert (shape.uv >= 0).all()
        assert (shape.uv <= 1 + 1e-12).all()


def test_edges_are_shaded_sharp_and_curves_round() -> None:
    box = trimesh.creation.box(extents=[0.1, 0.1, 0.1])
    flat = unwrap(np.array(box.vertices), np.array(box.faces))
    assert np.allclose(np.abs(flat.normals).max(axis=1), 1)
    ball = trimesh.creation.icosphere(subdivisions=3)
    smooth = unwrap(np.array(ball.vertices), np.array(ball.faces))
    np.testing.assert_allclose(smooth.normals, smooth.vertices, atol=0.01)


@pytest.mark.parametrize("draw", [object_surface, table_surface, floor_surface, collage])
def test_a_surface_is_a_picture_that_its_stream_decides(draw: Draw) -> None:
    for seed in range(12):
        one, two = (draw(np.random.default_rng(seed)) for _ in range(2))
        assert one.dtype == np.uint8
        assert one.shape in {(256, 256, 3), (4, 4, 3)}
        np.testing.assert_array_equal(one, two)


def test_surfaces_reach_beyond_the_benchmarks() -> None:
    random = np.random.default_rng(0)
    tables = np.array([table_surface(random).mean(axis=(0, 1)) for _ in range(120)]) / 255
    value, chroma = tables.max(axis=1), np.ptp(tables, axis=1)
    # `sim_scenes.look` draws tables of value 0.3 to 0.9 and saturation up to 0.6.
    assert value.max() > 0.9
    assert value.min() < 0.3
    assert (chroma > 0.6 * value).any()


def test_lights_are_the_benchmarks_and_both_darker_and_brighter() -> None:
    random = np.random.default_rng(0)
    lights = [draw_light(random) for _ in range(300)]
    total = np.array([light.ambient + light.diffuse for light in lights])
    assert (total < 0.6).any()
    assert (total > 1.2).any()
    # The benchmark's own range.
    assert np.mean((total >= 0.85) & (total <= 1.1)) > 0.5
    assert all(math.isclose(math.hypot(*light.direction), 1) for light in lights)
