"""What a scene is and how each model did in it, as Markdown, and what its colours mean."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from harness.figures.style import MODELS, confidence_colours
from harness.pictures import CLASS_COLOURS
from harness.table.columns import (
    CALIBRATION_COLUMNS,
    CONFIDENCE_COLUMNS,
    RANKING_COLUMNS,
    SEED_COLUMNS,
)
from harness.view.names import set_name
from harness.view.points import OUTCOMES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy.typing as npt

    from harness.recordings.recording import Recording
    from harness.runs.records import Record

SHOWN = (
    "precision",
    "recall",
    "accuracy",
    "auroc",
    "brier_recalibrated",
    "ece_recalibrated",
    "aurc",
)
COLUMNS = tuple(
    column
    for column in (*SEED_COLUMNS, *RANKING_COLUMNS, *CALIBRATION_COLUMNS, *CONFIDENCE_COLUMNS)
    if column.key in SHOWN
)

LEGEND_WIDTH, LEGEND_HEIGHT = 480, 270
_MARGIN, _BAR, _SWATCH = 16, 24, 18
_PAPER, _INK = (245, 245, 245), (20, 20, 20)
_FONT = ImageFont.load_default(15)


def describe(
    recording: Recording,
    records: Sequence[Record],
    *,
    run_name: str,
    model: str,
    tolerance_m: float,
    note: str | None,
) -> str:
    """Describe a scene, with a table of its metrics for each test set.

    Parameters
    ----------
    recording
        The scene.
    records
        The scene's, at the tolerance.
    run_name
        The run's folder.
    model
        Whose confidence is shown.
    tolerance_m
        A point lies on the mesh within this distance.
    note
        Why there are no records; None if there are.
    """
    cloud = recording.target_cloud
    found = "missed" if cloud is None else f"mapped as {cloud.category} #{cloud.id}"
    lines = [
        f"# {recording.scene_id}: {recording.target.name}",
        f"Run {run_name}, {len(recording.views)} views, masks of {recording.segmenter}, "
        f"completion {recording.completer}. The target was {found}.",
        f"Step 0 to {len(recording.views) - 1}: after each view. Step {len(recording.views)}: "
        f"the result, with the confidence of **{_label(model)}**.",
    ]
    if note is not None:
        lines.append(note)
    for completion in dict.fromkeys(record.completion for record in records):
        rows = [record for record in records if record.completion == completion]
        lines += _table(rows, completion=completion, model=model, tolerance_m=tolerance_m)
    return "\n\n".join(lines) + "\n"


def _table(
    records: Sequence[Record], *, completion: str, model: str, tolerance_m: float
) -> list[str]:
    head = f"## Test set {set_name(completion)} ({completion}), within {1e3 * tolerance_m:g} mm"
    if failures := {record.failure for record in records if record.status == "failed"}:
        return [head, f"Failed: {'; '.join(sorted(map(str, failures)))}."]
    rows = ["| model | " + " | ".join(column.heading for column in COLUMNS) + " |"]
    rows.append("|---" * (len(COLUMNS) + 1) + "|")
    for record in records:
        values = [column.value(record) for column in COLUMNS]
        cells = ["-" if value is None else f"{value:.3f}" for value in values]
        name = _label(record.model)
        rows.append("| " + " | ".join([f"**{name}**" if record.model == model else name, *cells]))
        rows[-1] += " |"
    points = records[0].test_points
    return [
        head,
        f"{points} points, {records[0].base_rate:.1%} of them on the mesh.",
        "\n".join(rows),
    ]


def draw_legend(recording: Recording) -> npt.NDArray[np.uint8]:
    """Draw what colours mean (h, w, 3): the scale of confidences, classes in view, outcomes."""
    picture = Image.new("RGB", (LEGEND_WIDTH, LEGEND_HEIGHT), _PAPER)
    pen = ImageDraw.Draw(picture)
    pen.text((_MARGIN, 10), "confidence that a point lies on the target", _INK, _FONT)
    width = LEGEND_WIDTH - 2 * _MARGIN
    ramp = confidence_colours(np.linspace(0.0, 1.0, width))
    picture.paste(Image.fromarray(np.tile(ramp, (_BAR, 1, 1))), (_MARGIN, 34))
    for value, anchor in ((0.0, "la"), (0.25, "ma"), (0.5, "ma"), (0.75, "ma"), (1.0, "ra")):
        pen.text((_MARGIN + value * width, 62), f"{value:g}", _INK, _FONT, anchor=anchor)
    seen = {item.category for item in recording.objects}
    seen |= {item.category for item in recording.tracked}
    classes = {name: colour for name, colour in CLASS_COLOURS.items() if name in seen}
    _draw_swatches(pen, {**classes, "no object": CLASS_COLOURS["free"]}, top=100, columns=4)
    judged = "judged: put on the target (positive) and whether it is there"
    pen.text((_MARGIN, 170), judged, _INK, _FONT)
    _draw_swatches(pen, OUTCOMES, top=196, columns=2)
    return np.asarray(picture)


def _draw_swatches(
    pen: ImageDraw.ImageDraw,
    swatches: Mapping[str, tuple[int, int, int]],
    *,
    top: int,
    columns: int,
) -> None:
    width = (LEGEND_WIDTH - 2 * _MARGIN) // columns
    for place, (name, colour) in enumerate(swatches.items()):
        x, y = _MARGIN + width * (place % columns), top + 30 * (place // columns)
        pen.rectangle((x, y, x + _SWATCH, y + _SWATCH), fill=colour)
        pen.text((x + _SWATCH + 6, y), name, _INK, _FONT)


def _label(model: str) -> str:
    return MODELS[model].label if model in MODELS else model
