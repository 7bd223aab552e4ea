"""Pictures of completed shapes: observed points red, completed points white, the true mesh grey."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from harness.completion.clouds import spread_evenly
from harness.pictures import label, write_picture
from harness.surface_picture import (
    COMPLETED_COLOUR,
    OBSERVED_COLOUR,
    Backdrop,
    Dots,
    two_sides,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import numpy.typing as npt

    from harness.cubes import Picture
    from harness.native import MeshTruth

    Floats = npt.NDArray[np.float64]

PANEL_PX = (360, 360)
OBSERVED_POINTS = 1500
SHEET_COLUMNS = 2
SHEET_SCENES = 12


def draw_panels(
    truth: MeshTruth,
    *,
    surface_world: Floats,
    observed_world: Floats,
    clouds: Mapping[str, Floats],
    camera_world: Floats,
    size: tuple[int, int] = PANEL_PX,
) -> dict[str, tuple[Picture, Picture]]:
    """Draw each cloud over the surface, from the camera's side and from behind.

    Parameters
    ----------
    truth
        The true surface.
    surface_world : (n, 3) float64
        Points of it, which fill the picture.
    observed_world : (n, 3) float64
        What the views saw.
    clouds
        Completed points by the completer's name; none draws the observed points alone.
    camera_world : (3,) float64
        Where the camera stood.
    size
        Of a panel, pixels.
    """
    red = Dots(observed_world, OBSERVED_COLOUR)
    front, back = (
        Backdrop(truth, view)
        for view in two_sides(surface_world, camera_world=camera_world, size=size)
    )
    white = {name: Dots(points, COMPLETED_COLOUR) for name, points in clouds.items()}
    return {
        name: (front.draw([dots, red]), back.draw([dots, red]))
        for name, dots in (white or {"observed": Dots(np.zeros((0, 3)), COMPLETED_COLOUR)}).items()
    }


def draw_scene(
    path: Path,
    truth: MeshTruth,
    *,
    title: str,
    surface_world: Floats,
    observed_world: Floats,
    clouds: Mapping[str, Floats],
    camera_world: Floats,
) -> None:
    """Write a scene's picture: a line for each cloud, seen from two sides."""
    panels = draw_panels(
        truth,
        surface_world=surface_world,
        observed_world=spread_evenly(observed_world, count=OBSERVED_POINTS),
        clouds=clouds,
        camera_world=camera_world,
    )
    lines = [
        np.concatenate([label(front, f"{title}: {name}"), label(back, "from behind")], axis=1)
        for name, (front, back) in panels.items()
    ]
    write_picture(path, np.concatenate(lines, axis=0))


def write_sheet(path: Path, scenes: Sequence[Path]) -> None:
    """Write one picture of the first scenes' pictures, side by side and below one another."""
    pictures = [np.asarray(Image.open(scene)) for scene in scenes[:SHEET_SCENES]]
    height = max(picture.shape[0] for picture in pictures)
    width = max(picture.shape[1] for picture in pictures)
    columns = min(SHEET_COLUMNS, len(pictures))
    rows = -(-len(pictures) // columns)
    sheet = np.full((rows * height, columns * width, 3), 255, dtype=np.uint8)
    for number, picture in enumerate(pictures):
        top, left = height * (number // columns), width * (number % columns)
        sheet[top : top + picture.shape[0], left : left + picture.shape[1]] = picture
    write_picture(path, sheet)
