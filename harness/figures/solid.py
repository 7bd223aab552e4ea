"""Scenes in 3-D: small spheres over a faint true mesh, maps of voxels, in a camera's own view."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw
from scipy.spatial import cKDTree

from harness.cubes import OVERSAMPLING, Picture, View, draw_cubes
from harness.figures.source import BOX
from harness.native import CLASS_NAMES, MeshTruth
from harness.pictures import CLASS_COLOURS
from harness.surface_picture import cast_surface, shade_surface

if TYPE_CHECKING:
    from harness.recordings.recording import RecordedView, RecordedVoxels, Recording, TrueObject

Floats = npt.NDArray[np.float64]
Bytes = npt.NDArray[np.uint8]

PAPER = (255, 255, 255)
FAINT_GREYS = (170, 232)
"""Of a true mesh that faces sideways, and that faces the viewer."""
TABLE_COLOUR = (205, 205, 205)
RIM = 0.55
"""Of a sphere's colour, what its outline keeps: neighbours of one colour stay apart."""
ELEVATION_RAD = np.deg2rad(32.0)
BEHIND_RAD = np.deg2rad((180.0, 160.0, 200.0, 140.0, 220.0, 120.0, 240.0))
"""Turns from the cameras towards the side that they did not see."""
TABLE_RADIUS = 1.25
"""Of the round piece of the table, by the target's."""
SPHERE_RADIUS = 0.018
"""Of a point, by the target's greatest extent."""
ZOOM = 1.1
"""Beyond the fit of `View.fitted_to`, which leaves room for labels."""
VIEW_DISTANCE_M = 0.6
TINT = 0.55
"""How far the colour of completed voxels goes towards white."""


@dataclass(frozen=True)
class Window:
    """A part of a camera's image, pixels: `left` and `top` inside, `right` and `bottom` outside."""

    left: int
    top: int
    right: int
    bottom: int

    def of(self, image: Picture) -> Picture:
        """Cut it out of an image."""
        return image[self.top : self.bottom, self.left : self.right]


def best_view(recording: Recording) -> RecordedView:
    """Choose the view that shows most of the target, the first of several."""
    return max(
        recording.views,
        key=lambda view: int(np.count_nonzero(view.true_ids == recording.target.instance_id)),
    )


def camera_view(view: RecordedView, *, window: Window | None = None, width_px: int) -> View:
    """Look as a recorded camera did, at a part of its image, in a picture of another size."""
    height, width = view.depth_m.shape
    part = window or Window(0, 0, width, height)
    fx, fy, cx, cy = view.intrinsics
    _, down_world, forward, eye = view.world_from_camera[:3].T
    x, y, z = (-down_world).tolist()
    across, down = part.right - part.left, part.bottom - part.top
    # The centre of a recorded pixel is whole, that of a drawn one has a half.
    middle = ((part.left + part.right) / 2 - 0.5, (part.top + part.bottom) / 2 - 0.5)
    return View(
        eye_world=eye,
        focus_world=eye + forward,
        size=(width_px, round(width_px * down / across)),
        focal=float(fy / down),
        shift=(float((middle[0] - cx) / fx), float((middle[1] - cy) / fy)),
        up_world=(x, y, z),
    )


def window_around(
    view: RecordedView, points_world: Floats, *, aspect: float, margin: float = 0.25
) -> Window:
    """Frame points (n, 3) in a camera's image.

    Parameters
    ----------
    view
        Whose image.
    points_world
        What to show, metres, before the camera.
    aspect
        Width by height.
    margin
        Share of the points' extent that is added on each side, where the image has room.
    """
    rows, columns = view.depth_m.shape
    pixels = camera_view(view, width_px=columns).project(points_world)
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    extent = (high - low) * (1 + 2 * margin)
    height = min(max(extent[1], extent[0] / aspect), rows, columns / aspect)
    half = np.array([height * aspect, height]) / 2
    middle = np.clip((low + high) / 2, half, np.array([columns, rows]) - half)
    left, top = np.round(middle - half).astype(int).tolist()
    return Window(left, top, left + round(height * aspect), top + round(height))


