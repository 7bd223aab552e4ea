"""What pictures are made with: captions, a common width, files that are whole or absent."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from harness.runs.atomic import write_atomically

if TYPE_CHECKING:
    from pathlib import Path

    from harness.cubes import Picture


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
