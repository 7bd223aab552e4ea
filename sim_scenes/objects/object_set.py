"""Meshes to put into scenes: the committed benchmark set, or any folder with a manifest."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import trimesh

from sim_scenes.objects.errors import ObjectError
from sim_scenes.objects.manifest import Record, find_manifest, read_manifest, sha256_of

BENCHMARK_FOLDER = Path(__file__).resolve().parents[2] / "assets"
# The one package whose meshes a manifest may name.
PACKAGES = ("pybullet_data",)
LARGEST_M = 1.0
SMALLEST_M = 0.005
# A sheet thinner than this has no convex hull to stand on.
THINNEST_M = 0.0005
# Lines of an OBJ file among which its material library is looked for.
OBJ_HEADER_LINES = 200


@dataclass(frozen=True)
class ObjectModel:
    """One mesh, in metres, z up.

    Attributes
    ----------
    name
        Unique in its set.
    category
        One of the six of NOCS.
    path
        Mesh file.
    license
        Licence and origin, where the manifest gives them.
    texture_path
        Picture for its texture coordinates, if it has one.
    """

    name: str
    category: str
    path: Path
    license: str | None = None
    texture_path: Path | None = None

    def load_mesh(self) -> trimesh.Trimesh:
        """Read the mesh in its own frame; coordinates are rounded to float32, nothing else changes.

        Raises
        ------
        ObjectError
            The file is unreadable, empty, not finite, over 1 m, under 5 mm, or flat; a face names
            a vertex that is not there.
        """
        remedy = "export it again as OBJ, PLY, STL or GLB, or leave it out of the manifest"
        try:
            mesh = _read_mesh(self.path)
        except Exception as error:
            # The readers of damaged files raise what they happen to run into.
            raise ObjectError(
                f"{self.path}: cannot be read as a mesh ({type(error).__name__}: {error}); {remedy}"
            ) from error
        if len(mesh.faces) == 0:
            raise ObjectError(f"{self.path}: has no faces; {remedy}")
        outside = (mesh.faces < 0) | (mesh.faces >= len(mesh.vertices))
        if outside.any():
            face, corner = np.argwhere(outside)[0]
            raise ObjectError(
                f"{self.path}: face {face} names vertex {mesh.faces[face, corner]} of "
                f"{len(mesh.vertices)}; {remedy}"
            )
        exact = np.asarray(mesh.vertices).astype(np.float32).astype(np.float64)
        if not np.isfinite(exact).all():
            bad = int(np.flatnonzero(~np.isfinite(exact).all(axis=1))[0])
            raise ObjectError(f"{self.path}: vertex {bad} is not finite; {remedy}")
        if not np.array_equal(exact, mesh.vertices):
            normals = mesh.vertex_normals
            mesh.vertices = exact
            mesh.vertex_normals = normals  # type: ignore[method-assign]
        largest = float(mesh.extents.max())
        if largest > LARGEST_M:
            raise ObjectError(
                f"{self.path}: {largest:.3g} m large, over {LARGEST_M:g} m; "
                "scale it to metres (a mesh in millimetres by 0.001)"
            )
        if largest < SMALLEST_M:
            raise ObjectError(
                f"{self.path}: {largest * 1e3:.3g} mm large, under {SMALLEST_M * 1e3:g} mm; "
                "scale it to metres"
            )
        thickness = _thickness_m(exact)
        if thickness < THINNEST_M:
            raise ObjectError(
                f"{self.path}: {thickness * 1e3:.3g} mm thick, under {THINNEST_M * 1e3:g} mm: too "
                "flat to stand on a table; give it a thickness, or leave it out of the manifest"
            )
        return mesh


@dataclass(frozen=True)
class ObjectSet:
    """Models of one manifest, in its order, with distinct names."""

    folder: Path
    models: tuple[ObjectModel, ...]

    def of(self, category: str) -> tuple[ObjectModel, ...]:
        """Models of one category."""
        return tuple(model for model in self.models if model.category == category)

    def check_meshes(self) -> None:
        """Load every mesh once.

        Raises
        ------
        ObjectError
            The first mesh that cannot be used.
        """
        for model in self.models:
            model.load_mesh()


def load_object_set(folder: Path | None = None) -> ObjectSet:
    """Read a folder's manifest and find its files; without a folder, the benchmark set.

    Meshes are read later: see `ObjectModel.load_mesh` and `ObjectSet.check_meshes`.

    Raises
    ------
    ObjectError
        The manifest is missing or malformed, a file is missing, lies outside the folder or differs
        from its sha256, or two meshes share a name.
    """
    if folder is None:
        folder = BENCHMARK_FOLDER
        if not folder.is_dir():
            raise ObjectError(
                f"{folder}: the benchmark meshes are not installed; work in a checkout of the "
                "repository, or name a folder of meshes with --objects"
            )
    manifest = find_manifest(folder)
    models = tuple(_model(record, folder) for record in read_manifest(manifest))
    seen: dict[str, ObjectModel] = {}
    for model in models:
        if model.name in seen:
            raise ObjectError(
                f"{manifest}: {seen[model.name].path} and {model.path} are both named "
                f"'{model.name}'; give each entry a 'name' of its own"
            )
        seen[model.name] = model
    return ObjectSet(folder, models)


def _read_mesh(path: Path) -> trimesh.Trimesh:
    """Read a file as one mesh; pictures are for those who draw, from `texture_path`."""
    scene = trimesh.load_scene(path, process=False, skip_materials=True)
    if len(scene.geometry) == 1 and len(scene.graph.nodes_geometry) == 1:
        placed, _ = scene.graph[scene.graph.nodes_geometry[0]]
        only = next(iter(scene.geometry.values()))
        if isinstance(only, trimesh.Trimesh) and np.array_equal(placed, np.eye(4)):
            # As it stands: flattening a scene would drop the file's normals.
            return only
    whole: trimesh.Trimesh = scene.to_mesh()
    return whole


def _thickness_m(vertices: npt.NDArray[np.float64]) -> float:
    """Extent of points (n, 3) along their axis of least variance: 0 for every plane."""
    centred = vertices - vertices.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    return float(np.ptp(centred @ axes[:, 0]))


def _model(record: Record, folder: Path) -> ObjectModel:
    root = folder if record.package is None else _package_folder(record.package, folder)
    path = _inside(root, record.path)
    if not path.is_file():
        raise ObjectError(f"{path}: no such file; correct its path in {folder}'s manifest")
    if record.sha256 is not None:
        digest = sha256_of(path.read_bytes())
        if digest != record.sha256.lower():
            raise ObjectError(
                f"{path}: its sha256 is {digest}, the manifest says {record.sha256}; "
                "restore the file, or correct the manifest"
            )
    texture = _obj_texture(path) if record.texture is None else _inside(root, record.texture)
    if record.texture is not None and (texture is None or not texture.is_file()):
        raise ObjectError(f"{texture}: no such texture; correct the entry of {record.path}")
    return ObjectModel(
        name=record.name or _name(path),
        category=record.category,
        path=path,
        license=record.license,
        texture_path=texture,
    )


def _name(path: Path) -> str:
    """Name a mesh by its file, or by its folder where the file's name says nothing."""
    return path.parent.name if path.stem.lower() == "model" else path.stem


