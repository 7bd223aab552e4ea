from __future__ import annotations

import functools
import importlib
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from sim_scenes.objects.camera import BALANCE, balanced_length
from sim_scenes.objects.draws import Split, stream
from sim_scenes.objects.finish import position_merged

if TYPE_CHECKING:
    from sim_scenes.objects.part import Floats

DRAWS = 8
# Extents along x, y, z in metres: least and greatest.
SIZES = {
    "bottle": ((0.050, 0.027, 0.120), (0.100, 0.100, 0.300)),
    "can": ((0.050, 0.045, 0.040), (0.100, 0.100, 0.170)),
    "camera": ((0.090, 0.030, 0.060), (0.150, 0.140, 0.110)),
    "laptop": ((0.220, 0.140, 0.110), (0.360, 0.410, 0.260)),
}
CASES = [(category, index) for category in SIZES for index in range(DRAWS)]
# Points this near the table touch it.
CONTACT_M = 1e-6
# Tilt that the mesh, as a solid of even density, withstands.
TILT_RAD = np.radians(5.0)


def draw(category: str, index: int) -> trimesh.Trimesh:
    module = importlib.import_module(f"sim_scenes.objects.{category}")
    rng = stream(split=Split.TEST, category=category, index=index, seed=11)
    mesh = module.generate(rng)
    assert isinstance(mesh, trimesh.Trimesh)
    return mesh


def texture_of(mesh: trimesh.Trimesh) -> Floats:
    assert isinstance(mesh.visual, trimesh.visual.TextureVisuals)
    uv: Floats = np.asarray(mesh.visual.uv)
    return uv


mesh_of = functools.cache(draw)


@pytest.mark.parametrize(("category", "index"), CASES)
def test_a_mesh_is_one_closed_solid_that_float32_holds_exactly(category: str, index: int) -> None:
    mesh = mesh_of(category, index)
    single = mesh.vertices.astype(np.float32)
    assert np.array_equal(single.astype(np.float64), mesh.vertices)

    merged = position_merged(mesh)
    assert merged.is_watertight
    assert merged.is_winding_consistent
    assert merged.volume > 0
    assert len(merged.split()) == 1


@pytest.mark.parametrize(("category", "index"), CASES)
def test_a_mesh_has_its_category_s_size_and_a_face_count_that_renders_fast(
    category: str, index: int
) -> None:
    mesh = mesh_of(category, index)
    low, high = SIZES[category]
    assert (mesh.extents >= low).all()
    assert (mesh.extents <= high).all()
    assert 500 <= len(mesh.faces) <= 7000


@pytest.mark.parametrize(("category", "index"), CASES)
def test_a_mesh_stands_on_its_base_about_the_origin(category: str, index: int) -> None:
    merged = position_merged(mesh_of(category, index))
    assert merged.bounds[0, 2] == 0.0
    base = merged.vertices[merged.vertices[:, 2] <= CONTACT_M][:, :2]
    # In direction u the base's hull reaches max(p . u): beyond c . u for all u where it holds c.
    angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    directions = np.stack([np.cos(angle), np.sin(angle)])
    reach = (base @ directions).max(axis=0)
    assert reach.min() > 0.0
    centre = merged.center_mass
    margin = (reach - centre[:2] @ directions).min()
    assert margin > centre[2] * np.tan(TILT_RAD)


@pytest.mark.parametrize(("category", "index"), CASES)
def test_texture_coordinates_lie_in_the_unit_square_and_normals_are_unit(
    category: str, index: int
) -> None:
    mesh = mesh_of(category, index)
    uv = texture_of(mesh)
    assert uv.shape == (len(mesh.vertices), 2)
    assert uv.min() >= 0.0
    assert uv.max() <= 1.0
    length = np.linalg.norm(mesh.vertex_normals, axis=1)
    np.testing.assert_allclose(length, 1.0, atol=2e-3)


@pytest.mark.parametrize("category", SIZES)
def test_the_same_stream_gives_the_same_bytes_and_another_a_different_shape(category: str) -> None:
    first, again, other = draw(category, 0), draw(category, 0), draw(category, 1)
    assert first.vertices.tobytes() == again.vertices.tobytes()
    assert first.faces.tobytes() == again.faces.tobytes()
    assert texture_of(first).tobytes() == texture_of(again).tobytes()
    assert first.vertex_normals.tobytes() == again.vertex_normals.tobytes()
    assert not np.allclose(first.extents, other.extents, atol=1e-5)


def test_the_longest_lens_balances_on_the_edge_of_what_is_allowed() -> None:
    body, depth, edge, radius = 0.13 * 0.08 * 0.05, 0.05, 0.005, 0.03
    length = balanced_length(body_m3=body, depth_m=depth, edge_m=edge, radius_m=radius)
    lens = np.pi * radius**2 * length
    centre = lens * 0.5 * (depth + length) / (body + lens)
    assert centre == pytest.approx(BALANCE * (0.5 * depth - edge), rel=1e-12)
