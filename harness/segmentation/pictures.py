"""Pictures of instances over the camera's image, and the reliability diagram."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont

from harness.pictures import CLASS_COLOURS, label, write_picture
from harness.runs.atomic import write_atomically
from harness.segmentation.calibration import BINS

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import numpy.typing as npt
    from matplotlib.axes import Axes

    from harness.cubes import Picture
    from harness.segmentation.numbers import Calibration

    Flags = npt.NDArray[np.bool_]

MASK_SHARE = 0.45
"""Of a masked pixel's colour, what is the category's."""
TRUE_OUTLINE = (255, 255, 255)
LABEL_PX = 18
LEAST_TOP_PX = 44
"""Labels keep below it: captions stand there."""
CELL_PX = (480, 360)


@dataclass(frozen=True, eq=False)
class Instance:
    """An instance to draw.

    Attributes
    ----------
    mask : (h, w) bool
    category, score
        Its label; its category is its colour too.
    """

    mask: Flags
    category: str
    score: float


def draw_instances(
    rgb: Picture, instances: Sequence[Instance], *, true_masks: Sequence[Flags] = ()
) -> Picture:
    """Draw instances over an image (h, w, 3) with their labels and scores.

    Parameters
    ----------
    rgb
        The camera's image.
    instances
        Drawn in their order.
    true_masks
        Each (h, w); outlined white.
    """
    canvas = rgb.astype(np.float64)
    for item in instances:
        colour = np.array(CLASS_COLOURS[item.category])
        canvas[item.mask] = (1 - MASK_SHARE) * canvas[item.mask] + MASK_SHARE * colour
        canvas[_rim(item.mask)] = colour
    for mask in true_masks:
        canvas[_rim(mask)] = TRUE_OUTLINE
    image = Image.fromarray(canvas.astype(np.uint8))
    pen = ImageDraw.Draw(image)
    font = ImageFont.load_default(LABEL_PX)
    taken: list[tuple[float, float, float, float]] = []
    for item in instances:
        if not item.mask.any():
            continue
        rows, columns = np.nonzero(item.mask)
        text = f"{item.category} {item.score:.2f}"
        _, _, width, height = pen.textbbox((0, 0), text, font=font)
        left = float(np.clip(columns.mean() - width / 2, 3, max(3, image.width - width - 3)))
        top = float(max(rows.min() - height - 6, min(LEAST_TOP_PX, image.height - height - 6)))
        # A label that would cover another goes below it.
        while any(
            left < right and low_left < left + width and top < bottom and low_top < top + height
            for low_left, low_top, right, bottom in taken
        ):
            top += height + 6
        taken.append((left - 3, top - 3, left + width + 3, top + height + 3))
        pen.rectangle(taken[-1], fill=CLASS_COLOURS[item.category])
        pen.text((left, top), text, fill="black", font=font)
    return np.asarray(image)


def write_sheet(path: Path, rows: Sequence[Sequence[tuple[Picture, str]]]) -> None:
    """Write rows of pictures, each with its caption, as one."""
    width, height = CELL_PX
    columns = max(len(row) for row in rows)
    sheet = np.full((len(rows) * height, columns * width, 3), 255, dtype=np.uint8)
    for number, row in enumerate(rows):
        for column, (picture, caption) in enumerate(row):
            cell = np.asarray(Image.fromarray(picture).resize(CELL_PX))
            sheet[
                number * height : (number + 1) * height, column * width : (column + 1) * width
            ] = label(cell, caption)
    write_picture(path, sheet)


def write_reliability(path: Path, rows: Sequence[Sequence[Calibration]]) -> None:
    """Write reliability diagrams: a row for each segmenter, before and after calibration."""
    columns = max(len(row) for row in rows)
    figure = Figure(figsize=(4.2 * columns, 4.6 * len(rows)), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(
        2 * len(rows), columns, squeeze=False, height_ratios=[3, 1] * len(rows), sharex=True
    )
    for number, row in enumerate(rows):
        for column in range(columns):
            above, below = grid[2 * number, column], grid[2 * number + 1, column]
            if column < len(row):
                _reliability(above, below, row[column], alone=len(row) == 1)
            else:
                above.set_axis_off()
                below.set_axis_off()
    write_atomically(path, lambda file: figure.savefig(file, format="png"))


def _reliability(above: Axes, below: Axes, item: Calibration, *, alone: bool) -> None:
    """Draw one diagram, and under it how many detections each bin holds.

    One that stands alone is of a segmenter that does not calibrate.
    """
    width = 1.0 / BINS
    scores = [entry.mean_score for entry in item.bins]
    lefts = [min(int(score * BINS), BINS - 1) * width for score in scores]
    shares = [entry.share_right for entry in item.bins]
    above.plot([0, 1], [0, 1], color="0.6", linewidth=1, linestyle="--")
    above.bar(lefts, shares, width=width, align="edge", color="#56B4E9", edgecolor="white")
    above.plot(scores, shares, "o", color="#D55E00", markersize=4)
    state = "" if alone else ", calibrated" if item.calibrated else ", before calibration"
    error = "undefined" if item.ece.mean is None else f"{item.ece.mean:.3f}"
    above.set_title(f"{item.segmenter}{state}: ECE {error}", fontsize=10)
    above.set(xlim=(0, 1), ylim=(0, 1), ylabel="share that is right")
    below.bar(
        lefts,
        [entry.count for entry in item.bins],
        width=width,
        align="edge",
        color="0.6",
        edgecolor="white",
    )
    below.tick_params(labelbottom=True)
    below.set(yscale="log", xlabel=f"score, {item.detections} detections", ylabel="detections")


def _rim(mask: Flags) -> Flags:
    """Pixels of a mask (h, w) that have one beside, above or below them that is not of it."""
    padded = np.pad(mask, 1)
    inner = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return np.asarray(mask & ~inner)
