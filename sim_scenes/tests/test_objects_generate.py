from __future__ import annotations

import hashlib
import subprocess
import sys
from dataclasses import astuple
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from sim_scenes.objects import CATEGORIES, ObjectError, ObjectModel
from sim_scenes.objects.bowl import BowlParams, Outline, Rim, Style
from sim_scenes.objects.draws import Split, choose, integer, stream, uniform
from sim_scenes.objects.finish import position_merged
from sim_scenes.objects.generate import encode_object, generate_object
from sim_scenes.objects.handle import Handle
from sim_scenes.objects.mug import Body, MugParams, build as build_mug

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import trimesh
    from trimesh.visual import TextureVisuals

    from sim_scenes.objects.part import Floats


def texture_coordinates(mesh: trimesh.Trimesh) -> Floats:
    return np.asarray(cast("TextureVisuals", mesh.visual).uv)


def mugs(count: int, *, split: Split = Split.TRAIN) -> list[MugParams]:
    streams = (stream(split=split, category="mug", index=i, seed=0) for i in range(count))
    return [MugParams.draw(random) for random in streams]


def bowls(count: int, *, split: Split = Split.TRAIN) -> list[BowlParams]:
    streams = (stream(split=split, category="bowl", index=i, seed=0) for i in range(count))
    return [BowlParams.draw(random) for random in streams]


@pytest.mark.parametrize("category", ["mug", "bowl"])
@pytest.mark.parametrize("index", range(12))
def test_is_a_metric_solid_that_stands(category: str, index: int) -> None:
    mesh = generate_object(split=Split.TRAIN, category=category, index=index, seed=0)
    solid = position_merged(mesh)
    assert solid.is_watertight
    assert solid.is_winding_consistent
    assert solid.volume > 0

    assert np.array_equal(mesh.vertices, mesh.vertices.astype(np.float32))
    assert mesh.bounds[0, 2] == 0.0
    if category == "mug":
        # The handle reaches along x.
        assert 0.059 <= solid.extents[1] <= 0.11
        assert 0.06 <= solid.extents[2] <= 0.14
    else:
        assert 0.08 <= solid.extents[:2].max() <= 0.2005

    # The centre of mass lies well within what touches the table.
    base = ConvexHull(solid.vertices[solid.vertices[:, 2] <= 1e-6][:, :2])
    margins = -(base.equations[:, :2] @ solid.center_mass[:2] + base.equations[:, 2])
    assert margins.min() > 0.01


@pytest.mark.parametrize("category", CATEGORIES)
def test_texture_coordinates_and_normals(category: str) -> None:
    mesh = generate_object(split=Split.TRAIN, category=category, index=0, seed=0)
    uv = texture_coordinates(mesh)
    assert uv.shape == (len(mesh.vertices), 2)
    assert uv.min() >= 0.0
    assert uv.max() <= 1.0
    assert np.allclose(np.linalg.norm(mesh.vertex_normals, axis=1), 1.0, atol=2e-3)
    # No face spreads over a seam: each covers little of the texture.
    spread = uv[mesh.faces].max(axis=1) - uv[mesh.faces].min(axis=1)
    assert spread.max() < 0.55
    # Stored normals agree with the faces they shade.
    agreement = np.einsum("fkj,fj->fk", mesh.vertex_normals[mesh.faces], mesh.face_normals)
    assert np.percentile(agreement[mesh.area_faces > 1e-9], 0.1) > 0.5


