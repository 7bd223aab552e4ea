"""How long each stage took."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

import numpy as np

from harness.html_report.grid import Cell, Grid, Heading, number_cell

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.runs.records import Timing

WHOLE = "scene"
"""Name of the stage that is all others together."""


def timing_grid(timings: Sequence[Timing]) -> Grid:
    """Summarise stages over scenes, in the order in which they ran, the whole scene first."""
    stages: defaultdict[tuple[str, str], list[Timing]] = defaultdict(list)
    for item in timings:
        stages[item.stage, (item.model or "").replace("_", " ")].append(item)
    whole = sum(item.seconds for item in timings if item.stage == WHOLE)
    rows = []
    for (stage, model), items in sorted(stages.items(), key=lambda entry: entry[0][0] != WHOLE):
        seconds = np.array([item.seconds for item in items])
        low, middle, high = np.percentile(seconds, [5, 50, 95]).tolist()
        share = float(seconds.sum()) / whole if whole else None
        memory = [item.peak_memory_mib for item in items if item.peak_memory_mib is not None]
        peak = max(memory, default=None)
        rows.append(
            (
                Cell("whole scene" if stage == WHOLE else stage),
                Cell(model),
                number_cell(middle),
                number_cell(float(seconds.mean())),
                number_cell(low),
                number_cell(high),
                number_cell(share, None if share is None else f"{share:.1%}"),
                number_cell(len(items), str(len(items))),
                number_cell(peak, None if peak is None else f"{peak:.0f}"),
            )
        )
    return Grid(
        "Wall time of each stage per scene, seconds",
        (
            Heading("stage", numeric=False),
            Heading("model", numeric=False),
            Heading("median"),
            Heading("mean"),
            Heading("5 %", about="Of the scenes, 5 in 100 took less."),
            Heading("95 %", about="Of the scenes, 5 in 100 took more."),
            Heading("share", about="Of all scenes' time."),
            Heading("scenes"),
            Heading("peak MiB", about="Highest resident memory of a worker."),
        ),
        rows,
    )
