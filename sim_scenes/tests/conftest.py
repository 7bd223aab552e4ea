from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

from sim_scenes import (
    DepthNoise,
    Frame,
    Intrinsics,
    ObjectModel,
    ObjectSet,
    Scene,
    SceneObject,
    SceneSpec,
)
from sim_scenes.geometry import look_at, rigid
from sim_scenes.sensor import on_depth_grid
from sim_scenes.tests.support import BOX_HALF_M, BOX_MIDDLE_M

if TYPE_CHECKING:
    from pathlib import Path


def write_model(folder: Path, name: str, category: str, mesh: trimesh.Trimesh) -> ObjectModel:
    path = folder / f"{name}.ply"
    mesh.export(path)
    return ObjectModel(name=name, category=category, path=path)


@pytest.fixture(scope="session")
def object_set(tmp_path_factory: pytest.TempPathFactory) -> ObjectSet:
    """Solids that stand safely: a box off its origin, and three cylinders, one with a handle."""
    folder = tmp_path_factory.mktemp("models")
    box = trimesh.creation.box(extents=2 * BOX_HALF_M)
    box.apply_translation(BOX_MIDDLE_M)
    cup: Any = trimesh.util.concatenate(
        [
            trimesh.creation.cylinder(radius=0.04, height=0.09, sections=32),
            trimesh.creation.box(
                extents=[0.03, 0.01, 0.05],
                transform=rigid(rotation=np.eye(3), translation=[0.05, 0, 0]),
            ),
        ]
    )
    models = (
        write_model(folder, "box", "camera", box),
        write_model(folder, "cup", "mug", cup),
        write_model(
            folder, "tin", "can", trimesh.creation.cylinder(radius=0.03, height=0.1, sections=32)
        ),
        write_model(
            folder, "dish", "bowl", trimesh.creation.cylinder(radius=0.06, height=0.04, sections=48)
        ),
    )
    return ObjectSet(folder, models)


@pytest.fixture(scope="session")
def small() -> SceneSpec:
    return SceneSpec.single("mug", views=2, image_size=(160, 120))


@pytest.fixture
def tiny_scene() -> Scene:
    """Two 8 x 6 frames of two tetrahedra; made by hand, on the depth grid."""
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]], dtype=np.float32)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    camera = Intrinsics(8, 6, 10.1, 10.2, 3.5, 2.5)
    frames = []
    for view in range(2):
        random = np.random.default_rng(view)
        depth_m = random.uniform(0.3, 0.9, (6, 8)).astype(np.float32)
        depth_m[0, view] = np.nan
        ids = np.zeros((6, 8), dtype=np.uint16)
        ids[2:4, 2:4] = 1
        ids[3:5, 5:7] = 2 if view else 0
        frames.append(
            Frame(
                rgb=random.integers(0, 256, (6, 8, 3), dtype=np.uint8),
                depth_m=on_depth_grid(depth_m, unit_m=1e-4),
                instance_ids=ids,
                intrinsics=camera,
                world_from_camera=look_at(
                    eye=np.array([0.3, -0.4 - 0.1 * view, 0.3]), target=np.array([0.5, 0, 0.03])
                ),
                joint_positions_rad=np.linspace(-1, 1.1, 7) / 3,
            )
        )
    angle = 0.3
    turn = [
        [np.cos(angle), -np.sin(angle), 0],
        [np.sin(angle), np.cos(angle), 0],
        [0, 0, 1],
    ]
    objects = tuple(
        SceneObject(
            instance_id=number,
            name=name,
            category=category,
            vertices=(corners * scale).astype(np.float32).astype(np.float64),
            faces=faces,
            world_from_object=rigid(rotation=turn, translation=[0.5 + 0.1 / number, 0.01, 0.0]),
        )
        for number, name, category, scale in ((1, "pyramid", "mug", 0.9), (2, "spike", "can", 1.1))
    )
    spec = SceneSpec.clutter("mug", depth_noise=DepthNoise(subpixel_px=0.2))
    return Scene(tuple(frames), objects, "mug-7", redraws=("pyramid toppled",), spec=spec, seed=7)