def crossings(mesh: trimesh.Trimesh, origin: Floats, direction: Floats) -> Floats:
    """Distances (k,) at which a ray crosses the surface, in order (Moeller-Trumbore)."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    e1, e2 = b - a, c - a
    p = np.cross(direction, e2)
    determinant = np.einsum("ij,ij->i", e1, p)
    usable = np.abs(determinant) > 1e-15
    inverse = np.divide(1.0, determinant, out=np.zeros_like(determinant), where=usable)
    s = origin - a
    u = np.einsum("ij,ij->i", s, p) * inverse
    q = np.cross(s, e1)
    v = q @ direction * inverse
    t = np.einsum("ij,ij->i", e2, q) * inverse
    return np.sort(t[usable & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)])


@pytest.mark.parametrize("index", range(8))
def test_a_mug_is_hollow_with_thin_walls(index: int) -> None:
    params = mugs(8)[index]
    solid = position_merged(build_mug(params))
    # Away from the handle (+x), across the wall and from above through the floor.
    across = np.array([-0.7, 0.713, 0.0]) / np.hypot(0.7, 0.713)
    wall = np.diff(crossings(solid, np.array([0.0, 0.0, 0.6 * params.height_m]), across))
    floor = crossings(solid, np.array([0.0013, 0.0007, 1.0]), np.array([0.0, 0.0, -1.0]))
    count = 3 if params.gap_m else 1
    assert len(wall) == count
    # A slanted wall is longer on the level.
    assert wall[0] == pytest.approx(params.wall_m, rel=0.12)
    assert len(floor) == count + 1
    assert 1.0 - floor[0] < 0.4 * params.height_m
    assert 0.0025 <= params.wall_m <= 0.006


def test_a_double_wall_encloses_air() -> None:
    params = next(p for p in mugs(60) if p.gap_m)
    solid = position_merged(build_mug(params))
    assert solid.body_count == 2
    outer, void = sorted(solid.split(only_watertight=True), key=lambda part: -abs(part.volume))
    assert outer.volume > 0 > void.volume


def test_every_kind_turns_up() -> None:
    cups, dishes = mugs(120), bowls(120)
    assert {p.body for p in cups} == set(Body)
    assert {p.handle.kind for p in cups} == set(Handle)
    assert any(p.gap_m for p in cups)
    assert {p.style for p in dishes} == set(Style)
    assert {p.outline for p in dishes} == set(Outline)
    assert {p.rim for p in dishes} == set(Rim)
    assert {bool(p.foot_m) for p in dishes} == {False, True}
    assert min(p.width_m for p in dishes) < 0.1
    assert max(p.width_m for p in dishes) > 0.19


@pytest.mark.parametrize("draws", [mugs, bowls])
def test_splits_share_no_draw(draws: Callable[..., list[MugParams] | list[BowlParams]]) -> None:
    drawn = [
        value
        for split in Split
        for params in draws(100, split=split)
        for value in (params.height_m, params.wall_m, params.floor_m)
    ]
    assert len(drawn) == 3 * 100 * 3
    assert len(set(drawn)) == len(drawn)


@pytest.mark.parametrize("category", CATEGORIES)
def test_streams_differ_in_every_part_of_their_name(category: str) -> None:
    base: dict[str, Any] = {"split": Split.TRAIN, "category": category, "index": 1, "seed": 2}
    changes: list[dict[str, Any]] = [
        {},
        {"split": Split.TEST},
        {"split": Split.VALIDATION},
        {"index": 2},
        {"seed": 1},
    ]
    first = {tuple(stream(**{**base, **change}).random(4)) for change in changes}
    assert len(first) == len(changes)


def test_stream_is_pinned() -> None:
    random = stream(split=Split.TEST, category="mug", index=0, seed=0)
    again = stream(split=Split.TEST, category="mug", index=0, seed=0)
    assert uniform(random, 2.0, 3.0) == 2.0 + again.random()
    assert integer(random, 5, 5) == 5
    assert choose(random, {"a": 0.0, "b": 1.0}) == "b"


def test_same_bytes_in_another_process() -> None:
    code = (
        "import hashlib\n"
        "from sim_scenes.objects import CATEGORIES\n"
        "from sim_scenes.objects.draws import Split\n"
        "from sim_scenes.objects.generate import encode_object\n"
        "for name in CATEGORIES:\n"
        "    _, data = encode_object(split=Split.TEST, category=name, index=7, seed=3)\n"
        "    print(hashlib.sha256(data).hexdigest())\n"
    )
    here = [
        hashlib.sha256(
            encode_object(split=Split.TEST, category=name, index=7, seed=3)[1]
        ).hexdigest()
        for name in CATEGORIES
    ]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == here


def test_file_reads_back_exactly(tmp_path: Path) -> None:
    mesh = generate_object(split=Split.TEST, category="mug", index=1, seed=0)
    record, data = encode_object(split=Split.TEST, category="mug", index=1, seed=0)
    path = tmp_path / "mug.ply"
    path.write_bytes(data)
    back = ObjectModel(name="m", category="mug", path=path).load_mesh()
    assert np.array_equal(back.vertices, mesh.vertices)
    assert np.array_equal(back.faces, mesh.faces)
    assert np.array_equal(texture_coordinates(back), texture_coordinates(mesh))
    assert np.array_equal(back.vertex_normals, mesh.vertex_normals)
    assert record.extents_m == pytest.approx(back.extents, abs=1e-6)


def test_shape_is_a_function_of_its_parameters() -> None:
    one, two = mugs(2)
    assert astuple(one) != astuple(two)
    assert np.array_equal(build_mug(one).vertices, build_mug(one).vertices)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"category": "spoon"}, "'spoon'; use one of bottle, bowl"),
        ({"index": -1}, "index -1 and seed 0 must not be negative"),
        ({"seed": -4}, "index 0 and seed -4 must not be negative"),
    ],
)
def test_refuses_what_it_cannot_make(change: dict[str, Any], message: str) -> None:
    name: dict[str, Any] = {"split": Split.TEST, "category": "mug", "index": 0, "seed": 0, **change}
    with pytest.raises(ObjectError, match=message):
        generate_object(**name)
