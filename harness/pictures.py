"""What pictures are made with: colours, captions, a common width, whole files."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from harness.runs.atomic import write_atomically

if TYPE_CHECKING:
    from pathlib import Path

    from harness.cubes import Picture

# Okabe and Ito's palette, which colour-blind readers can tell apart; free space is not drawn.
CLASS_COLOURS = {
    "free": (153, 153, 153),
    "bottle": (230, 159, 0),
    "bowl": (86, 180, 233),
    "camera": (0, 158, 115),
    "can": (240, 228, 66),
    "laptop": (204, 121, 167),
    "mug": (213, 94, 0),
}


def label(image: Picture, text: str) -> Picture:
    """Copy the image, with a caption in its upper left corner."""
    picture = Image.fromarray(image)
    ImageDraw.Draw(picture).text(
        (8, 6),
        text,
        fill="white",
        font=ImageFont.load_default(20),
        stroke_width=2,
        stroke_fill="black",
    )
    return np.asarray(picture)


def fit_width(image: Picture, width: int) -> Picture:
    """Scale the image to a width, its proportions kept."""
    height = round(image.shape[0] * width / image.shape[1])
    return np.asarray(Image.fromarray(image).resize((width, height)))


def write_picture(path: Path, picture: Picture) -> None:
    """Write a PNG, whole or not at all."""
    write_atomically(path, partial(Image.fromarray(picture).save, format="PNG"))