def _inside(root: Path, relative: str) -> Path:
    """Path of a file that must lie in `root`."""
    path = root / relative
    try:
        inside = path.resolve().is_relative_to(root.resolve())
        path.is_file()
    # A NUL, a name too long for the disk, links in a circle.
    except (OSError, RuntimeError, ValueError) as error:
        raise ObjectError(
            f"{root}: {relative!r:.80} is no file's path ({_reason(error)}); correct the manifest"
        ) from error
    if not inside:
        raise ObjectError(
            f"{relative}: leads out of {root}; keep the files in the manifest's folder "
            "and give relative paths"
        )
    return path


def _reason(error: Exception) -> str:
    """Say what is wrong with a path, without the path itself."""
    if isinstance(error, OSError):
        return error.strerror or "unreadable"
    return "links in a circle" if isinstance(error, RuntimeError) else str(error)


def _package_folder(package: str, folder: Path) -> Path:
    if package not in PACKAGES:
        raise ObjectError(
            f"{folder}: the manifest names package '{package}'; only {', '.join(PACKAGES)} is known"
        )
    found = importlib.util.find_spec(package)
    if found is None or not found.submodule_search_locations:
        raise ObjectError(
            f"{folder}: package '{package}' is not installed; `pip install pybullet` has it"
        )
    return Path(next(iter(found.submodule_search_locations)))


def _obj_texture(path: Path) -> Path | None:
    """Find the first picture that an OBJ file's material library names and that exists."""
    if path.suffix.lower() != ".obj":
        return None
    with path.open(encoding="utf-8", errors="replace") as lines:
        head = [line for _, line in zip(range(OBJ_HEADER_LINES), lines, strict=False)]
    for library in _values(head, "mtllib"):
        material = path.parent / library
        if not material.is_file():
            continue
        text = material.read_text(encoding="utf-8", errors="replace").splitlines()
        for picture in _values(text, "map_Kd"):
            if (path.parent / picture).is_file():
                return path.parent / picture
    return None


def _values(lines: list[str], keyword: str) -> list[str]:
    """Rest of the lines that open with a keyword."""
    split = (line.split(maxsplit=1) for line in lines)
    return [words[1].strip() for words in split if len(words) == 2 and words[0] == keyword]
