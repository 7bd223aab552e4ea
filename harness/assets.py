"""Generated meshes, written as a folder that `--objects` takes."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import trimesh

from sim_scenes.objects.bowl import BowlParams, Outline, Rim, Style
from sim_scenes.objects.draws import Split, stream
from sim_scenes.objects.errors import ObjectError
from sim_scenes.objects.generate import encode_object, name_object
from sim_scenes.objects.handle import Handle
from sim_scenes.objects.manifest import (
    CATEGORIES,
    NAMES as MANIFEST_NAMES,
    Record,
    read_manifest,
    sha256_of,
    write_manifest,
)
from sim_scenes.objects.mug import Body, MugParams

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np

# What is committed: the test split, and PyBullet's own mug. The seed is the smallest that
# `shows_every_kind`; how a scene of it is scored had no say.
BENCHMARK_COUNTS = {"bottle": 3, "bowl": 10, "camera": 3, "can": 3, "laptop": 3, "mug": 10}
BENCHMARK_SPLIT = Split.TEST
BENCHMARK_SEED = 2
MANIFEST = "MANIFEST.json"


@dataclass(frozen=True)
class Progress:
    """How far the generator has come."""

    done: int
    total: int
    path: str


def generate_assets(
    out: Path,
    *,
    split: str = Split.TRAIN.value,
    seed: int = 0,
    per_category: int = 10,
    counts: Mapping[str, int] | None = None,
    benchmark: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> list[Record]:
    """Write meshes and their manifest into a folder; the same arguments give the same bytes.

    Every file is written under a temporary name first, and the manifest last: a folder with a
    manifest is whole.

    Parameters
    ----------
    out
        Folder to write; made where it is missing.
    split, seed
        Name the family of shapes; no two splits share one.
    per_category
        Meshes of each category.
    counts
        Meshes per category instead, none of those left out.
    benchmark
        The committed set instead: its split, seed and counts, and PyBullet's own mug.
    progress
        Called after each mesh.

    Returns
    -------
    list of Record
        The manifest's entries.

    Raises
    ------
    ObjectError
        An unknown split or category, a negative number, or nothing to make; a folder that cannot
        be written or that holds another set.
    """
    if benchmark:
        split, seed, counts = BENCHMARK_SPLIT.value, BENCHMARK_SEED, BENCHMARK_COUNTS
    elif counts is None:
        counts = dict.fromkeys(CATEGORIES, per_category)
    family = _split(split)
    for category, count in counts.items():
        if category not in CATEGORIES:
            raise ObjectError(
                f"no category is named '{category}'; use one of {', '.join(CATEGORIES)}"
            )
        if count < 0:
            raise ObjectError(f"{count} meshes of category {category}; ask for 0 or more")
    jobs = [(name, index) for name in CATEGORIES for index in range(counts.get(name, 0))]
    if not jobs:
        raise ObjectError("no mesh was asked for; give at least one category a count above 0")
    added = [pybullet_mug()] if benchmark else []
    try:
        _keep_other_sets(
            out,
            {
                *(name_object(split=family, category=c, index=i, seed=seed) for c, i in jobs),
                *((record.path, record.source) for record in added),
            },
        )
        (out / MANIFEST).unlink(missing_ok=True)
        records = []
        for done, (category, index) in enumerate(jobs, start=1):
            record, data = encode_object(split=family, category=category, index=index, seed=seed)
            target = out / record.path
            target.parent.mkdir(parents=True, exist_ok=True)
            partial = target.with_name(f".{target.name}.partial")
            partial.write_bytes(data)
            partial.replace(target)
            records.append(record)
            if progress is not None:
                progress(Progress(done=done, total=len(jobs), path=record.path))
        records += added
        write_manifest(out / MANIFEST, records)
    except OSError as error:
        reason = error.strerror or error
        raise ObjectError(
            f"cannot write to {out}: {reason}; pass a folder that can be written as --out"
        ) from error
    return records


def _keep_other_sets(out: Path, wanted: set[tuple[str, str | None]]) -> None:
    """Refuse a folder whose manifest lists a mesh that is not wanted, by path and source."""
    for name in MANIFEST_NAMES:
        manifest = out / name
        if not manifest.is_file():
            continue
        other = next((r for r in read_manifest(manifest) if (r.path, r.source) not in wanted), None)
        # The generator's manifest goes by one name; the other would hide it from a reader.
        if other is not None or name != MANIFEST:
            what = other.path if other is not None else "the meshes"
            raise ObjectError(
                f"{manifest}: lists {what} of another set; pass an empty folder as --out, "
                "or delete that set"
            )


def shows_every_kind(seed: int) -> bool:
    """Whether the benchmark's mugs and bowls show every body, handle, style, outline and rim."""

    def streams(category: str) -> list[np.random.Generator]:
        return [
            stream(split=BENCHMARK_SPLIT, category=category, index=index, seed=seed)
            for index in range(BENCHMARK_COUNTS[category])
        ]

    mugs = [MugParams.draw(random) for random in streams("mug")]
    bowls = [BowlParams.draw(random) for random in streams("bowl")]
    return (
        {mug.body for mug in mugs} == set(Body)
        and {mug.handle.kind for mug in mugs} == set(Handle)
        and {bowl.style for bowl in bowls} == set(Style)
        and {bowl.outline for bowl in bowls} == set(Outline)
        and {bowl.rim for bowl in bowls} == set(Rim)
    )


def pybullet_mug() -> Record:
    """Describe the mug that PyBullet ships: metres, z up, its handle along +y; not watertight."""
    package, path = "pybullet_data", "objects/mug.obj"
    found = importlib.util.find_spec(package)
    if found is None or not found.submodule_search_locations:
        raise ObjectError(f"package '{package}' is not installed; `pip install pybullet` has it")
    file = Path(next(iter(found.submodule_search_locations))) / path
    mesh = trimesh.load_mesh(file, process=False)
    x, y, z = (round(float(extent), 6) for extent in mesh.extents)
    return Record(
        path=path,
        category="mug",
        name="mug_pybullet",
        package=package,
        extents_m=(x, y, z),
        watertight=bool(mesh.is_watertight),
        sha256=sha256_of(file.read_bytes()),
        license="Zlib (Bullet Physics), distributed with pybullet",
        source="pybullet_data",
    )


def _split(name: str) -> Split:
    try:
        return Split(name)
    except ValueError:
        names = ", ".join(split.value for split in Split)
        raise ObjectError(f"no split is named '{name}'; use one of {names}") from None
