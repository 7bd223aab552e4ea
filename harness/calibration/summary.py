"""A run's calibration: every series of every cell, as means over scenes and over all points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.calibration.probabilities import Reliability, reliability
from harness.calibration.read import read_points
from harness.calibration.scene_metrics import (
    PROBABILITY_METRICS,
    RANKING_METRICS,
    inside,
    mean_risk,
    probability_metrics,
    ranking_metrics,
    scene_risks,
)
from harness.calibration.series import BASELINES, SERIES
from harness.statistics import MeanEstimate, PairedTest, mean_estimate, paired_test

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from harness.calibration.series import ScenePoints
    from harness.runs.directory import RunDirectory

Floats = npt.NDArray[np.float64]

METRICS = PROBABILITY_METRICS + RANKING_METRICS


@dataclass(frozen=True, eq=False, kw_only=True)
class SeriesSummary:
    """What one score of a cell's points is worth.

    Attributes
    ----------
    metrics
        By name of `METRICS`: mean over scenes, its interval over objects. A baseline has those of
        `RANKING_METRICS` alone. A scene does not count where the series is not defined in it, nor,
        among `PROBABILITY_METRICS`, where it leaves [0, 1].
    outside
        Share of the points of scenes that define it at which the series leaves [0, 1]; 0 for a
        baseline.
    pooled, pooled_equal_mass
        Reliability diagrams over the points of all scenes that count; None without such a scene.
    pooled_metrics
        `PROBABILITY_METRICS` over the same points; empty without them.
    mean_risk : (100,) float64
        Mean over scenes of the risk at `harness.calibration.COVERAGES`; NaN without scenes.
    risks : (scenes, 100) float64
        Of each scene of the cell; NaN where the series is not defined.
    less_random, less_nearest
        Differences of AURC to those of the baselines, paired by scene; below 0 the series is
        better. None of the baseline itself.
    """

    metrics: Mapping[str, MeanEstimate]
    outside: float
    pooled: Reliability | None
    pooled_equal_mass: Reliability | None
    pooled_metrics: Mapping[str, float]
    mean_risk: Floats
    risks: Floats
    less_random: PairedTest | None
    less_nearest: PairedTest | None


@dataclass(frozen=True, eq=False, kw_only=True)
class CalibrationCell:
    """A model's answers about one test set of one class.

    Attributes
    ----------
    category, completion, model
        As in the records; completion ``none`` is the box.
    scenes
        Their ids, sorted; those without a point of the test set are left out.
    objects_of_scenes : (scenes,) str
        The object of each.
    points
        Number of all scenes.
    base_rate, error_rate
        Mean over scenes of the share of points on the mesh, and of wrong decisions.
    series
        By name of `SERIES`, all of them.
    """

    category: str
    completion: str
    model: str
    scenes: tuple[str, ...]
    objects_of_scenes: npt.NDArray[np.str_]
    points: int
    base_rate: MeanEstimate
    error_rate: MeanEstimate
    series: Mapping[str, SeriesSummary]

    @property
    def objects(self) -> int:
        """Number of objects."""
        return len(np.unique(self.objects_of_scenes))


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibration:
    """A run's calibration at one tolerance.

    Attributes
    ----------
    folder
        The run's.
    tolerance_m
        Distance within which a point lies on a mesh, metres.
    cells
        By class, completion (the box first) and model, in the run's order.
    empty_classes
        Classes of the run without a recorded scene, for all failed.
    lost_scenes
        Scored scenes whose recording is missing; none unless they were allowed to.
    """

    folder: Path
    tolerance_m: float
    cells: tuple[CalibrationCell, ...]
    empty_classes: tuple[str, ...]
    lost_scenes: tuple[str, ...]

    def cell(self, category: str, *, completion: str, model: str) -> CalibrationCell | None:
        """Return a cell; None where the run has no point of it."""
        for item in self.cells:
            if (item.category, item.completion, item.model) == (category, completion, model):
                return item
        return None


def summarise_run(
    run: RunDirectory,
    *,
    models: Sequence[str] = (),
    classes: Sequence[str] = (),
    completions: Sequence[str] = (),
    tolerance_m: float | None = None,
    partly: bool = False,
) -> Calibration:
    """Summarise a finished run's calibration from its recordings.

    Parameters
    ----------
    run
        Finished, with recordings.
    models, classes, completions
        Which; all of the run where none is named.
    tolerance_m
        Distance within which a point lies on a mesh, metres; by default the one that the run
        reports.
    partly
        Summarise what there is where recordings of scored scenes are missing.

    Raises
    ------
    InputError
        As `harness.calibration.read.read_points`.
    """
    read = read_points(
        run,
        models=models,
        classes=classes,
        completions=completions,
        tolerance_m=tolerance_m,
        partly=partly,
    )
    cells = [
        summarise_cell(read.cells[category, completion, model], seed=read.seed)
        for category in read.classes
        for completion in read.completions
        for model in read.models
        if (category, completion, model) in read.cells
    ]
    return Calibration(
        folder=run.folder,
        tolerance_m=read.tolerance_m,
        cells=tuple(cells),
        empty_classes=read.empty_classes,
        lost_scenes=read.lost_scenes,
    )


def summarise_cell(scenes: Sequence[ScenePoints], *, seed: int) -> CalibrationCell:
    """Summarise the scenes, at least one, of a class, test set and model.

    Parameters
    ----------
    scenes
        Each with points.
    seed
        Of the intervals' resampling.
    """
    objects = np.array([scene.object_name for scene in scenes], dtype=np.str_)
    base_rates = np.array([scene.truth.mean() for scene in scenes])
    error_rates = np.array([np.mean(scene.truth != scene.predicted) for scene in scenes])
    ranked = {
        name: _by_metric([ranking_metrics(scene, name) for scene in scenes]) for name in SERIES
    }
    first = scenes[0]
    return CalibrationCell(
        category=first.category,
        completion=first.completion,
        model=first.model,
        scenes=tuple(scene.scene_id for scene in scenes),
        objects_of_scenes=objects,
        points=sum(len(scene.truth) for scene in scenes),
        base_rate=mean_estimate(base_rates, objects=objects, seed=seed),
        error_rate=mean_estimate(error_rates, objects=objects, seed=seed),
        series={
            name: _summarise_series(scenes, name, ranked=ranked, objects=objects, seed=seed)
            for name in SERIES
        },
    )


def _summarise_series(
    scenes: Sequence[ScenePoints],
    name: str,
    *,
    ranked: Mapping[str, Mapping[str, Floats]],
    objects: npt.NDArray[np.str_],
    seed: int,
) -> SeriesSummary:
    aurc = ranked[name]["aurc"]
    less = {
        baseline: paired_test(aurc - ranked[baseline]["aurc"], objects=objects, seed=seed)
        for baseline in BASELINES
        if baseline != name
    }
    risks = scene_risks(scenes, name)
    pooled = _pool(scenes, name)
    values = dict(ranked[name])
    if name not in BASELINES:
        values |= _by_metric(_judge(scenes, name))
    return SeriesSummary(
        metrics={
            metric: mean_estimate(values[metric], objects=objects, seed=seed)
            for metric in METRICS
            if metric in values
        },
        outside=pooled.outside,
        pooled=pooled.equal_width,
        pooled_equal_mass=pooled.equal_mass,
        pooled_metrics=pooled.metrics,
        mean_risk=mean_risk(risks),
        risks=risks,
        less_random=less.get("random"),
        less_nearest=less.get("nearest"),
    )


def _judge(scenes: Sequence[ScenePoints], name: str) -> list[dict[str, float]]:
    """Metrics of a series as a probability in each scene."""
    undefined = dict.fromkeys(PROBABILITY_METRICS, np.nan)
    return [
        probability_metrics(scene.on_object[name], scene.truth)
        if name in scene.on_object
        else undefined
        for scene in scenes
    ]


@dataclass(frozen=True, eq=False)
class _Pool:
    """The points of all scenes that count."""

    outside: float
    equal_width: Reliability | None = None
    equal_mass: Reliability | None = None
    metrics: Mapping[str, float] = field(default_factory=dict)


def _pool(scenes: Sequence[ScenePoints], name: str) -> _Pool:
    defined = [scene for scene in scenes if name in scene.on_object]
    if not defined:
        return _Pool(outside=0.0)
    outside = 1.0 - float(inside(np.concatenate([s.on_object[name] for s in defined])).mean())
    counted = [scene for scene in defined if inside(scene.on_object[name]).all()]
    if not counted:
        return _Pool(outside=outside)
    probability = np.concatenate([scene.on_object[name] for scene in counted])
    truth = np.concatenate([scene.truth for scene in counted])
    return _Pool(
        outside=outside,
        equal_width=reliability(probability, truth),
        equal_mass=reliability(probability, truth, equal_mass=True),
        metrics=probability_metrics(probability, truth),
    )


def _by_metric(of_scenes: Sequence[Mapping[str, float]]) -> dict[str, Floats]:
    """Values (scenes,) of each metric."""
    return {name: np.array([values[name] for values in of_scenes]) for name in of_scenes[0]}