def view_from_behind(
    recording: Recording, *, size: tuple[int, int], with_map: bool = False
) -> View:
    """Stand off the target on the side that no camera saw, where it looks widest.

    So a mug shows its handle. The true mesh and the completed points fill the view, with the whole
    map where that is asked.
    """
    shown = shown_points(recording)
    focus = (shown.min(axis=0) + shown.max(axis=0)) / 2
    towards = [direction_to_cameras(recording, focus, turn_rad=float(turn)) for turn in BEHIND_RAD]
    flat = recording.target.vertices_world[:, :2].astype(np.float64)
    widths = [float(np.ptp(flat @ np.array([-y, x]))) for x, y, _ in towards]
    # The first of those that rounding alone sets apart.
    widest = int(np.argmax(np.array(widths) > max(widths) - 1e-6))
    view = View(focus + VIEW_DISTANCE_M * towards[widest], focus, size=size)
    if with_map:
        around = recording.voxels.centres_world.astype(np.float64)
        shown = np.concatenate([shown, around])
    view = view.fitted_to(shown)
    return replace(view, focal=view.focal * ZOOM)


def direction_to_cameras(
    recording: Recording, focus_world: Floats, *, turn_rad: float = 0.0
) -> Floats:
    """Point from a place (3,) to the cameras, raised by `ELEVATION_RAD`: a unit vector (3,).

    The side is that where they were on average, turned about the vertical.
    """
    eyes = np.mean([view.world_from_camera[:3, 3] for view in recording.views], axis=0)
    x, y, _ = eyes - focus_world
    azimuth = np.arctan2(y, x) + turn_rad
    across = np.cos(ELEVATION_RAD)
    return np.array([across * np.cos(azimuth), across * np.sin(azimuth), np.sin(ELEVATION_RAD)])


