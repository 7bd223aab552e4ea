"""What figures are drawn from: a finished run's records and recordings."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from harness.calibration.read import read_points
from harness.errors import InputError
from harness.figures.style import plain
from harness.results import finished_run
from harness.runs.directory import RunDirectory
from harness.runs.records import read_records
from harness.table.differences import cell_order
from harness.table.summary import MODEL_ORDER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.calibration.read import RecordedPoints
    from harness.config import Config
    from harness.recordings.recording import Recording
    from harness.runs.records import Record

BOX = "none"
"""Completion of the test set that needs none."""
PREFERRED_MODEL = "metric"


class NothingToDrawError(Exception):
    """A figure's data is not in the run; the text says what is missing."""


@dataclass(frozen=True)
class Cell:
    """A class and test set: a panel of a figure.

    Attributes
    ----------
    category
        The targets' class.
    completion
        As records state it.
    """

    category: str
    completion: str

    @property
    def label(self) -> str:
        """Name in print."""
        what = "points in the box" if self.completion == BOX else f"completed ({self.completion})"
        return plain(f"{self.category}, {what}")


@dataclass(eq=False)
class RunSource:
    """A finished run, read once.

    Parameters
    ----------
    run
        Its folder.
    config
        What it was run with.
    records
        Of all tolerances, in their order.
    """

    run: RunDirectory
    config: Config
    records: Sequence[Record]

    @classmethod
    def open(cls, folder: Path) -> RunSource:
        """Read a run's records.

        Raises
        ------
        InputError
            The folder holds no run, an unfinished or damaged one, or one of another record schema.
        """
        run = finished_run(folder)
        return cls(run=run, config=run.config(), records=read_records(run.records_path))

    @property
    def tolerance_m(self) -> float:
        """Distance within which a point lies on the mesh, metres."""
        return self.config.protocol.reported_tolerance_m

    @cached_property
    def reported(self) -> Sequence[Record]:
        """Scored records at the reported tolerance."""
        return [
            record
            for record in self.records
            if record.tolerance_m == self.tolerance_m and record.status == "ok"
        ]

    @cached_property
    def cells(self) -> Sequence[Cell]:
        """Classes and test sets with a scored scene, in the table's order."""
        found = {Cell(record.category, record.completion) for record in self.reported}
        return sorted(
            found,
            key=lambda cell: cell_order(
                cell.category, cell.completion, classes=self.config.run.classes
            ),
        )

    @cached_property
    def models(self) -> Sequence[str]:
        """Models with a scored scene, in the table's order."""
        return order_models({record.model for record in self.reported})

    @cached_property
    def chosen(self) -> Sequence[Recording]:
        """Of each class the recording of its median scene, in the classes' order.

        Raises
        ------
        NothingToDrawError
            No scored scene has a recording.
        """
        medians = [median_scene(self._recorded(), name) for name in self.config.run.classes]
        return [self.run.recording(scene_id) for scene_id in medians if scene_id is not None]

    @cached_property
    def most_tracked(self) -> Sequence[Recording]:
        """As `chosen`, but the median of those scenes of a class with most tracked objects.

        Raises
        ------
        NothingToDrawError
            No scored scene has a recording.
        """
        if not self.config.scenes.cluttered:
            return self.chosen
        records = self._recorded()
        tracked = {
            scene_id: len(self.run.recording(scene_id).tracked)
            for scene_id in sorted({record.scene_id for record in records})
        }
        found = []
        for category in self.config.run.classes:
            own = [record for record in records if record.category == category]
            most = max((tracked[record.scene_id] for record in own), default=0)
            own = [record for record in own if tracked[record.scene_id] == most]
            if (scene_id := median_scene(own, category)) is not None:
                found.append(self.run.recording(scene_id))
        return found

    @cached_property
    def points(self) -> RecordedPoints:
        """Every answer that the run recorded.

        Raises
        ------
        NothingToDrawError
            No scored scene has a recording.
        """
        self._recorded()
        return read_points(self.run)

    @property
    def answered_cells(self) -> Sequence[Cell]:
        """Those of `cells` with a recorded answer.

        Raises
        ------
        NothingToDrawError
            There is none.
        """
        answered = {(category, completion) for category, completion, _ in self.points.cells}
        cells = [cell for cell in self.cells if (cell.category, cell.completion) in answered]
        if not cells:
            raise NothingToDrawError("no recorded scene has a test point")
        return cells

    def _recorded(self) -> Sequence[Record]:
        """Take the records at the reported tolerance of scenes that have a recording."""
        recorded = set(self.run.recorded())
        if not recorded:
            raise NothingToDrawError(f"no recordings: {self.run.without_recordings()}")
        own = [record for record in self.reported if record.scene_id in recorded]
        if not own:
            raise NothingToDrawError("no scored scene of the run has a recording")
        return own


def order_models(models: set[str]) -> list[str]:
    """Put models in the table's order, foreign ones last."""
    known = [name for name in MODEL_ORDER if name in models]
    return known + sorted(models - set(known))


def median_scene(records: Sequence[Record], category: str) -> str | None:
    """Choose a class's median scene, so that a figure shows what is usual and not the best.

    It is the scene with the (lower) median accuracy of the metric model, or of the first in the
    table's order without one, on the completed points, or in the box without a completion. Equal
    scenes are ordered by id.

    Parameters
    ----------
    records
        Scored, of one tolerance.
    category
        The class.

    Returns
    -------
    scene_id
        None without a scored scene.
    """
    own = [record for record in records if record.category == category]
    if not own:
        return None
    models = {record.model for record in own}
    model = PREFERRED_MODEL if PREFERRED_MODEL in models else order_models(models)[0]
    by_set: defaultdict[str, list[Record]] = defaultdict(list)
    for record in own:
        if record.model == model:
            by_set[record.completion].append(record)
    completed = sorted(set(by_set) - {BOX})
    ranked = sorted(
        by_set[completed[0] if completed else BOX],
        key=lambda record: (record.accuracy or 0.0, record.scene_id),
    )
    return ranked[(len(ranked) - 1) // 2].scene_id


def newest_run(results: Path = Path("results")) -> Path:
    """Find the run in a folder whose records were written last; a baseline has no recordings.

    Raises
    ------
    InputError
        It holds no finished run.
    """
    finished = [
        folder
        for folder in (sorted(results.iterdir()) if results.is_dir() else [])
        if RunDirectory.is_run(folder)
        and RunDirectory(folder).records_path.exists()
        and RunDirectory(folder).recorded()
    ]
    if not finished:
        raise InputError(
            f"{results} holds no finished run with recordings; run `harness bench`, or pass a "
            "run's folder"
        )
    return max(finished, key=lambda folder: RunDirectory(folder).records_path.stat().st_mtime_ns)
