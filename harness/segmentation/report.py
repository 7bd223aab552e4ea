"""The report on a terminal and as JSON."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.table import Table as Grid
from rich.text import Text

from harness.native import CLASS_NAMES
from harness.segmentation.matching import LEAST_IOU
from harness.segmentation.numbers import ALL_CATEGORIES, BACKGROUND, MISSED, POOLED, SINGLE
from harness.segmentation.segmenter import LEAST_SCORE
from harness.statistics import LEAST_OBJECTS
from harness.table.cells import UNDEFINED, compact

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from harness.segmentation.loss import Loss
    from harness.segmentation.numbers import Confusion, Report
    from harness.statistics import MeanEstimate


def report_json(
    report: Report,
    loss: Loss | None,
    *,
    failures: Mapping[str, str],
    settings: Mapping[str, Any],
) -> str:
    """Write the report and what it was measured under as JSON."""
    content = {
        "settings": settings,
        "summary": asdict(report),
        "table": None if loss is None else asdict(loss),
        "failures": dict(sorted(failures.items())),
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def render_report(report: Report, loss: Loss | None) -> RenderableType:
    """Lay the report out for a terminal."""
    parts: list[RenderableType] = []
    for name in dict.fromkeys(item.segmenter for item in report.precisions):
        parts += _segmenter(report, name)
    if report.latencies:
        parts += [_latencies(report), Text()]
    if loss is not None:
        parts += _loss(loss)
    parts.append(Text(_explanation(report), style="dim"))
    return Group(*parts)


def _segmenter(report: Report, name: str) -> Iterable[RenderableType]:
    about = ", ".join(
        f"{report.scenes[group]} {group} scenes ({report.frames[group]} frames)"
        for group in report.scenes
        if group != POOLED
    )
    yield Text.assemble((name, "bold"), f": {about}")
    yield _summary(report, name)
    yield Text()
    yield _categories(report, name)
    yield Text()
    for item in report.confusions:
        if (item.segmenter, item.scenes) == (name, POOLED):
            yield _confusion(item, least_score=report.least_score)
    yield Text()
    yield _calibration(report, name)
    yield Text()


def _summary(report: Report, name: str) -> RenderableType:
    headings = ["objects", "AP", "AP50", "AP75", "recall", "IoU of found", "false per frame"]
    grid = _grid("scenes", headings)
    findings = {
        item.scenes: item
        for item in report.findings
        if (item.segmenter, item.category) == (name, ALL_CATEGORIES)
    }
    false = {item.scenes: item for item in report.false_finds if item.segmenter == name}
    for row in report.precisions:
        if (row.segmenter, row.category) == (name, ALL_CATEGORIES):
            found = findings[row.scenes]
            cells = (row.ap, row.ap50, row.ap75, found.recall, found.iou)
            grid.add_row(
                row.scenes,
                str(row.truths),
                *map(_estimate, cells),
                _estimate(false[row.scenes].per_frame),
            )
    return grid


def _categories(report: Report, name: str) -> RenderableType:
    headings = ["objects", "models", "AP", "AP50", "AP75", "recall", "recall, single", "IoU"]
    grid = _grid("category, all scenes", headings)
    findings = {
        (item.scenes, item.category): item for item in report.findings if item.segmenter == name
    }
    for row in report.precisions:
        if row.segmenter != name or row.scenes != POOLED or row.category == ALL_CATEGORIES:
            continue
        found, single = findings[POOLED, row.category], findings.get((SINGLE, row.category))
        grid.add_row(
            row.category,
            str(row.truths),
            str(row.objects),
            *map(_estimate, (row.ap, row.ap50, row.ap75, found.recall)),
            UNDEFINED if single is None else _estimate(single.recall),
            _estimate(found.iou),
        )
    return grid


def _confusion(item: Confusion, *, least_score: float) -> RenderableType:
    grid = _grid(f"true, found as (score from {least_score:g}) >", [*CLASS_NAMES[1:], MISSED])
    for true, row in item.counts.items():
        cells = [
            Text(
                "" if count == 0 or (true == BACKGROUND and found == MISSED) else str(count),
                style="bold green" if true == found else "red",
            )
            for found, count in row.items()
        ]
        if any(row.values()):
            grid.add_row(true, *cells)
    return grid


def _calibration(report: Report, name: str) -> RenderableType:
    temperature = report.temperatures.get(name)
    title = "calibration" if temperature is None else f"calibration, temperature {temperature:.3g}"
    headings = ["score from", "detections", "right", "ECE", "ECE, equal mass", "Brier"]
    grid = _grid(title, headings)
    for row in report.calibrations:
        if row.segmenter == name:
            state = "" if temperature is None else ", after" if row.calibrated else ", before"
            grid.add_row(
                row.scenes + state,
                f"{row.least_score:g}",
                str(row.detections),
                compact(row.share_right),
                *map(_estimate, (row.ece, row.ece_equal_mass, row.brier)),
                style="bold" if row.headline and row.calibrated else None,
            )
    return grid


def _latencies(report: Report) -> RenderableType:
    grid = _grid("Time per frame, ms", ["frames", "median", "95th percentile"])
    for item in report.latencies:
        grid.add_row(
            item.segmenter, str(item.frames), f"{item.median_ms:.0f}", f"{item.p95_ms:.0f}"
        )
    return grid


def _loss(loss: Loss) -> Iterable[RenderableType]:
    for name in dict.fromkeys(row.segmenter for row in loss.rows):
        headings = ["scenes", "missed", "oracle", name, "precision: difference", "F1: difference"]
        grid = _grid(f"Table III, {name} less the oracle's masks", headings)
        for row in loss.rows:
            if row.segmenter == name:
                precision, f1 = row.values["precision"], row.values["f1"]
                partly = "" if precision.less.count == row.scenes else f" n={precision.less.count}"
                grid.add_row(
                    row.label,
                    str(row.scenes),
                    str(row.missed),
                    compact(precision.oracle),
                    compact(precision.segmenter),
                    _signed(precision.less) + partly,
                    _signed(f1.less),
                )
        yield grid
        yield Text()


def _explanation(report: Report) -> str:
    return (
        "AP, AP50 and AP75 are COCO's, of masks, by pycocotools. Recall, overlap (IoU), false "
        f"finds and the confusion count detections with a score from {report.least_score:g} on, "
        f"which the map takes, and objects overlapped by {LEAST_IOU:g} or more; a detection is "
        "right when its category is too. Objects that less than a thousandth of the image shows "
        f"are ignored. Calibration is stated of all detections from {LEAST_SCORE:g} on, the figure "
        "to name (bold), and of those that the map takes. 95 % bootstrap intervals draw the "
        f"targets with all their scenes: none ({UNDEFINED}) below {LEAST_OBJECTS} objects."
    )


def _grid(title: str, headings: Sequence[str]) -> Grid:
    grid = Grid(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="")
    grid.add_column(Text(title, style="bold"), no_wrap=True, min_width=20)
    for heading in headings:
        grid.add_column(heading, justify="right", no_wrap=True)
    return grid


def _estimate(estimate: MeanEstimate) -> str:
    if estimate.mean is None:
        return UNDEFINED
    if estimate.low is None:
        return f"{compact(estimate.mean)} [{UNDEFINED}]"
    return f"{compact(estimate.mean)} [{compact(estimate.low)}, {compact(estimate.high)}]"


def _signed(estimate: MeanEstimate) -> str:
    if estimate.mean is None:
        return UNDEFINED
    if estimate.low is None:
        return f"{estimate.mean:+.3f} [{UNDEFINED}]"
    return f"{estimate.mean:+.3f} [{estimate.low:+.3f}, {estimate.high:+.3f}]"
