"""Parametric, watertight, metric meshes of six categories, named by split, index and seed."""

from __future__ import annotations

import importlib
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Protocol, cast

from sim_scenes.objects.draws import Split, stream
from sim_scenes.objects.errors import ObjectError
from sim_scenes.objects.manifest import CATEGORIES, Record, sha256_of
from sim_scenes.objects.ply import ply_bytes

if TYPE_CHECKING:
    import numpy as np
    import trimesh

LICENSE = "MIT (made by this project's generator)"


class Generator(Protocol):
    """Module of a category."""

    def generate(self, rng: np.random.Generator) -> trimesh.Trimesh:
        """Draw and build one mesh: metres, z up, resting on z = 0."""


def generate_object(*, split: Split, category: str, index: int, seed: int) -> trimesh.Trimesh:
    """Make one mesh; its parameters depend on all four arguments and on nothing else.

    Raises
    ------
    ObjectError
        An unknown category or a negative index or seed.
    """
    if category not in CATEGORIES:
        raise ObjectError(f"no category is named '{category}'; use one of {', '.join(CATEGORIES)}")
    if index < 0 or seed < 0:
        raise ObjectError(f"index {index} and seed {seed} must not be negative; count from 0")
    module = cast("Generator", importlib.import_module(f"sim_scenes.objects.{category}"))
    return module.generate(stream(split=split, category=category, index=index, seed=seed))


def name_object(*, split: Split, category: str, index: int, seed: int) -> tuple[str, str]:
    """Path and source of a mesh's manifest entry, without making the mesh."""
    return (
        f"objects/{category}/{category}_{split.value}_{index:03d}.ply",
        f"credence generator, split {split.value}, index {index}, seed {seed}",
    )


def encode_object(*, split: Split, category: str, index: int, seed: int) -> tuple[Record, bytes]:
    """Make one mesh: its manifest entry and its file."""
    mesh = generate_object(split=split, category=category, index=index, seed=seed)
    path, source = name_object(split=split, category=category, index=index, seed=seed)
    data = ply_bytes(mesh)
    x, y, z = (round(float(extent), 6) for extent in mesh.extents)
    record = Record(
        path=path,
        category=category,
        name=PurePosixPath(path).stem,
        extents_m=(x, y, z),
        watertight=True,
        sha256=sha256_of(data),
        license=LICENSE,
        source=source,
    )
    return record, data
