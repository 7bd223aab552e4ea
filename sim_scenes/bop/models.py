"""Object models of a dataset: PLY files in millimetres, and what is known of each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from sim_scenes.bop.fields import MM_PER_M, read_numbered, table_of
from sim_scenes.errors import BopError
from sim_scenes.objects import CATEGORIES

if TYPE_CHECKING:
    from pathlib import Path

    from sim_scenes.geometry import Floats, Ints

MODEL_FOLDERS = ("models", "models_eval")


def write_ply(path: Path, vertices: Floats, faces: Ints) -> None:
    """Write a binary PLY in millimetres, from metres.

    Positions are doubles: dividing them by 1000 and rounding to float32 gives the input's bits.
    """
    normals = trimesh.Trimesh(vertices, faces, process=False).vertex_normals
    points = np.zeros(len(vertices), dtype=[("p", "<f8", 3), ("n", "<f4", 3)])
    points["p"] = vertices * MM_PER_M
    points["n"] = normals
    triangles = np.zeros(len(faces), dtype=[("count", "u1"), ("index", "<i4", 3)])
    triangles["count"] = 3
    triangles["index"] = faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(points)}",
        *(f"property double {axis}" for axis in "xyz"),
        *(f"property float n{axis}" for axis in "xyz"),
        f"element face {len(triangles)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    path.write_bytes("\n".join(header).encode() + points.tobytes() + triangles.tobytes())


def model_info(vertices: Floats, faces: Ints, *, name: str, category: str) -> dict[str, Any]:
    """Entry of `models_info.json`: box and diameter in millimetres, and what the model is."""
    points = vertices * MM_PER_M
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    corners = trimesh.Trimesh(points, faces, process=False).convex_hull.vertices
    diameter = max(float(np.linalg.norm(corners - corner, axis=1).max()) for corner in corners)
    box = {f"min_{axis}": float(value) for axis, value in zip("xyz", low, strict=True)}
    box |= {f"size_{axis}": float(value) for axis, value in zip("xyz", size, strict=True)}
    return {"diameter": diameter, **box, "name": name, "category": category}


@dataclass(frozen=True, eq=False)
class Model:
    """A model as read; vertices (n, 3) in metres, exact in float32, and faces (m, 3)."""

    name: str
    category: str
    vertices: Floats
    faces: Ints


class ModelFolder:
    """The models of a dataset, loaded when they are first asked for.

    Parameters
    ----------
    root
        Of the dataset.
    category
        Of the objects that the dataset gives none.
    """

    def __init__(self, root: Path, *, category: str | None = None) -> None:
        self._category = category
        folders = (root / name for name in MODEL_FOLDERS)
        self._folder = next((folder for folder in folders if folder.is_dir()), None)
        self._infos: dict[int, Any] | None = None
        self._models: dict[int, Model | str] = {}

    def get(self, object_id: int) -> Model | str:
        """Return a model, or why the dataset has none that can be scored against."""
        if object_id not in self._models:
            self._models[object_id] = self._load(object_id)
        return self._models[object_id]

    def category(self, object_id: int) -> str | None:
        """Category of an object, known without its mesh too; None where nothing says it."""
        category = self._info(object_id).get("category")
        return category if category in CATEGORIES else self._category

    def common_category(self) -> str | None:
        """Return the one category that every object of the dataset is of, if there is one."""
        categories = {self.category(object_id) for object_id in self._all_infos()}
        return categories.pop() if len(categories) == 1 else self._category

    def _load(self, object_id: int) -> Model | str:
        if self._folder is None:
            return "the dataset has no models"
        path = self._folder / f"obj_{object_id:06d}.ply"
        if not path.is_file():
            return f"{path.name} is missing"
        category = self.category(object_id)
        if category is None:
            return f"models_info.json gives it no category of {', '.join(CATEGORIES)}"
        try:
            mesh: Any = trimesh.load(path, force="mesh", process=False)
            vertices = np.asarray(mesh.vertices, dtype=np.float64) / MM_PER_M
            faces = np.asarray(mesh.faces, dtype=np.int64)
        # trimesh answers a broken file with whatever exception its parser meets.
        except Exception as error:
            raise BopError(f"{path}: is not a readable PLY file ({error})") from error
        if not len(faces) or not np.isfinite(vertices).all():
            raise BopError(f"{path}: has no faces or vertices that are not finite; re-export it")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise BopError(f"{path}: a face names a vertex that is not there; re-export it")
        name = str(self._info(object_id).get("name", path.stem))
        return Model(name, category, vertices.astype(np.float32).astype(np.float64), faces)

    def _info(self, object_id: int) -> dict[str, Any]:
        where = f"{self._folder}/models_info.json: object {object_id}"
        return table_of(self._all_infos().get(object_id, {}), where=where)

    def _all_infos(self) -> dict[int, Any]:
        if self._infos is None:
            path = None if self._folder is None else self._folder / "models_info.json"
            self._infos = read_numbered(path) if path is not None and path.is_file() else {}
        return self._infos
