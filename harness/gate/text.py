"""How a verdict reads on a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Group
from rich.table import Table
from rich.text import Text

from harness.gate.margins import LEAST_OBJECTS, LEVEL, SLOWER
from harness.gate.pairs import ALL
from harness.statistics import MeanEstimate
from harness.table.cells import UNDEFINED, compact, compact_difference
from harness.table.summary import MODEL_ORDER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import RenderableType

    from harness.gate.judge import Judgement
    from harness.gate.pairs import Cell
    from harness.gate.run import GateResult
    from harness.gate.speed import Speed

OVERVIEW = "precision"
"""The metric that is shown of every cell."""

MOST_NAMED = 10
"""Lost scenes, and rows with their worst scenes, that are named."""

_STYLES = {"worse": "bold red", "unsure": "yellow", "unjudged": "yellow"}


def render_verdict(result: GateResult, *, everything: bool = False) -> RenderableType:
    """Lay out the verdict: what failed first, then the precision of every cell, or every row."""
    quality = result.quality
    parts: list[RenderableType] = []
    shown = [row for row in quality.rows if everything or row.metric == OVERVIEW]
    if quality.lost:
        parts += [_lost(result), Text()]
    if quality.worse:
        parts += [
            Text("Worse than the baseline", style="bold"),
            _table(quality.worse, metrics=True),
            Text(),
        ]
        parts += [Text(line) for line in _worst_scenes(quality.worse)] + [Text()]
    if everything or any(row.verdict not in {"same", "unjudged"} for row in quality.rows):
        head = "Every metric of every cell" if everything else "Precision of every cell"
        parts += [Text(head, style="bold"), _table(shown, metrics=everything)]
        parts += [Text(_about(result, len(shown))), Text()]
    else:
        parts.append(
            Text("No scene that both runs scored differs in any metric (--all: the rows).")
        )
    parts += [*_speed(result.speed), *(Text(f"Note: {note}") for note in result.notes)]
    if result.settings:
        parts.append(Text("Set differently, so that the verdict is on this too:"))
        parts += [
            Text(f"  {key}: {there} in the baseline, {here} now")
            for key, there, here in result.settings
        ]
    return Group(*parts)


def headline(result: GateResult) -> str:
    """Say the verdict in a line."""
    quality = result.quality
    counts = [
        (len({item.scene_id for item in quality.lost}), f"of {quality.scenes} scenes lost"),
        (len(quality.worse), f"of {len(quality.rows)} rows worse"),
        (
            sum(stage.slower for stage in result.speed.stages),
            f"of {len(result.speed.stages)} stages slower",
        ),
    ]
    found = ", ".join(f"{count} {what}" for count, what in counts if count)
    word = "PASS" if result.passed else "FAIL"
    about = f"{quality.scenes} scenes of {result.run} against {result.against}"
    return f"{word}: {about} ({result.revision[:10]})" + (f": {found}" if found else "")


def _lost(result: GateResult) -> RenderableType:
    lost = result.quality.lost
    lines = [f"  {item.scene_id} {item.what}: {item.of}: {item.why}" for item in lost[:MOST_NAMED]]
    if len(lost) > MOST_NAMED:
        lines.append(f"  and {len(lost) - MOST_NAMED} more; --json names all")
    head = Text("In the baseline and not in the run", style="bold red")
    return Group(head, *(Text(line) for line in lines))


def _table(rows: Sequence[Judgement], *, metrics: bool) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 0, 0, 2), header_style="dim")
    table.add_column("cell", no_wrap=False)
    if metrics:
        table.add_column("metric", no_wrap=True)
    for name in ("baseline", "now", "difference", "margin", "detectable"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for row in sorted(rows, key=lambda row: _order(row.cell)):
        table.add_row(
            cell_name(row.cell),
            *([row.heading] if metrics else []),
            compact(row.baseline),
            compact(row.now),
            _difference(row),
            compact(row.margin),
            compact(row.minimum_detectable),
            Text(_verdict(row), style=_STYLES.get(row.verdict, "")),
        )
    return table


def cell_name(cell: Cell) -> str:
    """Name a cell, such as ``mug box metric literal``."""
    parts = (cell.category, "" if cell.test_set == ALL else cell.test_set, cell.model)
    return " ".join(filter(None, parts)).replace("_", " ")


def _order(cell: Cell) -> tuple[object, ...]:
    known = cell.model in MODEL_ORDER
    place = MODEL_ORDER.index(cell.model) if known else len(MODEL_ORDER)
    return (cell.category, cell.test_set, place, cell.model)


def _difference(row: Judgement) -> str:
    if row.verdict == "same":
        return "0"
    return compact_difference(
        MeanEstimate(mean=row.difference, low=row.low, high=row.high, count=row.scenes)
    )


def _verdict(row: Judgement) -> str:
    match row.verdict:
        case "unsure":
            return "within noise"
        case "unjudged":
            return f"{row.objects} objects"
        case _:
            return row.verdict


def _worst_scenes(rows: Sequence[Judgement]) -> list[str]:
    """Name the scenes that lose most, of each single cell that is worse, or of all."""
    single = [row for row in rows if row.cell.category != ALL] or rows
    lines = [
        f"{cell_name(row.cell)}, {row.heading}: loses most in "
        + ", ".join(f"{item.scene_id} ({item.loss:.3f})" for item in row.worst)
        for row in single[:MOST_NAMED]
    ]
    more = len(single) - MOST_NAMED
    return [*lines, f"and so on in {more} more rows: --json"] if more > 0 else lines


def _about(result: GateResult, shown: int) -> str:
    rows = result.quality.rows
    more = len(rows) - shown
    counts = {name: sum(row.verdict == name for row in rows) for name in _STYLES}
    text = (
        "Differences [95 %] are paired by scene, by "
        f"objects; {UNDEFINED} is undefined; 'all' is over all classes or cells. A row is "
        f"worse where its loss is surely beyond the margin (Benjamini-Hochberg at {LEVEL:.0%}; "
        "rows of single cells, of all classes and of all cells are each a family); detectable: the "
        f"least true loss that is found 4 times in 5. Rows of fewer than {LEAST_OBJECTS} objects "
        f"are not judged ({counts['unjudged']} here); {counts['unsure']} lose more than the "
        "margin, which may be noise."
    )
    return text + (f" {more} further rows: --all." if more else "")


def _speed(speed: Speed) -> list[RenderableType]:
    if speed.refused is not None:
        return [Text(f"Speed is not judged: {speed.refused}.")]
    slower = [stage for stage in speed.stages if stage.slower]
    head = Text(
        f"Speed: {len(slower)} of {len(speed.stages)} stages surely take more than {SLOWER:g} "
        f"times as long (machine's pace {speed.pace:.2f} divided out)",
        style="bold red" if slower else "",
    )
    lines = [
        Text(
            f"  {' '.join(filter(None, (stage.stage, stage.model)))}: {stage.baseline_s:.3f} s -> "
            f"{stage.now_s:.3f} s, {stage.ratio:.2f} times (at least {stage.low:.2f})"
        )
        for stage in slower
    ]
    return [head, *lines]
