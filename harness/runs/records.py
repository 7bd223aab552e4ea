"""What a run measures: one record per scene, model, completion and tolerance.

Timings are kept apart from records: the clock is the one thing that no seed fixes, and records
of the same configuration must be the same bytes.
"""

from __future__ import annotations

import io
import math
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Self, get_type_hints

import polars as pl

from harness.errors import InputError
from harness.runs.atomic import write_atomically

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from harness.runs.job import SceneJob

SCHEMA_VERSION = 2
"""Counts up with every change of a column's name, type or meaning."""

METRICS = (
    "precision",
    "recall",
    "f1",
    "accuracy",
    "mcc",
    "auroc",
    "average_precision",
    "ece",
    "ece_equal_mass",
    "brier",
    "nll",
    "aurc",
    "excess_aurc",
    "random_aurc",
    "nearest_aurc",
    "risk_at_50",
    "risk_at_80",
    "score_aurc",
)
"""Fields of a record that score a classifier; null where undefined."""

COUNTS = ("tp", "tn", "fp", "fn")
"""Fields of a record that count test points."""


@dataclass(frozen=True)
class Variant:
    """What is compared on every scene: a row of the table.

    Attributes
    ----------
    model
        Classifier: ``classic``, ``metric_literal`` or ``metric``.
    completion
        Shape completion; ``none`` draws the test points in the object's true box.
    segmenter
        Source of the instance masks; ``oracle`` is the simulator's truth.
    """

    model: str
    completion: str = "none"
    segmenter: str = "oracle"


