"""Reading what a run recorded, and saying what it lacks."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from harness.calibration.series import ScenePoints, scene_points
from harness.errors import InputError
from harness.results import finished_run
from harness.runs.records import read_records

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from harness.config import Config
    from harness.recordings.recording import Recording
    from harness.runs.directory import RunDirectory

BOX = "none"
"""The test set that is no completion's."""

Cell = tuple[str, str, str]
"""Class, completion, model."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedPoints:
    """All answers of a run that were asked for.

    Attributes
    ----------
    folder
        The run's.
    tolerance_m
        Distance within which a point lies on a mesh, metres.
    seed
        The run's, for resampling.
    classes, completions, models
        What the cells are of, in order.
    cells
        Scenes of each class, completion and model, by scene id; scenes without a point of the test
        set, for want of a completion, are left out.
    empty_classes
        Classes of the run without a recorded scene, for all failed.
    lost_scenes
        Scored scenes whose recording is missing.
    """

    folder: Path
    tolerance_m: float
    seed: int
    classes: tuple[str, ...]
    completions: tuple[str, ...]
    models: tuple[str, ...]
    cells: Mapping[Cell, Sequence[ScenePoints]]
    empty_classes: tuple[str, ...]
    lost_scenes: tuple[str, ...]


def read_points(
    run: RunDirectory,
    *,
    models: Sequence[str] = (),
    classes: Sequence[str] = (),
    completions: Sequence[str] = (),
    tolerance_m: float | None = None,
    partly: bool = False,
) -> RecordedPoints:
    """Read answers from a finished run's recordings.

    Scenes that failed do not count, and what an earlier sitting recorded of them is left alone.

    Parameters
    ----------
    run
        The run.
    models, classes, completions
        Which; all of the run where none is named.
    tolerance_m
        Distance within which a point lies on a mesh, metres; by default the one that the run
        reports. Any will do, for distances are recorded.
    partly
        Read what there is where recordings of scored scenes are missing.

    Raises
    ------
    InputError
        No run, an unfinished one, one of another record schema or one without recordings; a scored
        scene without its recording, unless `partly`; a damaged recording; a model, class or
        completion that the run does not have; a tolerance that is no distance.
    """
    config, scene_ids, lost = _recorded(run, partly=partly)
    if tolerance_m is None:
        tolerance_m = config.protocol.reported_tolerance_m
    if not (math.isfinite(tolerance_m) and tolerance_m > 0):
        raise InputError(f"a tolerance of {tolerance_m} m is no distance; pass one such as 0.005")
    chosen = _choose(run, "class", asked=classes, have=config.run.classes)
    cells: defaultdict[Cell, list[ScenePoints]] = defaultdict(list)
    found: set[str] = set()
    for scene_id in scene_ids:
        recording = run.recording(scene_id)
        answered = _choose(run, "model", asked=models, have=tuple(recording.answers))
        _check_numbers(run, recording, answered)
        filled = [
            item.completion
            for item in recording.test_sets
            if item.part.stop > item.part.start and recording.category in chosen
        ]
        found.update(filled)
        for completion in filled:
            if completions and completion not in completions:
                continue
            for model in answered:
                points = scene_points(
                    recording, completion=completion, model=model, tolerance_m=tolerance_m
                )
                cells[recording.category, completion, model].append(points)
    recorded = {category for category, _, _ in cells}
    empty = tuple(name for name in chosen if name not in recorded)
    order = sorted(found, key=lambda name: (name != BOX, name))
    if found:
        _choose(run, "completion", asked=completions, have=order)
    if empty and (classes or not cells):
        raise InputError(
            f"{run.folder} has no recorded scene of class '{empty[0]}': all its scenes failed; "
            f"their reasons are in {run.records_path}"
        )
    return RecordedPoints(
        folder=run.folder,
        tolerance_m=tolerance_m,
        seed=config.run.seed,
        classes=chosen,
        completions=tuple(name for name in order if not completions or name in completions),
        models=tuple(dict.fromkeys(model for _, _, model in cells)),
        cells=cells,
        empty_classes=empty,
        lost_scenes=lost,
    )


def _recorded(run: RunDirectory, *, partly: bool) -> tuple[Config, list[str], tuple[str, ...]]:
    """Return a finished run's configuration, its recorded scenes and those that lack it."""
    folder = run.folder
    config = finished_run(folder).config()
    recorded = set(run.recorded())
    if not recorded:
        raise InputError(f"{folder} has no recordings: {run.without_recordings()}")
    # What the records call scored, for a failed scene may have a recording from before.
    records = read_records(run.records_path)
    scored = {record.scene_id for record in records if record.status == "ok"}
    lost = sorted(scored - recorded)
    if lost and not partly:
        raise InputError(
            f"{folder} has no recording of {len(lost)} of its {len(scored)} scenes (the first: "
            f"{lost[0]}); make them again with `harness bench --out {folder}`"
        )
    return config, sorted(scored & recorded), tuple(lost)


def _check_numbers(run: RunDirectory, recording: Recording, models: Sequence[str]) -> None:
    """Refuse a recording whose answers no run can have written."""
    missed = recording.target_id is None
    columns = {"distances_m": recording.distances_m}
    if not missed:
        columns["data_distance_m"] = recording.data_distance_m
    for model in models:
        answers = recording.answers[model]
        for name in ("probability", "confidence", "score", "variance"):
            columns[f"{name} of {model}"] = getattr(answers, name)
    for name, values in columns.items():
        if not np.isfinite(values).all():
            raise InputError(
                f"{run.folder}: the recording of {recording.scene_id} is damaged (its {name} holds "
                "what is no number); delete it and resume the run with `harness bench --out`"
            )


def _choose(
    run: RunDirectory, what: str, *, asked: Sequence[str], have: Sequence[str]
) -> tuple[str, ...]:
    """Return what is asked for, all where nothing is; InputError where the run has it not."""
    for name in asked:
        if name not in have:
            raise InputError(f"{run.folder} has no {what} '{name}'; it has: {', '.join(have)}")
    return tuple(dict.fromkeys(asked)) or tuple(have)
