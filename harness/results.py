"""Finished runs, read again: their tables, their confusions, and two of them side by side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from harness.config import Config, differing_values
from harness.errors import InputError
from harness.protocol import test_set_of
from harness.runs.confusion import Confusion, read_confusion
from harness.runs.directory import CONFIG, RunDirectory
from harness.runs.records import SCHEMA_VERSION, Record, read_records
from harness.same_scene import unlike as unlike_scene
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
    first, second
        Folders of the runs.
    model_a, model_b
        The first run's model, and the second's that is subtracted from it.
    differences
        The first run's values less the second's, at the reported tolerance: one family of tests.
    scenes
        Number of scenes compared.
    empty
        Classes of which no scene is compared: which, why, and what to do.
    unlike
        Scenes of one id that are not the same in both runs, and why.
    only_first, only_second
        Number of scenes that one run alone holds.
    settings
        What is configured differently: key, the first run's value, the second's.
    """

    first: Path
    second: Path
    model_a: str
    model_b: str
    differences: Sequence[Difference]
    scenes: int
    empty: Sequence[str]
    unlike: Sequence[str]
    only_first: int
    only_second: int
    settings: Sequence[tuple[str, Any, Any]]


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """A finished run's configuration and records, read once for several questions."""

    folder: Path
    config: Config
    records: Sequence[Record]


def read_run(folder: Path) -> FinishedRun:
    """Read a finished run.

    Raises
    ------
    InputError
        As `finished_run`; damaged records.
    """
    run = finished_run(folder)
    return FinishedRun(folder, run.config(), read_records(run.records_path))


def show_run(folder: Path) -> Table:
    """Read a finished run's table.

    Raises
    ------
    InputError
        The folder holds no run, or an unfinished one.
    """
    run = finished_run(folder)
    return tabulate(read_records(run.records_path), config=run.config())


def show_confusion(folder: Path) -> list[Confusion]:
    """Read a finished run's confusion at the reported tolerance; raises like `show_run`."""
    run = finished_run(folder)
    tolerance_m = run.config().protocol.reported_tolerance_m
    return [row for row in read_confusion(run.confusion_path) if row.tolerance_m == tolerance_m]


def is_cluttered(folder: Path) -> bool:
    """Whether a run's scenes hold more than their targets; raises like `show_run`."""
    return finished_run(folder).config().scenes.cluttered


def tabulate(records: Sequence[Record], *, config: Config) -> Table:
    """Make the table of a run's records."""
    return summarise(
        records,
        reported_tolerance_m=config.protocol.reported_tolerance_m,
        classes=config.run.classes,
        seed=config.run.seed,
    )


def compare_runs(first: Path, second: Path, *, model_a: str, model_b: str) -> Comparison:
    """Compare a model of one run with a model of another: see `compare_finished`.

    Parameters
    ----------
    first, second
        Folders of finished runs.
    model_a, model_b
        The first run's model, and the second's that is subtracted from it.

    Raises
    ------
    InputError
        As `read_run` and `compare_finished`.
    """
    return compare_finished(read_run(first), read_run(second), model_a=model_a, model_b=model_b)


