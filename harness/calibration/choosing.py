"""Thresholds chosen on a run, with what they keep there, on held-out objects and in another run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from harness.calibration.losses import (
    THRESHOLDS,
    Kept,
    judge_threshold,
    object_losses,
)
from harness.calibration.read import BOX, read_points
from harness.calibration.threshold import Choice, Goal, choose_threshold
from harness.errors import InputError
from harness.runs.directory import MANIFEST
from harness.runs.job import split_identity

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from harness.calibration.losses import Losses
    from harness.calibration.read import RecordedPoints
    from harness.calibration.series import ScenePoints
    from harness.runs.directory import RunDirectory


@dataclass(frozen=True, kw_only=True)
class Validation:
    """A choice made again and again on half of the objects and checked on the other.

    Attributes
    ----------
    splits
        Number of random halves.
    objects_chosen_on, objects_held_out
        Number of objects in each half.
    chosen
        Number of splits in which a threshold was found.
    mean_precision
        Over those splits, the mean share of true points among the kept ones of held-out objects; a
        scene that keeps none counts as 1. None without such a split.
    mean_precision_of_all
        Over all splits; one without a threshold keeps nothing and counts as 1. The guarantee in
        expectation is that it is not below the goal, up to the chance of these objects.
    held
        Share of the splits with a threshold in which the held-out precision reached the goal;
        None without such a split. The guarantee with probability 1 - delta is on the precision of
        the population, of which the held-out objects' is an estimate.
    thresholds
        Least, middle and greatest threshold chosen; None without one.
    """

    splits: int
    objects_chosen_on: int
    objects_held_out: int
    chosen: int
    mean_precision: float | None
    mean_precision_of_all: float
    held: float | None
    thresholds: tuple[float, float, float] | None


@dataclass(frozen=True, kw_only=True)
class ThresholdReport:
    """A threshold chosen on a run's recordings.

    Attributes
    ----------
    folder, model, completion, classes, tolerance_m
        What it was chosen on.
    goal, choice
        What was asked, and the answer.
    kept
        What it keeps there, over all classes (``all``) and of each, by class; empty without a
        threshold.
    validation
        On held-out halves; None unless asked for.
    judged_folder, judged
        The run that it was judged on, and what it keeps there; None and empty unless asked for.
    """

    folder: Path
    model: str
    completion: str
    classes: tuple[str, ...]
    tolerance_m: float
    goal: Goal
    choice: Choice
    kept: Mapping[str, Kept]
    validation: Validation | None
    judged_folder: Path | None
    judged: Mapping[str, Kept]


@dataclass(frozen=True, kw_only=True)
class ThresholdOptions:
    """What a person chooses.

    Attributes
    ----------
    goal
        What is asked of the threshold.
    model
        Whose confidence.
    completion
        Test set, as records state it; None for the run's completed points, and the box's
        (``none``) of a run without.
    classes
        All of the run where none is named.
    tolerance_m
        Distance within which a point lies on the mesh, metres; None for the one the run reports.
    splits
        Number of random halves to validate on; None for no validation.
    judge
        A run of other objects to judge the threshold on.
    """

    goal: Goal
    model: str = "metric"
    completion: str | None = None
    classes: Sequence[str] = ()
    tolerance_m: float | None = None
    splits: int | None = None
    judge: RunDirectory | None = None


def find_threshold(run: RunDirectory, options: ThresholdOptions) -> ThresholdReport:
    """Choose a threshold on a run, and check it as asked.

    Raises
    ------
    InputError
        A run that `read_points` refuses; too few objects to split; a run to judge on that shares
        objects with the other.
    """
    asked = () if options.completion is None else (options.completion,)
    read = read_points(
        run,
        models=[options.model],
        classes=options.classes,
        completions=asked,
        tolerance_m=options.tolerance_m,
    )
    completion = _the_completion(run, read.completions)
    scenes = _by_class(read, completion)
    losses = object_losses([scene for group in scenes.values() for scene in group])
    choice = choose_threshold(losses, options.goal)
    kept, judged = {}, {}
    if choice.threshold is not None:
        kept = _judge(scenes, choice.threshold, seed=read.seed)
    if options.judge is not None:
        judged_points = read_points(
            options.judge,
            models=[options.model],
            classes=read.classes,
            completions=[completion],
            tolerance_m=read.tolerance_m,
        )
        others = _by_class(judged_points, completion)
        _check_apart(run, scenes, options.judge, others)
        if choice.threshold is not None:
            judged = _judge(others, choice.threshold, seed=read.seed)
    return ThresholdReport(
        folder=run.folder,
        model=options.model,
        completion=completion,
        classes=tuple(scenes),
        tolerance_m=read.tolerance_m,
        goal=options.goal,
        choice=choice,
        kept=kept,
        validation=(
            validate(losses, options.goal, splits=options.splits, seed=read.seed)
            if options.splits is not None
            else None
        ),
        judged_folder=options.judge.folder if options.judge else None,
        judged=judged,
    )


def validate(losses: Losses, goal: Goal, *, splits: int, seed: int) -> Validation:
    """Choose on random halves of the objects and check on the others.

    Parameters
    ----------
    losses
        Of all objects.
    goal
        What is asked.
    splits
        Number of random halves.
    seed
        Of the halves.

    Raises
    ------
    InputError
        No splits; half of the objects are too few for the goal.
    """
    count = len(losses.objects)
    half = count // 2
    if splits < 1:
        raise InputError(f"--splits {splits} is none; pass a number such as 200")
    if half < goal.least_objects:
        raise InputError(
            f"{count} objects cannot be split for a validation: half of them are {half}, and "
            f"{goal.keep_precision:g} needs {goal.least_objects}; ask for less precision, or run "
            "scenes of more objects"
        )
    rng = np.random.Generator(np.random.Philox(seed))
    thresholds, precisions = [], []
    for _ in range(splits):
        order = rng.permutation(count)
        choice = choose_threshold(losses.of(order[:half]), goal)
        if choice.threshold is not None:
            at = int(np.searchsorted(THRESHOLDS, choice.threshold))
            thresholds.append(choice.threshold)
            precisions.append(1.0 - float(losses.false_share[order[half:], at].mean()))
    found = len(thresholds)
    reached = np.array(precisions) >= goal.keep_precision
    return Validation(
        splits=splits,
        objects_chosen_on=half,
        objects_held_out=count - half,
        chosen=found,
        mean_precision=float(np.mean(precisions)) if found else None,
        mean_precision_of_all=(sum(precisions) + splits - found) / splits,
        held=float(reached.mean()) if found else None,
        thresholds=(
            (min(thresholds), float(np.median(thresholds)), max(thresholds)) if found else None
        ),
    )


def _the_completion(run: RunDirectory, have: Sequence[str]) -> str:
    completed = [name for name in have if name != BOX]
    if len(completed) > 1:
        raise InputError(
            f"{run.folder} has several completions; pass --completion with one of: "
            f"{', '.join(have)}"
        )
    return completed[0] if completed else BOX


def _by_class(read: RecordedPoints, completion: str) -> dict[str, Sequence[ScenePoints]]:
    """Scenes of a test set, by class in the run's order; one model was read."""
    (model,) = read.models
    cells = {name: (name, completion, model) for name in read.classes}
    return {name: read.cells[cell] for name, cell in cells.items() if cell in read.cells}


