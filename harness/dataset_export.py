"""The scenes of a run as a BOP dataset, from which `harness run` gets the same records.

Beside what `sim_scenes.bop` writes, the dataset's root holds ``harness_config.toml``: the run's
configuration, less the number of workers and the folder of meshes, which the dataset holds itself.
A scene is named by its id in the run, and its first object is the target.
"""

from __future__ import annotations

import os
import shutil
import time
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from harness.bench import load_objects
from harness.config import Config, Override, load_config
from harness.errors import InputError
from harness.runs.atomic import write_text
from harness.runs.job import SceneJob, plan_jobs
from harness.runs.progress import Progress, SilentProgress
from harness.scene_run import simulate_job
from sim_scenes import BopError, SceneError, write_bop

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from sim_scenes import Scene

CONFIG_FILE = "harness_config.toml"


@dataclass(frozen=True)
class ExportOptions:
    """Which scenes to write; None leaves a choice to the configuration.

    Attributes
    ----------
    out
        Root of the new dataset; absent or empty.
    scenes, seed, objects, config
        As for a benchmark.
    cluttered
        Put other objects around the targets.
    """

    out: Path
    scenes: int | None = None
    seed: int | None = None
    objects: Path | None = None
    config: Path | None = None
    cluttered: bool = False


@dataclass(frozen=True)
class ExportResult:
    """A dataset that was written.

    Attributes
    ----------
    scenes
        Number of scenes asked for, failed ones included.
    failures
        Why each scene that could not be simulated is not there, by scene id.
    notes
        What reading back will not give bit for bit.
    seconds
        Wall time.
    """

    folder: Path
    scenes: int
    failures: Mapping[str, str]
    notes: Sequence[str]
    seconds: float

    @property
    def all_failed(self) -> bool:
        """Whether no scene could be simulated, so that nothing was written."""
        return len(self.failures) == self.scenes


def run_export(options: ExportOptions, *, progress: Progress | None = None) -> ExportResult:
    """Simulate the scenes of a run's plan and write them as a BOP dataset, whole or not at all.

    Raises
    ------
    InputError
        Wrong options, configuration or objects; a folder that is taken or cannot be written.
    """
    start = time.monotonic()
    progress, out = progress or SilentProgress(), options.out
    config = _configuration(options)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} exists and is not an empty folder; name a new one with --out")
    jobs = plan_jobs(config, load_objects(config.scenes.objects))
    failures: dict[str, str] = {}
    staged = out.with_name(f".{out.name}.export-{os.getpid()}")
    try:
        with progress.watch(folder=out, scenes=len(jobs), finished=0):
            scenes = _simulated(jobs, config=config, failures=failures, progress=progress)
            notes = write_bop(scenes, staged)
        if len(failures) < len(jobs):
            write_text(staged / CONFIG_FILE, _config_text(config, failures))
            staged.replace(out)
    except (BopError, OSError) as error:
        message = str(error).replace(str(staged), str(out))
        raise InputError(message) from error
    finally:
        shutil.rmtree(staged, ignore_errors=True)
    return ExportResult(
        folder=out,
        scenes=len(jobs),
        failures=failures,
        notes=notes,
        seconds=time.monotonic() - start,
    )


def _configuration(options: ExportOptions) -> Config:
    objects = None if options.objects is None else str(options.objects.resolve())
    chosen = (
        Override("run.scenes", options.scenes, "--scenes"),
        Override("run.seed", options.seed, "--seed"),
        Override("scenes.objects", objects, "--objects"),
        Override("scenes.cluttered", options.cluttered or None, "--cluttered"),
    )
    overrides = tuple(override for override in chosen if override.value is not None)
    return load_config(options.config, overrides=overrides)


def _simulated(
    jobs: Sequence[SceneJob], *, config: Config, failures: dict[str, str], progress: Progress
) -> Iterator[Scene]:
    """Simulate the scenes one by one; one that cannot be drawn goes to `failures`."""
    for job in jobs:
        start = time.monotonic()
        try:
            scene = simulate_job(job, config)
        except SceneError as error:
            failures[job.scene_id] = str(error)
            progress.scene_failed(job.scene_id, str(error))
            continue
        yield replace(scene, name=job.scene_id)
        progress.scene_done(job.scene_id, time.monotonic() - start)


def _config_text(config: Config, failures: Mapping[str, str]) -> str:
    portable = config.model_copy(
        update={
            "run": config.run.model_copy(update={"workers": None}),
            "scenes": config.scenes.model_copy(update={"objects": None}),
        }
    )
    lines = ["# The configuration of the run whose scenes these are; `harness run` reads it."]
    lines += [
        f"# Not here, for it could not be simulated: {scene_id}: {' '.join(why.split())}"
        for scene_id, why in failures.items()
    ]
    return "\n".join(lines) + "\n\n" + portable.to_toml()