def compare_finished(
    first: FinishedRun, second: FinishedRun, *, model_a: str, model_b: str
) -> Comparison:
    """Compare a model of one run with a model of another, scene by scene.

    Scenes are the same as `harness.same_scene` says.

    Parameters
    ----------
    first, second
        The runs.
    model_a, model_b
        The first run's model, and the second's that is subtracted from it.

    Raises
    ------
    InputError
        A run without the model; runs that report at different tolerances or share no scene.
    """
    ours, theirs = first.config, second.config
    tolerance_m = ours.protocol.reported_tolerance_m
    if tolerance_m not in theirs.protocol.tolerances_m:
        raise InputError(
            f"{second.folder} was not scored at {tolerance_m} m, the tolerance that "
            f"{first.folder} reports; add it to protocol.tolerances_m and run {second.folder} again"
        )
    a, b = (
        _of_model(run, model, tolerance_m=tolerance_m)
        for run, model in ((first, model_a), (second, model_b))
    )
    scenes_a, scenes_b = ({record.scene_id for record in records} for records in (a, b))
    sets_a, sets_b = (
        {(record.scene_id, test_set_of(record.completion)): record for record in records}
        for records in (a, b)
    )
    unlike = {}
    for key in sorted(sets_a.keys() & sets_b.keys()):
        if why := unlike_scene(sets_a[key], sets_b[key]):
            unlike[key[0]] = why
    differences = paired_differences(
        [record for record in a if record.scene_id not in unlike],
        [record for record in b if record.scene_id not in unlike],
        classes=ours.run.classes,
        seed=ours.run.seed,
    )
    if not differences:
        reason = f" ({next(iter(unlike.values()))})" if unlike else ""
        settings = [key for key, *_ in differing_values(ours=ours, theirs=theirs)]
        asked = [key for key in settings if key.startswith(("run.", "scenes.", "protocol."))]
        differ = f"; they differ in {', '.join(asked)}" if asked else ""
        raise InputError(
            f"{first.folder} and {second.folder} share no scene that both scored{reason}; run "
            f"both with the same run.seed, run.classes, scenes and protocol.test_sets{differ}"
        )
    folders = (first.folder, second.folder)
    return Comparison(
        first=first.folder,
        second=second.folder,
        model_a=model_a,
        model_b=model_b,
        differences=differences,
        scenes=len({r.scene_id for r in a if r.status == "ok"} & _scored(b) - unlike.keys()),
        empty=_empty_classes(ours.run.classes, differences, runs=folders, records=(a, b)),
        unlike=[f"{scene_id}: {why}" for scene_id, why in unlike.items()],
        only_first=len(scenes_a - scenes_b),
        only_second=len(scenes_b - scenes_a),
        settings=differing_values(ours=ours, theirs=theirs),
    )


def _empty_classes(
    classes: Sequence[str],
    differences: Sequence[Difference],
    *,
    runs: tuple[Path, Path],
    records: tuple[Sequence[Record], Sequence[Record]],
) -> list[str]:
    """Say of which classes no scene is compared, and how many each run scored."""
    compared = {item.category for item in differences}
    lines = []
    for category in classes:
        if category in compared:
            continue
        counts = []
        for folder, items in zip(runs, records, strict=True):
            of_class = [record for record in items if record.category == category]
            scenes = len({record.scene_id for record in of_class})
            counts.append(f"{folder} scored {len(_scored(of_class))} of its {scenes} scenes")
        lines.append(
            f"No scene of class '{category}' is compared: {', '.join(counts)}; failed scenes are "
            "tried again with `harness bench --out RUN`"
        )
    return lines


def _scored(records: Sequence[Record]) -> set[str]:
    return {record.scene_id for record in records if record.status == "ok"}


def _of_model(run: FinishedRun, model: str, *, tolerance_m: float) -> list[Record]:
    chosen = [r for r in run.records if r.model == model and r.tolerance_m == tolerance_m]
    if not chosen:
        have = ", ".join(sorted({record.model for record in run.records})) or "none"
        raise InputError(f"{run.folder} has no records of model '{model}'; it has: {have}")
    return chosen


def finished_run(folder: Path) -> RunDirectory:
    """Open a run that is finished and was written with this version's record schema.

    Raises
    ------
    InputError
        The folder holds no run, an unfinished one, or one of another schema version.
    """
    run = open_checked(folder)
    if not run.records_path.exists():
        raise InputError(f"{folder} is unfinished; finish it with `harness bench --out {folder}`")
    return run


def open_checked(folder: Path) -> RunDirectory:
    """Open a run, finished or not, that was written with this version's record schema.

    Raises
    ------
    InputError
        The folder holds no run, or one of another schema version.
    """
    if not RunDirectory.is_run(folder):
        raise InputError(f"{folder} holds no run; pass the folder that `harness bench` named")
    run = RunDirectory(folder)
    manifest = run.manifest()
    # Before any table is read, for another schema's columns would say less.
    if (written := manifest["schema_version"]) != SCHEMA_VERSION:
        match manifest["sessions"]:
            case [*_, {"git": {"revision": str(revision)}}]:
                by = f" (git revision {revision})"
            case _:
                by = ""
        raise InputError(
            f"{folder} was written with record schema {written}, this version reads "
            f"{SCHEMA_VERSION}; read it with the version that wrote it{by}, or run it again with "
            f"`harness bench --config {folder / CONFIG}`"
        )
    return run