@dataclass(frozen=True, kw_only=True)
class Record:
    """A classifier's result on one scene at one tolerance.

    Counts and metrics are null in a failed record; a metric is null too where it is undefined,
    such as precision without a positive prediction.

    Attributes
    ----------
    tolerance_m
        Distance within which a point lies on the mesh, metres.
    status, failure
        ``ok``, or ``failed`` with the reason.
    redraws
        Arrangements thrown away before one was reachable.
    object_training_points, free_training_points
        Training points of the target's category, and of free space; neighbours have the rest.
    tp, tn, fp, fn
        Test points by prediction and truth.
    random_aurc, nearest_aurc
        AURC of the same decisions in random order, and ranked by closeness to the nearest training
        point: what a confidence must beat.
    score_aurc
        AURC of the seed's min-max score (its Eqs. 2 and 3).
    clamped_share
        Share of test points whose variance was negative and clamped; 0 for a sound covariance.
    jitter
        Value added to the covariance's diagonal to factorise it.
    fits_unconverged, fits_at_bound
        Number of processes whose fit stopped before it converged, and of those with a
        hyperparameter at the bound of its range.
    lengthscale_m, outputscale, lengthscale_free_m, outputscale_free
        Fitted hyperparameters of the object's and of the free-space process.
    """

    scene_id: str
    category: str
    object_name: str
    seed: int
    model: str
    completion: str
    segmenter: str
    views: int
    tolerance_m: float
    status: str = "ok"
    failure: str | None = None
    redraws: int | None = None
    test_points: int | None = None
    object_training_points: int | None = None
    free_training_points: int | None = None
    tp: int | None = None
    tn: int | None = None
    fp: int | None = None
    fn: int | None = None
    precision: float | None = None
    recall: float | None = None
    f1: float | None = None
    accuracy: float | None = None
    mcc: float | None = None
    auroc: float | None = None
    average_precision: float | None = None
    ece: float | None = None
    ece_equal_mass: float | None = None
    brier: float | None = None
    nll: float | None = None
    aurc: float | None = None
    excess_aurc: float | None = None
    random_aurc: float | None = None
    nearest_aurc: float | None = None
    risk_at_50: float | None = None
    risk_at_80: float | None = None
    score_aurc: float | None = None
    clamped_share: float | None = None
    jitter: float | None = None
    fits_unconverged: int | None = None
    fits_at_bound: int | None = None
    lengthscale_m: float | None = None
    outputscale: float | None = None
    lengthscale_free_m: float | None = None
    outputscale_free: float | None = None

    def __post_init__(self) -> None:
        _check_types(self)
        where = f"record of {self.scene_id}, {self.model}, {self.tolerance_m} m"
        if self.status not in ("ok", "failed"):
            raise ValueError(f"{where}: status '{self.status}' is neither 'ok' nor 'failed'")
        if (self.status == "failed") != (self.failure is not None):
            raise ValueError(f"{where}: a failure is stated exactly where status is 'failed'")
        counts = [self.tp, self.tn, self.fp, self.fn]
        if self.status == "ok":
            stated = [count for count in counts if count is not None]
            if len(stated) < len(counts) or sum(stated) != self.test_points:
                raise ValueError(
                    f"{where}: tp, tn, fp, fn = {counts} do not add up to "
                    f"test_points = {self.test_points}"
                )

    @classmethod
    def failed(
        cls, job: SceneJob, *, variant: Variant, views: int, tolerance_m: float, failure: str
    ) -> Self:
        """Make the record of a scene that was lost."""
        return cls(
            scene_id=job.scene_id,
            category=job.category,
            object_name=job.object_name,
            seed=job.seed,
            model=variant.model,
            completion=variant.completion,
            segmenter=variant.segmenter,
            views=views,
            tolerance_m=tolerance_m,
            status="failed",
            failure=failure,
        )

    @property
    def variant(self) -> Variant:
        """The row of the table that this record belongs to."""
        return Variant(model=self.model, completion=self.completion, segmenter=self.segmenter)

    def key(self) -> tuple[str, str, str, str, float]:
        """Return what identifies a record, in sorting order."""
        return (self.scene_id, self.model, self.completion, self.segmenter, self.tolerance_m)


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Wall time of one stage of one scene.

    Attributes
    ----------
    stage
        Name of the stage; ``scene`` is the whole of it.
    model
        Classifier that the stage belongs to; null where all share it.
    seconds
        Wall time.
    peak_memory_mib
        Highest resident memory of the worker during the scene, MiB; stated for ``scene``.
    """

    scene_id: str
    stage: str
    model: str | None
    seconds: float
    peak_memory_mib: float | None = None

    def __post_init__(self) -> None:
        _check_types(self)


@dataclass(frozen=True)
class SceneResult:
    """What a scene yields."""

    records: list[Record]
    timings: list[Timing] = field(default_factory=list)


def _check_types(row: Record | Timing) -> None:
    """Refuse what Parquet would store as something else: NaN, infinities, numpy scalars."""
    for name, (kind, nullable) in _COLUMN_TYPES[type(row)].items():
        value: object = getattr(row, name)
        if value is None and nullable:
            continue
        if type(value) is not kind:
            raise ValueError(
                f"{row.scene_id}: {name} is {value!r} of type {type(value).__name__}; "
                f"it must be {kind.__name__}"
            )
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{row.scene_id}: {name} is {value}; an undefined value is None")


def _column_types(row: type[Record | Timing]) -> dict[str, tuple[type, bool]]:
    hints = get_type_hints(row)
    types = {}
    for item in fields(row):
        options = getattr(hints[item.name], "__args__", (hints[item.name],))
        types[item.name] = (options[0], type(None) in options)
    return types


_COLUMN_TYPES: dict[type, dict[str, tuple[type, bool]]] = {
    row: _column_types(row) for row in (Record, Timing)
}
_PARQUET_TYPES: dict[type, pl.DataType] = {str: pl.String(), int: pl.Int64(), float: pl.Float64()}


def _schema(row: type[Record | Timing]) -> pl.Schema:
    return pl.Schema({name: _PARQUET_TYPES[kind] for name, (kind, _) in _COLUMN_TYPES[row].items()})


RECORD_SCHEMA = _schema(Record)
TIMING_SCHEMA = _schema(Timing)


def write_records(records: Iterable[Record], path: Path) -> None:
    """Write records as Parquet, in the order of their keys."""
    rows = [asdict(record) for record in sorted(records, key=Record.key)]
    write_parquet(pl.DataFrame(rows, schema=RECORD_SCHEMA), path)


def write_timings(timings: Iterable[Timing], path: Path) -> None:
    """Write timings as Parquet, by scene and in the order in which the stages ran."""
    rows = [asdict(timing) for timing in sorted(timings, key=lambda timing: timing.scene_id)]
    write_parquet(pl.DataFrame(rows, schema=TIMING_SCHEMA), path)


def read_records(path: Path) -> list[Record]:
    """Read what `write_records` wrote.

    Raises
    ------
    InputError
        The file is missing, damaged or of another schema.
    """
    frame = _read_parquet(path, schema=RECORD_SCHEMA)
    return [Record(**row) for row in frame.to_dicts()]


def read_timings(path: Path) -> list[Timing]:
    """Read what `write_timings` wrote; raises like `read_records`."""
    frame = _read_parquet(path, schema=TIMING_SCHEMA)
    return [Timing(**row) for row in frame.to_dicts()]


def write_parquet(frame: pl.DataFrame, path: Path) -> None:
    """Write a table atomically, and as the same bytes wherever it is written."""
    # Every setting that shapes the bytes is spelt out, so that a new default cannot. They go
    # through memory because polars reports a full disk in its own way.
    content = io.BytesIO()
    frame.write_parquet(
        content, compression="zstd", compression_level=3, statistics=True, row_group_size=1 << 16
    )
    write_atomically(path, lambda file: file.write(content.getbuffer()))


def _read_parquet(path: Path, *, schema: pl.Schema) -> pl.DataFrame:
    try:
        frame = pl.read_parquet(path)
    except FileNotFoundError:
        raise InputError(f"{path} is missing; finish the run with `harness bench --out`") from None
    except (OSError, pl.exceptions.PolarsError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path} is damaged ({reason}); delete it and resume the run") from None
    if frame.schema != schema:
        odd = sorted(set(frame.schema.items()) ^ set(schema.items()), key=str)
        raise InputError(
            f"{path} has other columns than this version's ({odd[0][0] if odd else 'order'}); "
            "read it with the version named in its manifest.json"
        )
    return frame
