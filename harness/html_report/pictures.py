"""A recorded scene in small pictures that a page carries within itself."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from harness.cubes import Picture, View, draw_cubes
from harness.figures.style import confidence_colours
from harness.html_report.names import plain
from harness.native import CLASS_NAMES, MeshTruth
from harness.pictures import CLASS_COLOURS
from harness.segmentation.pictures import Instance, draw_instances
from harness.surface_picture import Backdrop, Dots, two_sides
from harness.table.cells import millimetres

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy.typing as npt

    from harness.recordings.recording import RecordedView, Recording

    Floats = npt.NDArray[np.float64]

SIZE = (400, 300)
QUALITY = 62
MOST_VIEWS = 6
CROP_MARGIN_M = 0.03
"""How far around the target the map is drawn."""
VIEW_DISTANCE_M = 0.75
CONFIDENCE_STEPS = 12
ON_MESH = (86, 220, 190)
OFF_MESH = (240, 100, 20)
"""Of completed points by truth, bright on the dark ground."""


@dataclass(frozen=True)
class ScenePicture:
    """A picture of a scene.

    Attributes
    ----------
    caption
        What it shows, in one line.
    data
        ``data:`` URI of a WebP image.
    """

    caption: str
    data: str


def scene_pictures(
    recording: Recording, *, model: str, tolerance_m: float
) -> Iterator[ScenePicture]:
    """Draw a scene: its views, its map, and its completed points by confidence and by truth.

    Parameters
    ----------
    recording
        The scene.
    model
        Whose confidence is shown.
    tolerance_m
        A point lies on the mesh within this distance, metres.
    """
    views = recording.views
    # Of many views those that lie evenly between the first and the last.
    shown = np.unique(np.linspace(0, len(views) - 1, min(MOST_VIEWS, len(views))).astype(int))
    for index in shown.tolist():
        yield _picture(_view_caption(views[index], index), _draw_view(views[index], recording))
    if (drawn := _draw_map(recording)) is not None:
        yield _picture("map around the target, voxels by class", drawn)
    yield from _completed(recording, model=model, tolerance_m=tolerance_m)


def _picture(caption: str, picture: Picture) -> ScenePicture:
    image = Image.fromarray(picture)
    image.thumbnail(SIZE, Image.Resampling.LANCZOS)
    file = io.BytesIO()
    image.save(file, format="WEBP", quality=QUALITY, method=4)
    text = base64.b64encode(file.getvalue()).decode("ascii")
    return ScenePicture(caption=caption, data=f"data:image/webp;base64,{text}")


def _view_caption(view: RecordedView, index: int) -> str:
    found = ", ".join(f"{item.category} {item.score:.2f}" for item in view.detections)
    return f"view {index + 1}: {f'found {found}' if found else 'nothing found'}"


def _draw_view(view: RecordedView, recording: Recording) -> Picture:
    found = [
        Instance(mask=view.found == number, category=item.category, score=item.score)
        for number, item in enumerate(view.detections, start=1)
    ]
    target = view.true_ids == recording.target.instance_id
    return draw_instances(view.rgb, found, true_masks=[target] if target.any() else [])


def _draw_map(recording: Recording) -> Picture | None:
    """Draw the voxels about the true target from where the first camera stood; None without any."""
    voxels, about = recording.voxels, recording.target.vertices_world.astype(np.float64)
    centres = voxels.centres_world.astype(np.float64)
    low, high = about.min(axis=0) - CROP_MARGIN_M, about.max(axis=0) + CROP_MARGIN_M
    near = ((centres >= low) & (centres <= high)).all(axis=1)
    if not near.any():
        return None
    palette = np.array([CLASS_COLOURS[name] for name in CLASS_NAMES], dtype=np.uint8)
    focus = (low + high) / 2
    towards = _eye(recording) - focus
    eye = focus + VIEW_DISTANCE_M * towards / np.linalg.norm(towards)
    view = View(eye_world=eye, focus_world=focus, size=SIZE).fitted_to(centres[near])
    return draw_cubes(centres[near], palette[voxels.classes[near]], size_m=voxels.size_m, view=view)


def _completed(recording: Recording, *, model: str, tolerance_m: float) -> Iterator[ScenePicture]:
    """Draw completed points over the true mesh: by confidence from two sides, then by truth."""
    parts = [item for item in recording.test_sets if item.completion != "none"]
    if not parts or model not in recording.answers:
        return
    part = parts[0].part
    points = recording.test_world[part].astype(np.float64)
    if not len(points):
        return
    target = recording.target
    vertices = np.ascontiguousarray(target.vertices_world, dtype=np.float64)
    truth = MeshTruth(vertices, np.ascontiguousarray(target.faces, dtype=np.uint32))
    shown = np.concatenate([vertices, points])
    sides = [
        Backdrop(truth, view) for view in two_sides(shown, camera_world=_eye(recording), size=SIZE)
    ]
    confidence = recording.answers[model].confidence[part]
    step = np.minimum((confidence * CONFIDENCE_STEPS).astype(int), CONFIDENCE_STEPS - 1)
    colours = confidence_colours(np.linspace(0.0, 1.0, CONFIDENCE_STEPS)).tolist()
    by_confidence = [
        Dots(points[step == number], colour=(red, green, blue))
        for number, (red, green, blue) in enumerate(colours)
    ]
    on_mesh = recording.on_target(tolerance_m)[part]
    by_truth = [Dots(points[on_mesh], ON_MESH), Dots(points[~on_mesh], OFF_MESH)]
    name = plain(model)
    for side, where in zip(sides, ("the first camera's side", "behind"), strict=True):
        caption = f"completed points by the {name} model's confidence, from {where}"
        yield _picture(caption, side.draw(by_confidence))
    share = f"{on_mesh.mean():.0%} within {millimetres(tolerance_m)} of the mesh"
    yield _picture(f"completed points: {share}, the others orange", sides[0].draw(by_truth))


def _eye(recording: Recording) -> Floats:
    """Where the first camera stood, (3,); the mean of cameras all around would be overhead."""
    return recording.views[0].world_from_camera[:3, 3]
