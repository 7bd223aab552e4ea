"""What a run measures: one record per scene, model, completion and tolerance.

Timings are kept apart from records: the clock is the one thing that no seed fixes, and records
of the same configuration must be the same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Self

import polars as pl

from harness.runs.tabular import check_types, read_rows, schema_of, write_rows

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from harness.runs.confusion import Confusion
    from harness.runs.job import SceneJob

SCHEMA_VERSION = 5
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
    "ece_recalibrated",
    "brier",
    "brier_recalibrated",
    "nll",
    "log_loss",
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


@dataclass(frozen=True, order=True)
class Variant:
    """What is compared on every scene: a row of the table.

    Attributes
    ----------
    model
        Classifier, such as ``classic``.
    completion
        Shape completion that the test points come from, by its completer's name; ``none`` draws
        them in the object's true box, ``perturbed`` stands for one by a wrong instance.
    segmenter
        Source of the instance masks; ``oracle`` is the simulator's truth.
    """

    model: str
    completion: str = "none"
    segmenter: str = "oracle"


@dataclass(frozen=True, kw_only=True, slots=True)
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
    target_missed
        Whether the map holds nothing where the target is, because its segmenter did not find it.
        Points that are drawn from the truth are then answered "not the object" everywhere, with a
        probability of 0 to lie on it; a completed set has none, and failed.
    redraws
        Arrangements thrown away before one was reachable.
    camera_distance_m, visible_share
        Distance of the cameras from the middle of the target's box, and share of a view's pixels
        that show the target, means over views: scenes of one id that differ in them are not the
        same scene. The share is null where no true masks are known.
    object_training_points, free_training_points
        Training points of the target's category, and of free space; neighbours have the rest.
    tp, tn, fp, fn
        Test points by prediction and truth.
    base_rate
        Share of the test points that lie on the mesh.
    ece, ece_equal_mass, brier, nll, log_loss
        Of the raw probability; `log_loss` is the negative log-likelihood of a probability clipped
        to 1e-6 from 0 and 1, by which hyperparameters are chosen.
    ece_recalibrated, brier_recalibrated
        Of the recalibrated probability; null where the map takes the target for something else.
    random_aurc, nearest_aurc
        AURC of the same decisions in random order, and ranked by closeness to the nearest training
        point: what a confidence must beat.
    score_aurc
        AURC of the seed's min-max score (its Eqs. 2 and 3).
    clamped_share
        Share of test points whose variance was negative and clamped; 0 for a sound covariance.
    gate
        Weight of the metric model against the classic one that it falls back to, in [0, 1]; 1
        where a model has no gate.
    ood
        Mean negative log-likelihood of the training points under the query network, high where the
        observation is not of the kind that it has learned; null where a model asks no network.
    jitter
        Value added to the covariance's diagonal to factorise it.
    fits_unconverged, fits_at_bound
        Number of processes whose fit stopped before it converged, and of those with a
        hyperparameter at the bound of its range.
    lengthscale_m, outputscale, lengthscale_free_m, outputscale_free
        Hyperparameters of the object's and of the free-space process; null where a model has none.
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
    target_missed: bool = False
    redraws: int | None = None
    camera_distance_m: float | None = None
    visible_share: float | None = None
    test_points: int | None = None
    object_training_points: int | None = None
    free_training_points: int | None = None
    tp: int | None = None
    tn: int | None = None
    fp: int | None = None
    fn: int | None = None
    base_rate: float | None = None
    precision: float | None = None
    recall: float | None = None
    f1: float | None = None
    accuracy: float | None = None
    mcc: float | None = None
    auroc: float | None = None
    average_precision: float | None = None
    ece: float | None = None
    ece_equal_mass: float | None = None
    ece_recalibrated: float | None = None
    brier: float | None = None
    brier_recalibrated: float | None = None
    nll: float | None = None
    log_loss: float | None = None
    aurc: float | None = None
    excess_aurc: float | None = None
    random_aurc: float | None = None
    nearest_aurc: float | None = None
    risk_at_50: float | None = None
    risk_at_80: float | None = None
    score_aurc: float | None = None
    clamped_share: float | None = None
    gate: float | None = None
    ood: float | None = None
    jitter: float | None = None
    fits_unconverged: int | None = None
    fits_at_bound: int | None = None
    lengthscale_m: float | None = None
    outputscale: float | None = None
    lengthscale_free_m: float | None = None
    outputscale_free: float | None = None

    def __post_init__(self) -> None:
        check_types(self)
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
        cls,
        job: SceneJob,
        *,
        variant: Variant,
        views: int,
        tolerance_m: float,
        failure: str,
        target_missed: bool = False,
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
            target_missed=target_missed,
        )

    @property
    def variant(self) -> Variant:
        """The row of the table that this record belongs to."""
        return Variant(model=self.model, completion=self.completion, segmenter=self.segmenter)

    def key(self) -> tuple[str, str, str, str, float]:
        """Return what identifies a record, in sorting order."""
        return (self.scene_id, self.model, self.completion, self.segmenter, self.tolerance_m)


@dataclass(frozen=True, kw_only=True, slots=True)
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
        check_types(self)


@dataclass(frozen=True)
class SceneResult:
    """What a scene yields.

    Attributes
    ----------
    recording
        The scene as `harness.recordings.file` encodes it; None where the run keeps none.
    """

    records: list[Record]
    timings: list[Timing] = field(default_factory=list)
    confusion: list[Confusion] = field(default_factory=list)
    recording: bytes | None = None


RECORD_SCHEMA = schema_of(Record)
TIMING_SCHEMA = schema_of(Timing)


def write_records(records: Iterable[Record], path: Path) -> None:
    """Write records as Parquet, in the order of their keys."""
    write_rows(sorted(records, key=Record.key), path, schema=RECORD_SCHEMA)


def write_timings(timings: Iterable[Timing], path: Path) -> None:
    """Write timings as Parquet, by scene and in the order in which the stages ran."""
    rows = sorted(timings, key=lambda timing: timing.scene_id)
    write_rows(rows, path, schema=TIMING_SCHEMA)


def read_records(path: Path) -> list[Record]:
    """Read what `write_records` wrote.

    Raises
    ------
    InputError
        The file is missing, damaged or of another schema.
    """
    return read_rows(path, row=Record, problem_of=_problem_of)


def _problem_of(frame: pl.DataFrame) -> str | None:
    """Say which record of a file `Record` would refuse."""
    status, counts = pl.col("status"), pl.sum_horizontal(COUNTS)
    stated = pl.all_horizontal(pl.col(*COUNTS, "test_points").is_not_null())
    refusals = {
        "its status is neither 'ok' nor 'failed'": ~status.is_in(("ok", "failed")),
        "a failure is stated exactly where status is 'failed'": (status == "failed")
        != pl.col("failure").is_not_null(),
        "tp, tn, fp, fn do not add up to test_points": (status == "ok")
        & ~(stated & (counts == pl.col("test_points"))),
    }
    for problem, refused in refusals.items():
        if (found := frame.filter(refused.fill_null(value=True))).height:
            return f"{found['scene_id'][0]}: {problem}"
    return None


def read_timings(path: Path) -> list[Timing]:
    """Read what `write_timings` wrote; raises like `read_records`."""
    return read_rows(path, row=Timing)
