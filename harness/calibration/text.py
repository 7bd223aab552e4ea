"""Calibration and thresholds for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table as Grid
from rich.text import Text

from harness.calibration.read import BOX
from harness.calibration.series import BASELINES
from harness.statistics import LEAST_OBJECTS
from harness.table.cells import UNDEFINED, compact, compact_difference, millimetres

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from harness.calibration.choosing import ThresholdReport, Validation
    from harness.calibration.losses import Kept
    from harness.calibration.summary import Calibration, CalibrationCell
    from harness.statistics import MeanEstimate

_PROBABILITY_COLUMNS = {
    "ece_equal_mass": "equal mass",
    "brier": "Brier",
    "brier_reliability": "rel.",
    "brier_resolution": "res.",
    "nll": "NLL",
}
_RANKING_COLUMNS = {"excess_aurc": "excess"}
_PRECISION = "precision_at_"


def render_calibration(calibration: Calibration) -> RenderableType:
    """Lay out two tables for each class and test set: as probabilities, and as rankings."""
    parts: list[RenderableType] = []
    groups: dict[tuple[str, str], list[CalibrationCell]] = {}
    for cell in calibration.cells:
        groups.setdefault((cell.category, cell.completion), []).append(cell)
    for cells in groups.values():
        parts += [Text(_title(cells[0]), style="bold"), Text(), _probabilities(cells), Text()]
        parts += [_rankings(cells), Text()]
    parts.append(Text(_about(calibration), style="dim"))
    return Group(*parts)


def render_threshold(report: ThresholdReport) -> RenderableType:
    """Lay out what was chosen, and what it keeps."""
    goal, choice = report.goal, report.choice
    classes = " and ".join(report.classes)
    objects = "1 object" if choice.objects == 1 else f"{choice.objects} objects"
    asked = f"{goal.keep_precision:.1%} of kept points on the mesh".replace(".0%", " %")
    parts: list[RenderableType] = []
    if choice.threshold is None:
        parts.append(Text(f"No threshold guarantees {asked}.", style="bold"))
        if choice.objects < choice.least_objects:
            parts.append(
                Text(
                    f"{objects} are too few: {choice.least_objects} at least, were no point false."
                )
            )
        else:
            judged = "a p-value" if goal.delta is not None else "a share of false points"
            limit = goal.alpha if goal.delta is None else goal.delta
            parts.append(
                Text(
                    f"From {objects} the best threshold has {judged} of {compact(choice.bound)}, "
                    f"above {limit:g}: confident points are too often false, or the objects too "
                    "few."
                )
            )
    else:
        parts.append(Text(f"Keep points of confidence {choice.threshold:.3f} and above.", "bold"))
        parts.append(Text(f"{asked[0].upper()}{asked[1:]}: {_guarantee(report)}"))
    test_set = "box's points" if report.completion == BOX else f"points of {report.completion}"
    where = f"{report.model}, {classes}, {test_set}, within {millimetres(report.tolerance_m)}"
    parts += [Text(f"{where}; {objects} of {report.folder}", style="dim"), Text()]
    if report.kept:
        parts += [_kept_table(report.kept, heading="chosen on"), Text()]
    if report.judged:
        parts += [_kept_table(report.judged, heading=f"judged on {report.judged_folder}"), Text()]
    if report.validation is not None:
        parts += [Text(_validated(report.validation, report)), Text()]
    if report.kept:
        parts.append(Text(_ABOUT_KEPT, style="dim"))
    return Group(*parts)


_ABOUT_KEPT = (
    "Means over scenes [95 % interval over objects: none below "
    f"{LEAST_OBJECTS}]. A scene that keeps no point has a precision of 1 in the guarantee; 'where "
    "kept' leaves it out. The guarantee is for scenes made like these, of new objects."
)


def _guarantee(report: ThresholdReport) -> str:
    goal, choice = report.goal, report.choice
    if goal.delta is None:
        return (
            "guaranteed in the mean over new objects and draws of these "
            f"(conformal risk control; at most {compact(choice.bound)} false)."
        )
    return (
        f"guaranteed in the mean over new objects with probability {1 - goal.delta:g} over draws "
        f"of these (Learn then Test; p = {compact(choice.bound)})."
    )


def _validated(found: Validation, report: ThresholdReport) -> str:
    halves = (
        f"{found.splits} random halves ({found.objects_chosen_on} objects to choose on, "
        f"{found.objects_held_out} to check on)"
    )
    if found.thresholds is None:
        return f"Validation on {halves}: no half gives a threshold."
    low, middle, high = found.thresholds
    without = found.splits - found.chosen
    none = f" Without a threshold, so that nothing is kept: {without}." if without else ""
    return (
        f"Validation on {halves}: thresholds {low:.3f} to {high:.3f}, {middle:.3f} in the middle. "
        f"Mean precision on held-out objects {compact(found.mean_precision)}, asked "
        f"{report.goal.keep_precision:g}; reached by the held-out mean in "
        f"{100 * (found.held or 0):.1f} % of the halves.{none}"
    )


def _kept_table(kept: Mapping[str, Kept], *, heading: str) -> Grid:
    grid = _grid(
        heading, ("precision", "where kept", "kept", "recall", "scenes", "objects", "empty")
    )
    for name, item in kept.items():
        grid.add_row(
            name,
            *(
                _with_interval(estimate)
                for estimate in (item.precision, item.precision_where_kept, item.kept, item.recall)
            ),
            str(item.scenes),
            str(item.objects),
            str(item.empty),
        )
    return grid


def _probabilities(cells: Sequence[CalibrationCell]) -> Grid:
    grid = _grid("as a probability", ("ECE", *_PROBABILITY_COLUMNS.values(), "n"))
    for cell in cells:
        grid.add_row(Text(cell.model.replace("_", " "), style="bold"))
        for name, series in cell.series.items():
            if name in BASELINES or "ece" not in series.metrics:
                continue
            metrics = series.metrics
            note = f" ({series.outside:.0%} beyond)" if series.outside else ""
            grid.add_row(
                f"  {name.replace('_', ' ')}{note}",
                _with_interval(metrics["ece"]),
                *(compact(metrics[key].mean) for key in _PROBABILITY_COLUMNS),
                str(metrics["ece"].count),
            )
    return grid


def _rankings(cells: Sequence[CalibrationCell]) -> Grid:
    keys = [key for key in cells[0].series[BASELINES[0]].metrics if key.startswith(_PRECISION)]
    precisions = [f"P@{key.removeprefix(_PRECISION)} %" for key in keys]
    grid = _grid("as a ranking", ("AURC", "excess", "less nearest", "n", *precisions, "n"))
    for cell in cells:
        grid.add_row(Text(cell.model.replace("_", " "), style="bold"))
        for name, series in cell.series.items():
            metrics = series.metrics
            grid.add_row(
                f"  {name.replace('_', ' ')}",
                _with_interval(metrics["aurc"]),
                compact(metrics["excess_aurc"].mean),
                "" if series.less_nearest is None else compact_difference(series.less_nearest),
                str(metrics["aurc"].count),
                *(compact(metrics[key].mean) for key in keys),
                # The same of every share: the scenes with a point put on the object.
                str(metrics[keys[0]].count),
                style="dim" if name in BASELINES else None,
            )
    return grid


def _grid(heading: str, columns: Sequence[str]) -> Grid:
    grid = Grid(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    grid.add_column(heading, no_wrap=True)
    for column in columns:
        grid.add_column(column, justify="right", no_wrap=True)
    return grid


def _with_interval(estimate: MeanEstimate) -> str:
    if estimate.mean is None:
        return UNDEFINED
    if estimate.low is None:
        return compact(estimate.mean)
    return f"{compact(estimate.mean)} [{compact(estimate.low)}, {compact(estimate.high)}]"


def _title(cell: CalibrationCell) -> str:
    test_set = "box" if cell.completion == BOX else f"completed ({cell.completion})"
    scenes = "1 scene" if len(cell.scenes) == 1 else f"{len(cell.scenes)} scenes"
    objects = "1 object" if cell.objects == 1 else f"{cell.objects} objects"
    return (
        f"{cell.category.capitalize()}, {test_set}: {scenes} of {objects}, "
        f"{compact(cell.base_rate.mean)} of the points on the mesh"
    )


def _about(calibration: Calibration) -> str:
    empty = (
        f" No recorded scene of: {', '.join(calibration.empty_classes)}."
        if calibration.empty_classes
        else ""
    )
    return (
        f"{calibration.folder}, on the mesh within {millimetres(calibration.tolerance_m)}. Means "
        "over scenes [95 % interval over objects: none below "
        f"{LEAST_OBJECTS}]; n counts the scenes that define them. Means of unlike n are of "
        "unlike scenes: a missed target has no seed's score, no recalibration and no closeness "
        "to the data; 'less nearest' is paired. The seed's raw (Eq. 2) and normalised (Eq. 3) "
        "scores are no probabilities: they are read as if they were, that the decision is "
        "right, in scenes where none is beyond [0, 1]. Brier = rel. - res. + uncertainty + "
        "what the bins hide. AURC: risk over all coverages, of decisions ranked by the score; "
        "excess: above the best order of the same decisions; less nearest: less the AURC by "
        "closeness to the data. P@k %: precision among the surest k % of the points put on the "
        f"object.{empty}"
    )