def _judge(
    scenes: Mapping[str, Sequence[ScenePoints]], threshold: float, *, seed: int
) -> dict[str, Kept]:
    groups = {"all": [scene for group in scenes.values() for scene in group], **scenes}
    return {
        name: judge_threshold(group, threshold, seed=seed)
        for name, group in groups.items()
        if name != "all" or len(scenes) > 1
    }


def _check_apart(
    run: RunDirectory,
    ours: Mapping[str, Sequence[ScenePoints]],
    other: RunDirectory,
    theirs: Mapping[str, Sequence[ScenePoints]],
) -> None:
    """Refuse to judge a threshold on objects that it was chosen on, by their files' content."""
    chosen_on, judged_on = _names_by_content(run, ours), _names_by_content(other, theirs)
    if shared := sorted(
        (judged_on[content], content) for content in chosen_on.keys() & judged_on.keys()
    ):
        name, content = shared[0]
        known = chosen_on[content]
        also = "" if known == name else f", there called {known}"
        raise InputError(
            f"{other.folder} shares {len(shared)} objects with {run.folder} (the first: "
            f"{name}{also}): a threshold is judged on objects that it was not chosen on"
        )


def _names_by_content(
    run: RunDirectory, scenes: Mapping[str, Sequence[ScenePoints]]
) -> dict[str, str]:
    """Names of the objects that scenes are of, by the sha256 of their files."""
    contents = dict(map(split_identity, run.manifest()["objects"]))
    names = {f"{item.category}/{item.object_name}" for group in scenes.values() for item in group}
    if unknown := sorted(names - contents.keys()):
        raise InputError(
            f"{run.folder / MANIFEST} does not list the object {unknown[0]}, of which the run has "
            "scenes; it is damaged: run the benchmark again, into another folder"
        )
    return {contents[name]: name.partition("/")[2] for name in names}
