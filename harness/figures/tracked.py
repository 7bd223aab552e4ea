"""The seed's Fig. 3 and 5: the map with its tracked objects, and beside the camera's image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from matplotlib.patheffects import withStroke
from PIL import Image
from scipy.spatial import cKDTree

from harness.cubes import View
from harness.figures.panels import (
    Layout,
    dot_legend,
    legend_height,
    letter,
    picture_grid,
    scale_bar,
    show_picture,
    under_panel,
)
from harness.figures.solid import (
    TABLE_COLOUR,
    camera_view,
    direction_to_cameras,
    draw_spheres,
    draw_voxels,
    keep_voxels,
)
from harness.figures.source import NothingToDrawError
from harness.figures.style import DPI, ONE_COLUMN_IN, SMALL_PT, class_colour, hex_of, rgb_of
from harness.native import CLASS_NAMES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from harness.figures.source import RunSource
    from harness.recordings.recording import MappedCloud, Recording

Floats = npt.NDArray[np.float64]

CAMERA_ASPECT = 4 / 3
MARKER_RADIUS = 0.035
"""Of what is drawn, by its greatest extent."""
ABOVE = 0.03, 0.35
"""Height of a marker over the highest point of its object: metres, and by its width."""
TABLE_MARGIN_M = 0.05
DISTANCE_M = 0.9
MOST_RAISES = 60
LEGEND_COLUMNS = 4


def draw_tracked(source: RunSource) -> tuple[Figure, str]:
    """Draw Fig. 3: of each class the scene with most tracked objects, spheres for their ids.

    Raises
    ------
    NothingToDrawError
        No chosen scene has a tracked object.
    """
    scenes = [item for item in source.most_tracked if item.tracked]
    if not scenes:
        raise NothingToDrawError("no chosen scene has a tracked object")
    named = _name_classes(scenes)
    bottom = legend_height(len(named), columns=LEGEND_COLUMNS)
    layout = Layout(width=ONE_COLUMN_IN, aspect=1.05, top=0.04, under=0.22, bottom=bottom)
    grid = picture_grid(1, len(scenes), layout=layout)
    for recording, axes in zip(scenes, grid.axes[0], strict=True):
        _draw_tracked(recording, axes, size=grid.panel_px)
        objects = f"{len(recording.objects)} object" + "s" * (len(recording.objects) > 1)
        under_panel(axes, f"{recording.scene_id}: {objects}, {len(recording.tracked)} tracked")
    dot_legend(grid.figure, named, marker="s", columns=LEGEND_COLUMNS)
    names = " and ".join(item.scene_id for item in scenes)
    return grid.figure, (
        f"{names}, of each class the scene with most tracked objects, of several the median one; "
        "voxels by class, a sphere over each tracked object with its id"
    )


def draw_beside(source: RunSource) -> tuple[Figure, str]:
    """Draw Fig. 5: of each class's median scene, the last camera image and the map beside it.

    Raises
    ------
    NothingToDrawError
        No chosen scene has a view.
    """
    scenes = [item for item in source.chosen if item.views]
    if not scenes:
        raise NothingToDrawError("no chosen scene has a view")
    named = _name_classes(scenes)
    bottom = legend_height(len(named), columns=LEGEND_COLUMNS)
    layout = Layout(width=ONE_COLUMN_IN, aspect=CAMERA_ASPECT, top=0.2, under=0.05, bottom=bottom)
    grid = picture_grid(len(scenes), 2, layout=layout)
    for recording, axes in zip(scenes, grid.axes, strict=True):
        shot = recording.views[-1]
        view = camera_view(shot, width_px=grid.panel_px[0])
        image = Image.fromarray(shot.rgb).resize(view.size, Image.Resampling.LANCZOS)
        show_picture(axes[0], np.asarray(image))
        show_picture(axes[1], draw_voxels(recording.voxels, view=view))
        middle = recording.target.vertices_world.mean(axis=0).astype(np.float64)
        scale_bar(axes[0], view=view, at_world=middle, light=True)
        scale_bar(axes[1], view=view, at_world=middle)
    for panel, name, title in zip(grid.axes[0], "ab", ("camera", "semantic map"), strict=True):
        letter(panel, name)
        panel.set_title(title, pad=3)
    dot_legend(grid.figure, named, marker="s", columns=LEGEND_COLUMNS)
    names = " and ".join(item.scene_id for item in scenes)
    return grid.figure, (
        f"{names}, each the median scene of its class; last view, map of all views from there"
    )


def _name_classes(scenes: Sequence[Recording]) -> dict[str, str]:
    """Colours of the classes that the scenes' maps hold, by their names."""
    found = np.unique(np.concatenate([item.voxels.classes for item in scenes]))
    named = {CLASS_NAMES[index]: class_colour(CLASS_NAMES[index]) for index in found if index}
    return named | {"other": hex_of(np.array(TABLE_COLOUR, dtype=np.uint8))}


