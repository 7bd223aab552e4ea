"""Finished runs, read again: their tables, their confusions, and two of them side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from harness.config import Config, differing_values
from harness.errors import InputError
from harness.protocol import COMPLETED, test_set_of
from harness.runs.confusion import Confusion, read_confusion
from harness.runs.directory import RunDirectory
from harness.runs.records import Record, read_records
from harness.table.differences import Difference, paired_differences
from harness.table.summary import Table, summarise

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path


@dataclass(frozen=True)
class Comparison:
    """One model in each of two runs, on the scenes that both hold.

    Attributes
    ----------
    differences
        The first run's values less the second's, at the reported tolerance.
    scenes
        Number of scenes compared.
    unlike
        Scenes of one id that are not the same in both runs, and why.
    only_first, only_second
        Number of scenes that one run alone holds.
    settings
        What is configured differently: key, the first run's value, the second's.
    """

    differences: Sequence[Difference]
    scenes: int
    unlike: Sequence[str]
    only_first: int
    only_second: int
    settings: Sequence[tuple[str, Any, Any]]


def show_run(folder: Path) -> Table:
    """Read a finished run's table.

    Raises
    ------
    InputError
        The folder holds no run, or an unfinished one.
    """
    run = _finished(folder)
    return tabulate(read_records(run.records_path), config=run.config())


def show_confusion(folder: Path) -> list[Confusion]:
    """Read a finished run's confusion at the reported tolerance; raises like `show_run`."""
    run = _finished(folder)
    tolerance_m = run.config().protocol.reported_tolerance_m
    return [row for row in read_confusion(run.confusion_path) if row.tolerance_m == tolerance_m]


def is_cluttered(folder: Path) -> bool:
    """Whether a run's scenes hold more than their targets; raises like `show_run`."""
    return _finished(folder).config().scenes.cluttered


def tabulate(records: Sequence[Record], *, config: Config) -> Table:
    """Make the table of a run's records."""
    return summarise(
        records,
        reported_tolerance_m=config.protocol.reported_tolerance_m,
        classes=config.run.classes,
        seed=config.run.seed,
    )


def compare_runs(first: Path, second: Path, *, model_a: str, model_b: str) -> Comparison:
    """Compare a model of one run with a model of another, scene by scene.

    Scenes are the same where id, seed, object, number of redraws, test points and their base rate
    agree: a scene that one run had to draw again stands elsewhere in the other. Completed points
    need not agree, for each run's completer and views make its own.

    Parameters
    ----------
    first, second
        Folders of finished runs.
    model_a, model_b
        The first run's model, and the second's that is subtracted from it.

    Raises
    ------
    InputError
        A folder without a finished run; a run without the model; runs that report at different
        tolerances or share no scene.
    """
    runs = [_finished(folder) for folder in (first, second)]
    ours, theirs = (run.config() for run in runs)
    tolerance_m = ours.protocol.reported_tolerance_m
    if tolerance_m not in theirs.protocol.tolerances_m:
        raise InputError(
            f"{second} was not scored at {tolerance_m} m, the tolerance that {first} reports; "
            f"add it to protocol.tolerances_m and run {second} again"
        )
    a, b = (
        _of_model(run, model, tolerance_m=tolerance_m)
        for run, model in zip(runs, (model_a, model_b), strict=True)
    )
    scenes_a, scenes_b = ({record.scene_id for record in records} for records in (a, b))
    sets_a, sets_b = (
        {(record.scene_id, test_set_of(record.completion)): record for record in records}
        for records in (a, b)
    )
    unlike = {}
    for key in sorted(sets_a.keys() & sets_b.keys()):
        if why := _unlike(sets_a[key], sets_b[key]):
            unlike[key[0]] = why
    differences = paired_differences(
        [record for record in a if record.scene_id not in unlike],
        [record for record in b if record.scene_id not in unlike],
        classes=ours.run.classes,
        seed=ours.run.seed,
    )
    if not differences:
        reason = f" ({next(iter(unlike.values()))})" if unlike else ""
        raise InputError(
            f"{first} and {second} share no scene that both scored{reason}; run both with the "
            "same run.seed, run.classes, scenes.objects and protocol.test_sets"
        )
    return Comparison(
        differences=differences,
        scenes=len({r.scene_id for r in a if r.status == "ok"} & _scored(b) - unlike.keys()),
        unlike=[f"{scene_id}: {why}" for scene_id, why in unlike.items()],
        only_first=len(scenes_a - scenes_b),
        only_second=len(scenes_b - scenes_a),
        settings=differing_values(ours=ours, theirs=theirs),
    )


def _scored(records: Sequence[Record]) -> set[str]:
    return {record.scene_id for record in records if record.status == "ok"}


def _unlike(first: Record, second: Record) -> str | None:
    """Say why two records of one scene id and test set are not of one scene."""
    if "failed" in (first.status, second.status):
        return None
    drawn = test_set_of(first.completion) != COMPLETED
    points = ("test_points", "base_rate") if drawn else ()
    for what in ("seed", "object_name", "redraws", *points):
        ours, theirs = getattr(first, what), getattr(second, what)
        if ours != theirs:
            return f"its {what.replace('_', ' ')} is {ours} in the one and {theirs} in the other"
    return None


def _of_model(run: RunDirectory, model: str, *, tolerance_m: float) -> list[Record]:
    records = read_records(run.records_path)
    chosen = [r for r in records if r.model == model and r.tolerance_m == tolerance_m]
    if not chosen:
        have = ", ".join(sorted({record.model for record in records})) or "none"
        raise InputError(f"{run.folder} has no records of model '{model}'; it has: {have}")
    return chosen


def _finished(folder: Path) -> RunDirectory:
    if not RunDirectory.is_run(folder):
        raise InputError(f"{folder} holds no run; pass the folder that `harness bench` named")
    run = RunDirectory(folder)
    if not run.records_path.exists():
        raise InputError(f"{folder} is unfinished; finish it with `harness bench --out {folder}`")
    return run