def near_target(recording: Recording) -> Recording:
    """Leave of a map and its completed shapes what lies about its target, in a circle."""
    shown, voxels = shown_points(recording)[:, :2], recording.voxels
    middle = (shown.min(axis=0) + shown.max(axis=0)) / 2
    radius = TABLE_RADIUS * float(np.linalg.norm(shown - middle, axis=1).max())

    def near(points_world: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
        return np.asarray(np.linalg.norm(points_world[:, :2] - middle, axis=1) <= radius)

    tracked = []
    for cloud in recording.tracked:
        kept = near(cloud.completed_world)
        completed, spread_m = cloud.completed_world[kept], cloud.spread_m[kept]
        tracked.append(replace(cloud, completed_world=completed, spread_m=spread_m))
    voxels = keep_voxels(voxels, near(voxels.centres_world))
    return replace(recording, voxels=voxels, tracked=tuple(tracked))


def keep_voxels(voxels: RecordedVoxels, kept: npt.NDArray[np.bool_]) -> RecordedVoxels:
    """Leave those of a map's voxels (n,) that are marked."""
    return replace(
        voxels,
        centres_world=voxels.centres_world[kept],
        rgb=voxels.rgb[kept],
        classes=voxels.classes[kept],
        object_ids=voxels.object_ids[kept],
        confidence=voxels.confidence[kept],
        first_view=voxels.first_view[kept],
    )


def completed_points(recording: Recording) -> slice | None:
    """Which of a recording's test points are its completion's; None without one."""
    for item in recording.test_sets:
        if item.completion != BOX and item.part.stop > item.part.start:
            return item.part
    return None


def shown_points(recording: Recording) -> Floats:
    """Vertices of the target and its completed points (n, 3)."""
    cloud = recording.target_cloud
    parts = [recording.target.vertices_world.astype(np.float64)]
    if cloud is not None:
        parts.append(cloud.completed_world.astype(np.float64))
    return np.concatenate(parts)


def sphere_radius(recording: Recording) -> float:
    """Radius of a point's sphere, metres: alike in print for small and large targets."""
    return SPHERE_RADIUS * float(np.ptp(shown_points(recording), axis=0).max())


def draw_mesh(items: tuple[TrueObject, ...], *, view: View) -> Picture:
    """Draw true meshes faintly on paper, (height, width, 3)."""
    starts = np.cumsum([0, *(len(item.vertices_world) for item in items)])
    vertices = np.concatenate([item.vertices_world for item in items]).astype(np.float64)
    faces = np.concatenate(
        [item.faces + start for item, start in zip(items, starts[:-1], strict=True)]
    )
    truth = MeshTruth(np.ascontiguousarray(vertices), faces.astype(np.uint32))
    large = enlarged(view)
    depth = cast_surface(truth, large)
    shaded = shade_surface(depth, large, greys=FAINT_GREYS, ground=PAPER)
    return np.asarray(Image.fromarray(shaded).resize(view.size, Image.Resampling.BOX))


def draw_spheres(
    points_world: Floats, colours: Bytes, *, radius_m: float, view: View, over: Picture
) -> Picture:
    """Draw spheres, the far ones first, over a picture of the same view.

    Parameters
    ----------
    points_world : (n, 3) float64
        Centres, before the viewer, metres.
    colours : (n, 3) uint8
    radius_m
        Of each.
    view
        Where from.
    over : (height, width, 3) uint8

    Returns
    -------
    picture : (height, width, 3) uint8
    """
    large = enlarged(view)
    image = Image.fromarray(over).resize(large.size, Image.Resampling.NEAREST)
    pen = ImageDraw.Draw(image)
    depths, pixels = view.depths(points_world), large.project(points_world)
    radii = radius_m * large.focal * large.size[1] / depths
    rims = (colours * RIM).astype(np.uint8)
    for index in np.argsort(-depths, kind="stable"):
        (u, v), radius = pixels[index].tolist(), float(radii[index])
        pen.ellipse(
            (u - radius, v - radius, u + radius, v + radius),
            fill=tuple(colours[index].tolist()),
            outline=tuple(rims[index].tolist()),
            width=max(1, round(radius / 4)),
        )
    return np.asarray(image.resize(view.size, Image.Resampling.BOX))


def enlarged(view: View) -> View:
    """Look the same way at a picture that is drawn larger and scaled down."""
    width, height = view.size
    return replace(view, size=(width * OVERSAMPLING, height * OVERSAMPLING))


def draw_voxels(voxels: RecordedVoxels, *, view: View) -> Picture:
    """Draw a map in the colours of its classes, the table pale; (height, width, 3)."""
    palette = np.array([CLASS_COLOURS[name] for name in CLASS_NAMES], dtype=np.uint8)
    palette[0] = TABLE_COLOUR
    return _cubes_in_view(
        voxels.centres_world.astype(np.float64),
        palette[voxels.classes],
        size_m=voxels.size_m,
        view=view,
    )


def draw_completed_map(recording: Recording, *, view: View) -> Picture:
    """Draw a map with the completed shapes of its objects as pale voxels of their colour."""
    voxels = recording.voxels
    palette = np.array([CLASS_COLOURS[name] for name in CLASS_NAMES], dtype=np.uint8)
    palette[0] = TABLE_COLOUR
    centres, colours = [voxels.centres_world.astype(np.float64)], [palette[voxels.classes]]
    for cloud in recording.tracked:
        added = completed_voxels(cloud.completed_world, voxels)
        centres.append(added)
        colours.append(np.tile(tint(CLASS_COLOURS[cloud.category]), (len(added), 1)))
    return _cubes_in_view(
        np.concatenate(centres), np.concatenate(colours), size_m=voxels.size_m, view=view
    )


def completed_voxels(points_world: npt.NDArray[np.float32], voxels: RecordedVoxels) -> Floats:
    """Centres (n, 3) of the voxels that completed points (m, 3) fill and the map leaves free."""
    keys = np.unique(np.floor(points_world.astype(np.float64) / voxels.size_m), axis=0)
    centres = (keys + 0.5) * voxels.size_m
    mapped = voxels.centres_world[voxels.classes > 0].astype(np.float64)
    if len(centres) == 0 or len(mapped) == 0:
        return np.asarray(centres)
    distance, _ = cKDTree(mapped).query(centres)
    return np.asarray(centres[distance > voxels.size_m / 2])


def tint(colour: tuple[int, int, int]) -> Bytes:
    """Mix a colour with white, (3,)."""
    mixed = (1 - TINT) * np.array(colour) + TINT * 255
    return mixed.round().astype(np.uint8)


def _cubes_in_view(centres: Floats, colours: Bytes, *, size_m: float, view: View) -> Picture:
    """Draw the cubes that a view shows, and no others."""
    inside = view.depths(centres) > 2 * size_m
    centres, colours = centres[inside], colours[inside]
    pixels, border = view.project(centres), size_m * view.focal * view.size[1]
    border_px = border / view.depths(centres)
    limits = np.array(view.size)
    seen = ((pixels > -border_px[:, None]) & (pixels < limits + border_px[:, None])).all(axis=1)
    return draw_cubes(centres[seen], colours[seen], size_m=size_m, view=view)
