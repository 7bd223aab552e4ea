"""The list of meshes in a folder: manifest.json or MANIFEST.json.

A JSON list with one entry per mesh. Every entry has `path` (relative to the manifest, or to the
installed package that `package` names) and `category`; the other fields of `Record` are optional,
and fields of other tools are left alone. Meshes are in metres, z up.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from sim_scenes.objects.errors import ObjectError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

NAMES = ("manifest.json", "MANIFEST.json")
# The six categories of NOCS, in its order.
CATEGORIES = ("bottle", "bowl", "camera", "can", "laptop", "mug")
EXAMPLE = '[{"path": "mug/blue.obj", "category": "mug"}]'


@dataclass(frozen=True, kw_only=True)
class Record:
    """One entry of a manifest.

    Attributes
    ----------
    path
        Mesh file, with forward slashes.
    category
        One of `CATEGORIES`.
    name
        Unique in the manifest.
    package
        Installed Python package that holds `path`, where the mesh is not in the folder.
    texture
        Picture for the mesh's texture coordinates, relative like `path`.
    extents_m
        Size along x, y and z.
    watertight
        Whether the surface is closed once vertices of one position are merged.
    sha256
        Of the mesh file, hexadecimal.
    license
        Licence and origin.
    source
        What made the mesh, and from which seed.
    """

    path: str
    category: str
    name: str | None = None
    package: str | None = None
    texture: str | None = None
    extents_m: tuple[float, float, float] | None = None
    watertight: bool | None = None
    sha256: str | None = None
    license: str | None = None
    source: str | None = None


def find_manifest(folder: Path) -> Path:
    """Path of the folder's manifest.

    Raises
    ------
    ObjectError
        No folder, or no manifest in it.
    """
    if not folder.is_dir():
        raise ObjectError(f"{folder}: no such folder; pass a folder of meshes with a {NAMES[0]}")
    found = next((folder / name for name in NAMES if (folder / name).is_file()), None)
    if found is None:
        raise ObjectError(
            f"{folder}: no {NAMES[0]}; write one that lists the meshes, such as {EXAMPLE}"
        )
    return found


def read_manifest(path: Path) -> list[Record]:
    """Entries of a manifest, in its order.

    Raises
    ------
    ObjectError
        Not a JSON list of entries with a path and a known category.
    """
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ObjectError(
            f"{path}: cannot be read as JSON ({error}); write a list such as {EXAMPLE}"
        ) from error
    if not isinstance(entries, list) or not entries:
        raise ObjectError(f"{path}: not a list of at least one mesh; write one such as {EXAMPLE}")
    return [_record(entry, f"{path}: entry {number}") for number, entry in enumerate(entries)]


def write_manifest(path: Path, records: Sequence[Record]) -> None:
    """Write entries as a manifest, fields without a value left out; the file appears at once."""
    entries = [
        {key: value for key, value in asdict(record).items() if value is not None}
        for record in records
    ]
    partial = path.with_name(f".{path.name}.partial")
    partial.write_text(json.dumps(entries, indent=1) + "\n", encoding="utf-8")
    partial.replace(path)


def sha256_of(data: bytes) -> str:
    """Hexadecimal digest."""
    return hashlib.sha256(data).hexdigest()


def _record(entry: Any, where: str) -> Record:
    """Check one entry; `where` opens the message."""
    if not isinstance(entry, dict):
        raise ObjectError(f"{where} is {entry!r}, not an object; write one such as {EXAMPLE[1:-1]}")
    texts: dict[str, str | None] = {}
    for key in ("path", "category", "name", "package", "texture", "sha256", "license", "source"):
        value = entry.get(key)
        if value is not None and not (isinstance(value, str) and value):
            raise ObjectError(f"{where} has {key} {value!r}; give a text that is not empty")
        texts[key] = value
    path, category = texts.pop("path"), texts.pop("category")
    if path is None or category is None:
        missing = "path" if path is None else "category"
        raise ObjectError(
            f"{where} has no {missing}; every mesh needs one, such as {EXAMPLE[1:-1]}"
        )
    if category not in CATEGORIES:
        raise ObjectError(
            f"{where} ({path}) has category '{category}'; use one of {', '.join(CATEGORIES)}"
        )
    extents = entry.get("extents_m")
    watertight = entry.get("watertight")
    return Record(
        path=path,
        category=category,
        extents_m=None if extents is None else _extents(extents, where),
        watertight=watertight if isinstance(watertight, bool) else None,
        **texts,
    )


def _extents(value: Any, where: str) -> tuple[float, float, float]:
    numbers = isinstance(value, list) and all(isinstance(v, int | float) for v in value)
    if not numbers or len(value) != 3:
        raise ObjectError(f"{where} has extents_m {value!r}; give three numbers in metres")
    return (float(value[0]), float(value[1]), float(value[2]))
