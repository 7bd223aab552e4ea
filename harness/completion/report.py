"""The report on a terminal and as JSON."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rich.console import Group, RenderableType
from rich.table import Table as Grid
from rich.text import Text

from harness.completion.handle import UNSEEN_SHARE
from harness.completion.metrics import PARTS
from harness.completion.summary import POOLED
from harness.statistics import LEAST_OBJECTS
from harness.table.cells import UNDEFINED

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from harness.completion.rows import SceneRows
    from harness.completion.summary import HandleSummary, Report, Summary
    from harness.statistics import MeanEstimate

HEADINGS = {
    "chamfer_mm": "Chamfer mm",
    "accuracy_mm": "to mesh",
    "completeness_mm": "to cloud",
    "f_5mm": "F 5 mm",
    "f_10mm": "F 10 mm",
    "within_5mm": "in 5 mm",
    "spread_mm": "spread mm",
    "distance_mm": "distance mm",
    "right_mm": "of right",
    "wrong_mm": "of wrong",
    "auroc": "AUROC",
    "within_5mm_claimed": "claimed in 5 mm",
    "spread_at_handle_mm": "spread at handle",
    "spread_made_mm": "spread of made",
    "fused_mm": "fused",
    "best_mm": "best view",
    "mean_mm": "mean view",
    "fused_less_best_mm": "fused - best",
    "fused_less_mean_mm": "fused - mean",
}
LOWER_IS_BETTER = frozenset({"chamfer_mm", "fused_less_best_mm", "fused_less_mean_mm"})

EXPLANATION = (
    "Chamfer is the mean of both directions' mean distances, (to mesh + to cloud) / 2; F is the "
    "harmonic mean of the shares within the distance in both directions; in 5 mm is the share of "
    "the cloud's points within 5 mm of the true mesh. Seen is what lies within 5 mm of an observed "
    "point. Differences are paired by scene, with 95 % bootstrap (BCa) intervals that draw objects "
    f"with all their scenes: none ({UNDEFINED}) below {LEAST_OBJECTS} objects; n counts the scenes "
    "that define a value, where not all do. AUROC is that of "
    "the spread for points farther than 5 mm from the mesh."
)


def report_json(
    report: Report,
    scenes: Sequence[SceneRows],
    *,
    failures: Mapping[str, str],
    settings: Mapping[str, Any],
) -> str:
    """Write the report, every scene's rows and what they were measured under as JSON."""
    content = {
        "settings": settings,
        "summary": asdict(report),
        "scenes": [asdict(scene) for scene in sorted(scenes, key=lambda item: item.scene_id)],
        "failures": dict(sorted(failures.items())),
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def render_report(report: Report) -> RenderableType:
    """Lay the report out for a terminal."""
    parts: list[RenderableType] = []
    for category in report.unseen_share:
        parts += _category(report, category)
    parts += _handles(report.handles)
    parts += _latencies(report)
    for name, count in report.uncompleted.items():
        parts.append(Text(f"{name} completed nothing in {count} scenes", style="bold red"))
    parts.append(Text(EXPLANATION, style="dim"))
    return Group(*parts)


def _category(report: Report, category: str) -> Iterable[RenderableType]:
    clouds = [item for item in report.clouds if item.category == category and item.scenes]
    most = max(clouds, key=lambda item: item.scenes)
    title = category if category == POOLED else category.capitalize()
    about = (
        f"{most.scenes} scenes, {most.objects} objects, "
        f"{report.unseen_share[category]:.0%} of the surface unseen"
    )
    yield Text.assemble((title, "bold"), f": {about}")
    for part in PARTS:
        rows = [item for item in clouds if item.part == part]
        name = {"all": "the whole surface", "seen": "seen", "unseen": "unseen"}[part]
        yield _means(name, rows)
    differences = [item for item in report.differences if item.category == category]
    for part in PARTS:
        rows = [item for item in differences if item.part == part and item.scenes]
        yield _differences(f"paired differences, {part}", rows)
    spreads = [item for item in report.spreads if item.category == category and item.scenes]
    if spreads:
        yield _means("spread of all points", spreads)
    views = [item for item in report.views if item.category == category]
    if views:
        yield _means("several views: Chamfer mm", views, differences=("fused_less_",))
    yield Text()


def _means(
    title: str, rows: Sequence[Summary], *, differences: tuple[str, ...] = ()
) -> RenderableType:
    keys = list(rows[0].values)
    grid = _grid(title, [HEADINGS[key] for key in keys])
    for row in rows:
        grid.add_row(
            row.cloud,
            *(
                _signed(row.values[key])
                if key.startswith(differences)
                else _mean(row.values[key], scenes=row.scenes)
                for key in keys
            ),
        )
    return grid


def _differences(title: str, rows: Sequence[Summary]) -> RenderableType:
    if not rows:
        return Text(f"{title}: none", style="dim")
    keys = [key for key in rows[0].values if key != "f_10mm"]
    grid = _grid(title, [HEADINGS[key] for key in keys])
    for row in rows:
        cells = [Text(_signed(row.values[key]), style=_style(row.values[key], key)) for key in keys]
        grid.add_row(f"{row.cloud} - {row.less}", *cells)
    return grid


def _handles(handles: Sequence[HandleSummary]) -> Iterable[RenderableType]:
    if not handles:
        return
    keys = list(handles[0].means.values)
    outcomes = list(handles[0].outcomes)
    title = f"Handles of mugs (unseen: less than {UNSEEN_SHARE:.0%} of it seen)"
    grid = _grid(title, ["scenes", *outcomes, *(HEADINGS[key] for key in keys)])
    for item in handles:
        grid.add_row(
            f"{item.cloud}, {'unseen' if item.unseen else 'seen'}",
            str(item.means.scenes),
            *(str(item.outcomes[outcome]) for outcome in outcomes),
            *(_mean(item.means.values[key], scenes=item.means.scenes) for key in keys),
        )
    yield grid
    yield Text()


def _latencies(report: Report) -> Iterable[RenderableType]:
    if not report.latencies:
        return
    grid = _grid("Time per frame, ms", ["objects", "scenes", "median", "highest"])
    for item in report.latencies:
        grid.add_row(
            f"{item.cloud}, {item.stage}",
            str(item.objects),
            str(item.scenes),
            f"{item.median_ms:.0f}",
            f"{item.highest_ms:.0f}",
        )
    yield grid
    yield Text()


def _grid(title: str, headings: Sequence[str]) -> Grid:
    grid = Grid(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="")
    grid.add_column(Text(title, style="bold"), no_wrap=True, min_width=30)
    for heading in headings:
        grid.add_column(heading, justify="right", no_wrap=True)
    return grid


def _mean(estimate: MeanEstimate, *, scenes: int) -> str:
    if estimate.mean is None:
        return UNDEFINED
    partly = f" (n={estimate.count})" if estimate.count < scenes else ""
    return f"{estimate.mean:.2f}{partly}"


def _signed(estimate: MeanEstimate) -> str:
    if estimate.mean is None:
        return UNDEFINED
    if estimate.low is None:
        return f"{estimate.mean:+.2f} [{UNDEFINED}]"
    return f"{estimate.mean:+.2f} [{estimate.low:+.2f}, {estimate.high:+.2f}]"


def _style(estimate: MeanEstimate, key: str) -> str:
    if estimate.mean is None or estimate.low is None or estimate.high is None:
        return ""
    if estimate.low <= 0 <= estimate.high:
        return ""
    better = (estimate.mean < 0) == (key in LOWER_IS_BETTER)
    return "bold green" if better else "bold red"
