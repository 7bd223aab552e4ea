"""What the page's curves are drawn from, and the numbers beside them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from harness.calibration.ranking import COVERAGES
from harness.calibration.series import BASELINES, SERIES
from harness.figures.style import RANDOM, model_style
from harness.html_report.grid import Cell, Grid, Heading, estimate_cell
from harness.html_report.names import cell_name, model_order, plain, reference_model

if TYPE_CHECKING:
    import numpy.typing as npt

    from harness.calibration.probabilities import Reliability
    from harness.calibration.summary import Calibration, CalibrationCell
    from harness.figures.style import SeriesStyle

SCORES = ("confidence", "recalibrated", "probability", "normalised_score", "raw_score")
"""The series that are chosen from, the one that maps rank and filter by first."""
NUMBERS = {
    "aurc": "AURC",
    "excess_aurc": "excess AURC",
    "ece": "ECE",
    "ece_equal_mass": "ECE, equal mass",
    "brier": "Brier",
    "nll": "NLL",
}
DECIMALS = 4
_DASHES = {"solid": "solid", "dashed": "dash", "dotted": "dot", "dashdot": "dashdot"}
_MARKERS = {
    "o": "circle",
    "s": "square",
    "D": "diamond",
    "v": "triangle-down",
    "^": "triangle-up",
    "X": "x",
    "P": "cross",
}


def curve_data(calibration: Calibration) -> dict[str, Any]:
    """Pack the curves of every class and test set, for each model and score.

    Beside the models stand the baselines of the reference model's decisions.
    """
    by_cell: dict[tuple[str, str], dict[str, CalibrationCell]] = {}
    for item in calibration.cells:
        by_cell.setdefault((item.category, item.completion), {})[item.model] = item
    models = sorted({item.model for item in calibration.cells}, key=model_order)
    reference = reference_model(models)
    looks = [_look(model_style(model)) for model in models]
    nearest = f"baseline: closeness to the data ({plain(reference)})"
    looks += [
        _look(RANDOM) | {"label": f"baseline: random order ({plain(reference)})"},
        _look(RANDOM) | {"label": nearest, "dash": "dashdot"},
    ]
    cells = []
    for (category, completion), of_model in by_cell.items():
        found = [of_model.get(model) for model in models]
        baseline = of_model.get(reference)
        cells.append(
            {
                "label": cell_name(category, completion),
                "about": _about([item for item in found if item is not None]),
                "risk": {
                    score: [
                        *(None if item is None else _risk(item, score) for item in found),
                        *(None if baseline is None else _risk(baseline, b) for b in BASELINES),
                    ]
                    for score in SCORES
                },
                "reliability": {
                    score: [
                        *(
                            None if item is None else _reliability(item.series[score].pooled)
                            for item in found
                        ),
                        *(None for _ in BASELINES),
                    ]
                    for score in SCORES
                },
            }
        )
    return {
        "coverage": _numbers(COVERAGES),
        "kinds": [[score, f"{plain(score)}: {SERIES[score]}"] for score in SCORES],
        "series": looks,
        "cells": cells,
    }


def calibration_grid(calibration: Calibration) -> Grid:
    """Tabulate what each score of each class, test set and model is worth."""
    rows = []
    order = list(dict.fromkeys((c.category, c.completion) for c in calibration.cells))
    # Stable, so that classes and test sets keep their order.
    cells = sorted(calibration.cells, key=lambda item: model_order(item.model))
    for item in sorted(cells, key=lambda item: order.index((item.category, item.completion))):
        for name, series in item.series.items():
            rows.append(
                (
                    Cell(cell_name(item.category, item.completion)),
                    Cell(plain(item.model)),
                    Cell(plain(name)),
                    *(
                        estimate_cell(series.metrics[key], scenes=len(item.scenes))
                        if key in series.metrics
                        else Cell("")
                        for key in NUMBERS
                    ),
                )
            )
    names = [Heading(text, numeric=False) for text in ("class and test set", "model", "score")]
    return Grid(
        "Mean over scenes with its 95 % interval over objects",
        (*names, *(Heading(text) for text in NUMBERS.values())),
        rows,
    )


def _about(cells: list[CalibrationCell]) -> str:
    largest = max(cells, key=lambda item: len(item.scenes))
    rate = largest.base_rate.mean
    share = "" if rate is None else f"; {rate:.0%} of the points lie on the object"
    fewer: dict[int, list[str]] = {}
    for name, series in largest.series.items():
        count = series.metrics["aurc"].count
        if 0 < count < len(largest.scenes):
            fewer.setdefault(count, []).append(plain(name))
    unlike = "".join(
        f" In {count} of them alone, the others undefined: {', '.join(names)}."
        for count, names in fewer.items()
    )
    return (
        f"{len(largest.scenes)} scenes of {largest.objects} objects, {largest.points:,} points"
        f"{share}.{unlike}"
    )


def _look(style: SeriesStyle) -> dict[str, str]:
    return {
        "label": style.label,
        "colour": style.colour,
        "dash": _DASHES[style.line],
        "marker": _MARKERS.get(style.marker, "circle"),
    }


def _risk(cell: CalibrationCell, series: str) -> list[float | None] | None:
    values = cell.series[series].mean_risk
    return None if np.isnan(values).all() else _numbers(values)


def _reliability(diagram: Reliability | None) -> dict[str, list[Any]] | None:
    if diagram is None:
        return None
    filled = diagram.counts > 0
    return {
        "predicted": _numbers(diagram.mean_predicted[filled]),
        "observed": _numbers(diagram.observed[filled]),
        "counts": diagram.counts[filled].tolist(),
    }


def _numbers(values: npt.NDArray[np.float64]) -> list[float | None]:
    return [None if np.isnan(value) else round(float(value), DECIMALS) for value in values]
