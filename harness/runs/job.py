"""Scenes to compute, as a list that a seed determines."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from harness.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from harness.config import Config


class ObjectModel(Protocol):
    """What a plan needs to know of an object's mesh."""

    @property
    def name(self) -> str:
        """Name, unique in its set."""
        ...

    @property
    def category(self) -> str:
        """One of the six of NOCS."""
        ...

    @property
    def path(self) -> Path:
        """Mesh file."""
        ...


@dataclass(frozen=True)
class SceneJob:
    """One scene to render, map, classify and score.

    Attributes
    ----------
    scene_id
        Unique in a run and safe as a file name, such as ``mug-0003``.
    category
        Class of the target object.
    object_name
        Name of the target's mesh in the object set.
    seed
        The scene's own seed, in [0, 2**63).
    cluttered
        Whether other objects stand around the target.
    """

    scene_id: str
    category: str
    object_name: str
    seed: int
    cluttered: bool = False


def object_identity(model: ObjectModel) -> str:
    """Name an object by its class, its name and the content of its file."""
    digest = hashlib.sha256(model.path.read_bytes()).hexdigest()
    return f"{model.category}/{model.name} sha256:{digest}"


def split_identity(identity: str) -> tuple[str, str]:
    """Return ``class/name`` and the sha256 of what `object_identity` returned."""
    name, _, digest = identity.rpartition(" sha256:")
    return name, digest


def object_files(models: Sequence[ObjectModel], identities: Sequence[str]) -> dict[str, str]:
    """Return the sha256 of each object's file by its absolute path, from their identities."""
    return {
        str(model.path.absolute()): split_identity(identity)[1]
        for model, identity in zip(models, identities, strict=True)
    }


def scene_seed(*, run_seed: int, category: str, index: int) -> int:
    """Seed of a class's scene number `index`: a hash, so that no other scene changes it."""
    text = f"{run_seed}/{category}/{index}".encode()
    digest = hashlib.blake2b(text, digest_size=8, person=b"credence scene").digest()
    return int.from_bytes(digest, "little") >> 1


def scene_ids(config: Config) -> list[str]:
    """Name the scenes of a run, in the plan's order."""
    return [
        f"{category}-{index:04d}"
        for category in config.run.classes
        for index in range(config.run.scenes)
    ]


def plan_jobs(config: Config, models: Sequence[ObjectModel]) -> list[SceneJob]:
    """Scenes of a run: for each class its objects in turn, by name.

    A longer run starts with the scenes of a shorter one: scene i of a class depends on the run's
    seed, the class and i alone.

    Raises
    ------
    InputError
        A class has no object.
    """
    names: defaultdict[str, list[str]] = defaultdict(list)
    for model in models:
        names[model.category].append(model.name)
    jobs: list[SceneJob] = []
    for category in config.run.classes:
        if not names[category]:
            have = ", ".join(sorted(key for key, value in names.items() if value)) or "nothing"
            place = config.scenes.objects or "the object set"
            raise InputError(
                f"{place} has no object of class '{category}' (it holds: {have}); "
                "add one to its manifest or change run.classes"
            )
        objects = sorted(names[category])
        jobs += [
            SceneJob(
                scene_id=f"{category}-{index:04d}",
                category=category,
                object_name=objects[index % len(objects)],
                seed=scene_seed(run_seed=config.run.seed, category=category, index=index),
                cluttered=config.scenes.cluttered,
            )
            for index in range(config.run.scenes)
        ]
    return jobs
