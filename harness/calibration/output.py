"""Calibration for machines: as JSON, and as a table with a line for each number."""

from __future__ import annotations

import csv
import io
import json
import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from harness.calibration.ranking import COVERAGES
from harness.errors import InputError
from harness.runs.atomic import write_text

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    import numpy as np
    import numpy.typing as npt

    from harness.calibration.probabilities import Reliability
    from harness.calibration.summary import Calibration, CalibrationCell, SeriesSummary
    from harness.statistics import PairedTest

HEADINGS = (
    "category",
    "completion",
    "model",
    "tolerance_m",
    "series",
    "metric",
    "over",
    "value",
    "low",
    "high",
    "scenes_defined",
    "scenes",
    "objects",
)


def as_json(calibration: Calibration) -> dict[str, Any]:
    """Lay a calibration out as JSON knows it: what is undefined is null."""
    return {
        "folder": str(calibration.folder),
        "tolerance_m": calibration.tolerance_m,
        "coverages": COVERAGES.tolist(),
        "empty_classes": list(calibration.empty_classes),
        "cells": [_cell(cell) for cell in calibration.cells],
    }


def as_csv(calibration: Calibration) -> str:
    """Lay a calibration out as CSV, at full precision; an undefined value is an empty field.

    ``over`` says what a value is a mean over: ``scenes``, with an interval over objects, or
    ``points``, those of all scenes together. ``aurc_less_random`` and ``aurc_less_nearest`` are
    differences paired by scene.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADINGS)
    for cell in calibration.cells:
        identity = (cell.category, cell.completion, cell.model, calibration.tolerance_m)
        for name, series in cell.series.items():
            for line in _lines(series):
                writer.writerow((*identity, name, *line, len(cell.scenes), cell.objects))
    return text.getvalue()


def write_calibration(calibration: Calibration, folder: Path) -> tuple[Path, Path]:
    """Write ``calibration.json`` and ``calibration.csv`` into a folder, which is made if needed.

    Raises
    ------
    InputError
        The folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot create {folder}: {error.strerror}; pass another --out") from None
    files = (folder / "calibration.json", folder / "calibration.csv")
    write_text(files[0], json.dumps(as_json(calibration), indent=1, allow_nan=False) + "\n")
    write_text(files[1], as_csv(calibration))
    return files


def _cell(cell: CalibrationCell) -> dict[str, Any]:
    return {
        "category": cell.category,
        "completion": cell.completion,
        "model": cell.model,
        "scenes": list(cell.scenes),
        "objects": cell.objects,
        "points": cell.points,
        "base_rate": asdict(cell.base_rate),
        "error_rate": asdict(cell.error_rate),
        "series": {name: _series(series) for name, series in cell.series.items()},
    }


def _series(series: SeriesSummary) -> dict[str, Any]:
    return {
        "metrics": {name: asdict(estimate) for name, estimate in series.metrics.items()},
        "outside": series.outside,
        "aurc_less_random": _test(series.less_random),
        "aurc_less_nearest": _test(series.less_nearest),
        "mean_risk": _finite(series.mean_risk),
        "pooled_metrics": dict(series.pooled_metrics),
        "pooled": _diagram(series.pooled),
        "pooled_equal_mass": _diagram(series.pooled_equal_mass),
    }


def _test(test: PairedTest | None) -> dict[str, Any] | None:
    return None if test is None else asdict(test)


def _diagram(diagram: Reliability | None) -> dict[str, Any] | None:
    if diagram is None:
        return None
    return {
        "edges": diagram.edges.tolist(),
        "mean_predicted": _finite(diagram.mean_predicted),
        "observed": _finite(diagram.observed),
        "counts": diagram.counts.tolist(),
    }


def _finite(values: npt.NDArray[np.float64]) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]


def _lines(series: SeriesSummary) -> Iterator[tuple[Any, ...]]:
    """Yield metric, over, value, low, high and the number of scenes that define it."""
    for metric, mean in series.metrics.items():
        yield metric, "scenes", mean.mean, mean.low, mean.high, mean.count
    tests: Mapping[str, PairedTest | None] = {
        "aurc_less_random": series.less_random,
        "aurc_less_nearest": series.less_nearest,
    }
    for metric, test in tests.items():
        if test is not None:
            yield metric, "scenes", test.mean, test.low, test.high, test.scenes
    for metric, value in series.pooled_metrics.items():
        yield metric, "points", value, None, None, None