def _draw_tracked(recording: Recording, axes: Axes, *, size: tuple[int, int]) -> None:
    clouds = [cloud.observed_world.astype(np.float64) for cloud in recording.tracked]
    plan = cKDTree(np.concatenate(clouds)[:, :2])
    distance, _ = plan.query(recording.voxels.centres_world[:, :2])
    voxels = keep_voxels(recording.voxels, np.asarray(distance <= TABLE_MARGIN_M))
    centres = voxels.centres_world.astype(np.float64)
    focus = (centres.min(axis=0) + centres.max(axis=0)) / 2
    eye = focus + DISTANCE_M * direction_to_cameras(recording, focus)
    radius_m = MARKER_RADIUS * float(np.ptp(centres, axis=0).max())
    names = [f"#{cloud.id} {cloud.category}" for cloud in recording.tracked]
    markers, view = spread_markers(
        np.stack([marker_place(cloud) for cloud in recording.tracked]),
        names=names,
        shown_world=centres,
        view=View(eye, focus, size=size),
        radius_m=radius_m,
    )
    colours = np.stack([rgb_of(class_colour(cloud.category)) for cloud in recording.tracked])
    picture = draw_voxels(voxels, view=view)
    picture = draw_spheres(markers, colours, radius_m=radius_m, view=view, over=picture)
    show_picture(axes, picture)
    boxes = label_boxes(markers, names=names, view=view, radius_m=radius_m)
    for cloud, name, box in zip(recording.tracked, names, boxes, strict=True):
        foot = view.project(cloud.centroid_world)
        axes.plot([box.u, foot[0]], [box.bottom, foot[1]], color="black", linewidth=0.6)
        axes.text(
            box.u,
            box.text,
            name,
            ha="center",
            va="bottom",
            fontsize=SMALL_PT,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
        )
    scale_bar(axes, view=view, at_world=focus)


@dataclass(frozen=True)
class LabelBox:
    """A marker and its name in a picture, pixels: its middle, half its width, and its heights.

    `text` is the lower edge of the name.
    """

    u: float
    half: float
    top: float
    text: float
    bottom: float

    def meets(self, other: LabelBox) -> bool:
        """Whether two boxes overlap."""
        apart = abs(self.u - other.u) >= self.half + other.half
        return not (apart or self.top >= other.bottom or other.top >= self.bottom)


def label_boxes(
    markers: Floats, *, names: Sequence[str], view: View, radius_m: float
) -> list[LabelBox]:
    """Take the room in a picture that markers (n, 3) and the names over them need."""
    letter_px = SMALL_PT / 72 * DPI
    radii = radius_m * view.focal * view.size[1] / view.depths(markers)
    boxes = []
    for (u, v), radius, name in zip(view.project(markers), radii, names, strict=True):
        text = float(v - 1.3 * radius)
        boxes.append(
            LabelBox(
                u=float(u),
                half=max(0.32 * letter_px * len(name), float(radius)),
                top=text - 1.1 * letter_px,
                text=text,
                bottom=float(v + radius),
            )
        )
    return boxes


def spread_markers(
    markers: Floats, *, names: Sequence[str], shown_world: Floats, view: View, radius_m: float
) -> tuple[Floats, View]:
    """Raise markers (n, 3) until no name hides another, and fit the view to all.

    Of two that meet the upper one is raised; after `MOST_RAISES` they stay as they are.
    """
    markers = markers.copy()

    def fit() -> View:
        above = markers + np.array([0.0, 0.0, 3 * radius_m])
        return view.fitted_to(np.concatenate([shown_world, above]))

    for _ in range(MOST_RAISES):
        boxes = label_boxes(markers, names=names, view=fit(), radius_m=radius_m)
        meeting = [(i, j) for i in range(len(boxes)) for j in range(i) if boxes[i].meets(boxes[j])]
        if not meeting:
            break
        upper = min(meeting[0], key=lambda index: boxes[index].bottom)
        markers[upper, 2] += radius_m
    return markers, fit()


def marker_place(cloud: MappedCloud) -> Floats:
    """Where the sphere of a tracked object stands, (3,): over its centroid, clear of its top."""
    points = cloud.observed_world.astype(np.float64)
    width = float(np.ptp(points[:, :2], axis=0).max())
    return np.array([*cloud.centroid_world[:2], points[:, 2].max() + ABOVE[0] + ABOVE[1] * width])
