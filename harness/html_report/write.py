"""Makes the report of a run and writes it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from harness.calibration.summary import summarise_run
from harness.errors import InputError
from harness.html_report.comparison import compare
from harness.html_report.content import Fact, Page
from harness.html_report.curves import calibration_grid, curve_data
from harness.html_report.names import reference_model
from harness.html_report.pictures import scene_pictures
from harness.html_report.provenance import provenance
from harness.html_report.render import render_page
from harness.html_report.scenes import (
    FAILED,
    MISSED,
    picker_data,
    picker_size,
    rank_scenes,
    ranking_rule,
)
from harness.html_report.tables import (
    brief_grids,
    every_measure_grid,
    failures_grid,
    missed_grid,
    scene_grid,
    sweep_grid,
)
from harness.html_report.timings import timing_grid
from harness.html_report.verdict import difference_grid, verdict
from harness.results import finished_run, tabulate
from harness.runs.atomic import write_text
from harness.runs.records import read_records, read_timings
from harness.table.cells import explanation, millimetres

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from harness.calibration.summary import Calibration
    from harness.config import Config
    from harness.html_report.comparison import RunComparison
    from harness.html_report.pictures import ScenePicture
    from harness.html_report.scenes import RankedScene
    from harness.runs.directory import RunDirectory
    from harness.runs.records import Record, Timing

CURVES_ABOUT = (
    "Curves are means over scenes of the risk among the points that are kept, the surest first; "
    "the area under one is its AURC. Reliability is of the points of all scenes together, in 15 "
    "bins of equal width: a larger marker holds more points. Scores that are no probabilities are "
    "read as if they were, and are not drawn where they leave [0, 1]. A curve is of the scenes "
    "that define its score: a missed target has no seed's score, no recalibration and no closeness."
)
FILE = "report.html"
MOST_PICTURE_BYTES = 1_600_000
"""Of all scenes' pictures, so that the page stays below 10 MB with its library and its numbers."""


@dataclass(frozen=True)
class Report:
    """A report that was written.

    Attributes
    ----------
    file
        The page.
    bytes
        Its size.
    scenes, failed, missed
        Scenes of the run, those that failed, and those whose target was missed.
    pictured
        Scenes with pictures.
    verdict
        The headline.
    lacking
        Which sections lack data and why.
    seconds
        What it took.
    """

    file: Path
    bytes: int
    scenes: int
    failed: int
    missed: int
    pictured: int
    verdict: str
    lacking: tuple[str, ...]
    seconds: float


