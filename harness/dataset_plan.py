"""Which targets of a BOP dataset are scored, and which of its scenes are only mapped."""

from __future__ import annotations

import hashlib
import itertools
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from harness.native import Pipeline
from harness.runs.job import SceneJob, scene_seed
from sim_scenes import BopDataset, BopError, Scene, SceneObject

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from harness.config import Config

_SAFE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,79}")


@dataclass(frozen=True, kw_only=True)
class DatasetJob(SceneJob):
    """A target to score, or a scene to map.

    Attributes
    ----------
    split
        Folder of the dataset's split.
    given_category
        Category of the objects that the dataset gives none.
    number, part
        Which of the scenes in the split, and which of the scenes that its images make.
    instance_id
        The target; None for a scene that is only mapped.
    views
        Number of frames.
    maps
        Where maps are written.
    """

    split: Path
    given_category: str | None
    number: int
    part: int
    instance_id: int | None
    views: int
    maps: Path


@dataclass
class Plan:
    """What a dataset's scenes ask for.

    Attributes
    ----------
    reasons
        Why a scene is not scored, by scene id; those without a job are skipped.
    notes
        What the reader left out.
    """

    jobs: list[DatasetJob] = field(default_factory=list)
    reasons: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def dataset_identity(dataset: BopDataset, *, category: str | None) -> list[str]:
    """Name a dataset by its tables and the names and sizes of its other files."""
    state = hashlib.sha256()
    root = dataset.folder.parent
    folders = (dataset.folder, *(root / name for name in ("models", "models_eval")))
    for path in sorted(path for folder in folders for path in folder.rglob("*")):
        if path.is_file():
            content = path.read_bytes() if path.suffix == ".json" else b""
            state.update(f"{path.relative_to(root)}/{path.stat().st_size}/".encode())
            state.update(content)
    given = [] if category is None else [f"category of what has none: {category}"]
    return [f"dataset {root.name}/{dataset.folder.name} sha256:{state.hexdigest()}", *given]


def plan_dataset(dataset: BopDataset, *, config: Config, category: str | None, maps: Path) -> Plan:
    """Read every scene and choose its targets."""
    plan = Plan()
    segmenter = Pipeline(config.pipeline_json()).segmenter
    taken: set[str] = set()
    for number in dataset.scene_ids:
        try:
            scenes = dataset.read_scene(number)
        except BopError as error:
            plan.reasons[_unique(f"{number:06d}", number, taken)] = str(error)
            continue
        for part, scene in enumerate(scenes):
            name = _unique(scene.name, number, taken)
            if segmenter == "oracle" and any(f.instance_ids is None for f in scene.frames):
                folder = dataset.folder / f"{number:06d}"
                plan.reasons[name] = _why_unmasked(scene, folder=folder, category=category)
                continue
            targets: list[SceneObject | None] = [*_targets(scene, classes=config.run.classes)]
            if targets:
                plan.notes += [f"{name}: {note}" for note in scene.notes]
            else:
                plan.reasons[name] = _why_unscored(scene, classes=config.run.classes)
            for target in targets or [None]:
                scene_id = name
                if target is not None and not _is_simulated(scene):
                    scene_id = _unique(f"{name}-{target.instance_id:02d}", number, taken)
                plan.jobs.append(
                    DatasetJob(
                        scene_id=scene_id,
                        category="free" if target is None else target.category,
                        object_name="" if target is None else target.name,
                        seed=_seed(scene, target, name=name, run_seed=config.run.seed),
                        cluttered=len(scene.categories) > 1,
                        split=dataset.folder,
                        given_category=category,
                        number=number,
                        part=part,
                        instance_id=None if target is None else target.instance_id,
                        views=len(scene.frames),
                        maps=maps,
                    )
                )
    return plan


def _unique(name: str, number: int, taken: set[str]) -> str:
    """Take a scene's name where it can name a file and is free, else make one from its number."""
    base = f"{number:06d}"
    names = itertools.chain([name, base], (f"{base}-{count}" for count in itertools.count(2)))
    free = (text for text in names if text not in taken and _SAFE_NAME.fullmatch(text))
    candidate = next(free)
    taken.add(candidate)
    return candidate


def _targets(scene: Scene, *, classes: Sequence[str]) -> list[SceneObject]:
    """Choose a simulated scene's target, or a foreign one's objects, if of a wanted class."""
    candidates = list(scene.objects)
    if _is_simulated(scene):
        target_id = min(scene.categories, default=0)
        candidates = [item for item in candidates if item.instance_id == target_id]
    return [item for item in candidates if item.category in classes]


def _is_simulated(scene: Scene) -> bool:
    # A file may hold any number: one that is no seed of ours makes the scene a foreign one.
    return scene.spec is not None and type(scene.seed) is int and 0 <= scene.seed < 2**63


def _why_unmasked(scene: Scene, *, folder: Path, category: str | None) -> str:
    why = "; ".join(scene.notes) or "the images have none"
    nameless = category is None and (folder / "mask_visib").is_dir()
    remedy = "; say what its masks show with --category, to map it" if nameless else ""
    return f'segmenter = "oracle" needs masks of known category: {why}{remedy}'


def _why_unscored(scene: Scene, *, classes: Sequence[str]) -> str:
    if not scene.objects:
        return f"no truth, no scores: {'; '.join(scene.notes) or 'no object has a mesh'}"
    have = ", ".join(sorted({item.category for item in scene.objects}))
    return f"no target of run.classes {', '.join(classes)}, no scores: the scene has {have}"


def _seed(scene: Scene, target: SceneObject | None, *, name: str, run_seed: int) -> int:
    if _is_simulated(scene) and scene.seed is not None:
        return scene.seed
    instance_id = 0 if target is None else target.instance_id
    return scene_seed(run_seed=run_seed, category=name, index=instance_id)
