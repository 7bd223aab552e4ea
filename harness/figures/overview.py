"""The seed's Fig. 1: camera image, semantic map, the map completed, points by confidence."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from harness.figures.panels import (
    Layout,
    confidence_bar,
    dot_legend,
    legend_height,
    letter,
    picture_grid,
    row_label,
    scale_bar,
    show_picture,
)
from harness.figures.solid import (
    TABLE_COLOUR,
    best_view,
    camera_view,
    completed_points,
    draw_completed_map,
    draw_mesh,
    draw_spheres,
    draw_voxels,
    near_target,
    shown_points,
    sphere_radius,
    tint,
    view_from_behind,
    window_around,
)
from harness.figures.source import PREFERRED_MODEL, NothingToDrawError
from harness.figures.style import TWO_COLUMNS_IN, class_colour, confidence_colours, hex_of
from harness.native import CLASS_NAMES
from harness.pictures import CLASS_COLOURS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from harness.figures.source import RunSource
    from harness.recordings.recording import Recording

ASPECT = 1.15
LEGEND_COLUMNS = 5
BAR_HEIGHT_IN = 0.26
"""Room for the scale of confidence."""
TITLES = ("camera", "semantic map", "with shape completion", "completed, by confidence")


def draw_overview(source: RunSource) -> tuple[Figure, str]:
    """Draw Fig. 1 of each class's median scene; returns the figure and its caption.

    Raises
    ------
    NothingToDrawError
        No recording has a completed target and answers of the metric model.
    """
    scenes = [item for item in source.chosen if _is_whole(item)]
    if not scenes:
        raise NothingToDrawError(
            f"no chosen scene has a completed target with answers of the {PREFERRED_MODEL} model"
        )
    around = [near_target(item) for item in scenes]
    named = _name_colours(around)
    bottom = max(BAR_HEIGHT_IN, legend_height(len(named), columns=LEGEND_COLUMNS))
    layout = Layout(width=TWO_COLUMNS_IN, aspect=ASPECT, left=0.2, top=0.2, bottom=bottom)
    grid = picture_grid(len(scenes), len(TITLES), layout=layout)
    for recording, near, axes in zip(scenes, around, grid.axes, strict=True):
        _draw_row(recording, near, axes, size=grid.panel_px)
        row_label(axes[0], recording.category)
    for panel, name, title in zip(grid.axes[0], "abcd", TITLES, strict=True):
        letter(panel, name)
        panel.set_title(title, pad=3)
    dot_legend(grid.figure, named, centre=0.36, marker="s", columns=LEGEND_COLUMNS)
    height_in = grid.figure.get_figheight()
    place = (0.84, 0.14 / height_in, 0.14, 0.06 / height_in)
    confidence_bar(grid.figure, place=place, label="confidence")
    names = " and ".join(item.scene_id for item in scenes)
    return grid.figure, (
        f"{names}, each the median scene of its class; b to d from the side that no camera saw, "
        f"white where nothing was measured; confidence of the {PREFERRED_MODEL} model"
    )


def _is_whole(recording: Recording) -> bool:
    return PREFERRED_MODEL in recording.answers and completed_points(recording) is not None


def _draw_row(
    recording: Recording, near: Recording, axes: Sequence[Axes], *, size: tuple[int, int]
) -> None:
    """Draw a scene, of whose map `near` holds what lies about the target."""
    middle = shown_points(recording).mean(axis=0)
    shot = best_view(recording)
    window = window_around(shot, shown_points(recording), aspect=ASPECT)
    seen = replace(camera_view(shot, window=window, width_px=size[0]), size=size)
    image = Image.fromarray(window.of(shot.rgb)).resize(size, Image.Resampling.LANCZOS)
    show_picture(axes[0], np.asarray(image))
    scale_bar(axes[0], view=seen, at_world=middle, light=True)
    behind = view_from_behind(near, size=size, with_map=True)
    show_picture(axes[1], draw_voxels(near.voxels, view=behind))
    show_picture(axes[2], draw_completed_map(near, view=behind))
    part = completed_points(recording)
    points = recording.test_world[part].astype(np.float64)
    colours = confidence_colours(recording.answers[PREFERRED_MODEL].confidence[part])
    mesh = draw_mesh((recording.target,), view=behind)
    radius_m = sphere_radius(recording)
    show_picture(axes[3], draw_spheres(points, colours, radius_m=radius_m, view=behind, over=mesh))
    for panel in axes[1:]:
        scale_bar(panel, view=behind, at_world=middle)


def _name_colours(scenes: Sequence[Recording]) -> dict[str, str]:
    """Colours of what is seen and completed of each class that the scenes show, by name."""
    categories: dict[str, None] = {}
    for item in scenes:
        categories[item.category] = None
        categories |= {
            CLASS_NAMES[index]: None for index in np.unique(item.voxels.classes) if index
        }
        categories |= {cloud.category: None for cloud in item.tracked if len(cloud.completed_world)}
    named = {}
    for category in categories:
        named[f"{category}, seen"] = class_colour(category)
        named[f"{category}, completed"] = hex_of(tint(CLASS_COLOURS[category]))
    return named | {"other": hex_of(np.array(TABLE_COLOUR, dtype=np.uint8))}