def write_report(
    folder: Path,
    *,
    against: Path | None = None,
    out: Path | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Report:
    """Write a finished run as one HTML file.

    The same runs give the same bytes.

    Parameters
    ----------
    folder
        Of the run.
    against
        Folder of a run of the same scenes to compare it with.
    out
        The file; by default ``report.html`` in the run's folder.
    progress
        Hears what is being done.

    Raises
    ------
    InputError
        A folder without a finished run of this version; runs that share no scene; a file that
        cannot be written.
    """
    begun = time.perf_counter()
    run = finished_run(folder)
    file = folder / FILE if out is None else out
    if file.is_dir():
        raise InputError(f"--out {file} is a folder; name a file in it, such as {file / FILE}")
    if not file.absolute().parent.is_dir():
        raise InputError(f"cannot write {file}: there is no folder {file.parent}; make it first")
    progress("reading records")
    config, records = run.config(), read_records(run.records_path)
    timings = read_timings(run.timings_path) if run.timings_path.exists() else []
    if not records:
        raise InputError(f"{run.records_path} holds no record; run the benchmark again")
    comparison = None
    if against is not None:
        progress(f"comparing with {against}")
        comparison = compare(folder, against)
    lacking: list[str] = []
    progress("reading recordings")
    calibration = _calibration(run, records, lacking)
    tolerance_m = config.protocol.reported_tolerance_m
    reported = [record for record in records if record.tolerance_m == tolerance_m]
    model = reference_model(record.model for record in reported)
    ranked = rank_scenes(reported, model=model)
    pictures = _pictures(
        run, ranked, model=model, tolerance_m=tolerance_m, lacking=lacking, progress=progress
    )
    progress("tabulating")
    page = _page(
        run,
        config=config,
        records=records,
        timings=timings,
        ranked=ranked,
        model=model,
        calibration=calibration,
        pictured=bool(pictures),
        comparison=comparison,
        lacking=lacking,
    )
    unpictured = (
        "No pictures: the worst and the median scenes alone have them, where they were recorded."
    )
    text = render_page(
        page,
        curves=curve_data(calibration) if calibration is not None else None,
        scenes=picker_data(ranked, pictures=pictures, unpictured=unpictured),
    )
    write_text(file, text)
    return Report(
        file=file,
        bytes=len(text.encode()),
        scenes=len(ranked),
        failed=sum(item.state == FAILED for item in ranked),
        missed=sum(item.state == MISSED for item in ranked),
        pictured=len(pictures),
        verdict=page.verdict.lead,
        lacking=tuple(lacking),
        seconds=time.perf_counter() - begun,
    )


def _calibration(
    run: RunDirectory, records: Sequence[Record], lacking: list[str]
) -> Calibration | None:
    """Summarise a run's recordings; None where it has none, with the reason in `lacking`."""
    scored = {record.scene_id for record in records if record.status == "ok"}
    if scored.intersection(run.recorded()):
        found = summarise_run(run, partly=True)
        if lost := found.lost_scenes:
            lacking.append(
                f"No recording of {len(lost)} of {len(scored)} scored scenes (the first: "
                f"{lost[0]}): curves and pictures leave them out; make them again with `harness "
                f"bench --out {run.folder}`."
            )
        return found
    if not scored:
        why = "every scene failed; tracebacks are in the run's logs."
    elif run.config().run.record == "nothing":
        why = (
            'the run was made with record = "nothing" in [run]; run it again with "all" to have '
            "them."
        )
    else:
        why = f"there are no recordings in {run.recordings}; run the benchmark again to have them."
    lacking.append(f"No curves and no pictures: {why}")
    return None


def _pictures(
    run: RunDirectory,
    ranked: Sequence[RankedScene],
    *,
    model: str,
    tolerance_m: float,
    lacking: list[str],
    progress: Callable[[str], None],
) -> dict[str, list[ScenePicture]]:
    """Draw the worst and the median scenes, as far as they are recorded and there is room."""
    recorded = set(run.recorded())
    chosen = [
        item.scene_id
        for item in ranked
        # A failed scene's recording is an earlier sitting's.
        if item.group in ("worst", "median") and item.state != FAILED and item.scene_id in recorded
    ]
    pictures: dict[str, list[ScenePicture]] = {}
    room = MOST_PICTURE_BYTES
    for number, scene_id in enumerate(chosen, start=1):
        progress(f"drawing {scene_id} ({number} of {len(chosen)})")
        recording = run.recording(scene_id)
        found = list(scene_pictures(recording, model=model, tolerance_m=tolerance_m))
        room -= sum(len(item.data) for item in found)
        if room < 0:
            lacking.append(
                f"Pictures of {len(pictures)} scenes only, the worst first: there is no room for "
                f"those of {len(chosen)}."
            )
            break
        pictures[scene_id] = found
    return pictures


def _page(
    run: RunDirectory,
    *,
    config: Config,
    records: Sequence[Record],
    timings: Sequence[Timing],
    ranked: Sequence[RankedScene],
    model: str,
    calibration: Calibration | None,
    pictured: bool,
    comparison: RunComparison | None,
    lacking: Sequence[str],
) -> Page:
    table = tabulate(records, config=config)
    tolerance_m = table.reported_tolerance_m
    losses = (failures_grid(records), missed_grid(ranked))
    segmenters = " and ".join(sorted({record.segmenter for record in records}))
    scene_models = len({record.model for record in records})
    classes = ", ".join(config.run.classes)
    return Page(
        title=run.folder.resolve().name,
        subtitle=(
            f"{len(ranked)} scenes of {classes}, {config.scenes.views} views each, "
            f"{scene_models} models, masks by {segmenters}; a point lies on the mesh within "
            f"{millimetres(tolerance_m)}"
        ),
        source=str(run.folder),
        verdict=verdict(table, records, seed=config.run.seed),
        facts=_facts(ranked, records=records),
        lacking=lacking,
        losses=[grid for grid in losses if grid is not None],
        comparison=comparison,
        tables=brief_grids(table),
        tables_about=explanation(table),
        differences=difference_grid(table),
        every_measure=every_measure_grid(table),
        sweep=sweep_grid(table),
        curves=calibration is not None,
        curves_about=CURVES_ABOUT if calibration is not None else lacking[0],
        calibration=None if calibration is None else calibration_grid(calibration),
        pictured=pictured,
        scenes_about=_scenes_about(ranked, model=model, tolerance_m=tolerance_m),
        scene_table=scene_grid(ranked, model=model),
        timings=timing_grid(timings) if timings else None,
        timings_lacking=f"{run.timings_path} is missing or empty: no timings.",
        provenance=provenance(run, config),
    )


def _scenes_about(ranked: Sequence[RankedScene], *, model: str, tolerance_m: float) -> str:
    held = picker_size(ranked)
    rest = "" if held == len(ranked) else f" Only the worst {held} of {len(ranked)} are listed."
    return ranking_rule(model, tolerance_m=tolerance_m) + rest


def _facts(ranked: Sequence[RankedScene], *, records: Sequence[Record]) -> list[Fact]:
    failed = sum(item.state == FAILED for item in ranked)
    missed = sum(item.state == MISSED for item in ranked)
    objects = len({record.object_name for record in records})
    return [
        Fact(str(len(ranked) - failed), "scenes scored"),
        Fact(str(objects), "objects"),
        Fact(str(failed), "scenes failed", "bad" if failed else ""),
        Fact(str(missed), "targets missed", "bad" if missed else ""),
    ]
