"""Pictures of a scene: what each view saw, the map it became, and the completed shapes."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial import cKDTree

from harness.asked import no_completion
from harness.bench import load_objects
from harness.completion.clouds import observed_of, spread_evenly
from harness.completion.pictures import OBSERVED_POINTS, draw_panels
from harness.config import Override, load_config
from harness.cubes import Picture, View, draw_cubes
from harness.errors import InputError
from harness.native import CLASS_NAMES, MeshTruth
from harness.pictures import CLASS_COLOURS, fit_width, label, write_picture
from harness.runs.job import plan_jobs
from harness.scene_run import map_scene, simulate_job
from harness.segmentation.pictures import Instance, draw_instances
from harness.segmentation.segmenter import make_segmenter, segment_frame, truth_for
from harness.truth import ORACLE
from sim_scenes import SceneError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from harness.asked import Completion
    from harness.config import Config
    from harness.native import MappedObject, Pipeline, Voxels
    from sim_scenes import Frame, Scene

# Of a category's colour, what its instances' outlines keep: neighbours of one category stay apart.
OUTLINE_BRIGHTNESS = 0.3
MARKER_PX = 12
# How far around what was seen of the objects the table is drawn.
CROP_MARGIN_M = 0.05
COMPLETED_PX = (720, 540)
VIEW_DISTANCE_M = 0.75


@dataclass(frozen=True)
class ScenePictures:
    """Where the pictures of a scene were written.

    Attributes
    ----------
    files
        All pictures.
    montage
        The one that holds the others.
    clouds
        The completed shapes, PLY in world metres, ``completed-ID.ply`` by the map's id.
    uncompleted
        Why a mapped object has no completed shape, by id; empty without a completer.
    """

    folder: Path
    files: tuple[Path, ...]
    montage: Path
    clouds: tuple[Path, ...] = ()
    uncompleted: Mapping[int, str] = field(default_factory=dict)


@dataclass(frozen=True)
class RenderOptions:
    """Which scene to draw; None leaves a choice to the configuration.

    Attributes
    ----------
    scene
        Class and number of a scene in a run's plan, such as ``mug-0003``.
    cluttered
        Put other objects around the target.
    seed, objects, config
        As for a benchmark.
    out
        Folder for the pictures, by default ``results/render/SCENE``.
    """

    scene: str
    cluttered: bool = False
    seed: int | None = None
    objects: Path | None = None
    out: Path | None = None
    config: Path | None = None


def run_render(options: RenderOptions) -> ScenePictures:
    """Simulate a scene, map it, and write its pictures.

    Raises
    ------
    InputError
        A scene id that no plan holds, a configuration or a folder that cannot be used, a scene
        that cannot be drawn.
    """
    category, _, number = options.scene.rpartition("-")
    if category not in CLASS_NAMES[1:] or not number.isdecimal():
        raise InputError(
            f"--scene {options.scene}: give a class and a number, such as mug-0003 "
            f"(classes: {', '.join(CLASS_NAMES[1:])})"
        )
    asked = {
        "run.classes": (category,),
        "run.scenes": int(number) + 1,
        "run.seed": options.seed,
        "scenes.objects": options.objects,
        "scenes.cluttered": options.cluttered or None,
    }
    config = load_config(
        options.config,
        overrides=tuple(
            Override(key=key, value=value, option="--" + key.rpartition(".")[2])
            for key, value in asked.items()
            if value is not None
        ),
    )
    folder = options.out or Path("results") / "render" / options.scene
    job = plan_jobs(config, load_objects(config.scenes.objects))[-1]
    try:
        scene = simulate_job(job, config)
    except SceneError as error:
        raise InputError(f"--scene {options.scene}: {error}") from error
    try:
        return render_pictures(
            scene,
            map_scene(scene, config=config),
            instances=segment_views(scene, config=config),
            folder=folder,
        )
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"cannot write to {folder}: {reason}; pass a writable --out") from error


def segment_views(scene: Scene, *, config: Config) -> list[list[Instance]]:
    """Find the instances in a scene's frames, as the map that it becomes does."""
    segmenter = make_segmenter(config.pipeline_json())
    categories = truth_for(config.pipeline["segmenter"], scene)
    return [
        [
            Instance(found.mask, found.category, found.score)
            for found in segment_frame(segmenter, frame, categories=categories)
        ]
        for frame in scene.frames
    ]


def render_pictures(
    scene: Scene,
    pipeline: Pipeline,
    *,
    instances: Sequence[Sequence[Instance]],
    folder: Path,
) -> ScenePictures:
    """Write every view, what was found in it and the truth, the map in 3-D, and a montage.

    The montage leaves the pictures of the true masks out: over what a network found it shows their
    outlines, and the oracle finds the true masks. Where the pipeline completes shapes, two panels
    show them over the true meshes, and each is written as a cloud.

    Parameters
    ----------
    scene
        The frames.
    pipeline
        The map that they were fed to.
    instances
        What its segmenter found in each frame.
    folder
        Made where it is missing; files of the same names are replaced.
    """
    folder.mkdir(parents=True, exist_ok=True)
    pictures: dict[str, Picture] = {}
    rows = []
    near_m, far_m = depth_range([frame.depth_m for frame in scene.frames])
    learned = pipeline.segmenter != ORACLE
    for index, (frame, seen) in enumerate(zip(scene.frames, instances, strict=True)):
        row = {
            f"view{index}_rgb": frame.rgb,
            f"view{index}_depth": colour_depth(frame.depth_m, near_m=near_m, far_m=far_m),
            f"view{index}_found": draw_instances(
                frame.rgb, seen, true_masks=true_masks(frame, scene) if learned else ()
            ),
        }
        pictures |= row | {f"view{index}_mask": overlay_mask(frame, scene)}
        truth = "; true outlines white" if learned else ""
        captions = (
            f"view{index}_rgb",
            f"view{index}_depth: bright {near_m:.2f} m, dark {far_m:.2f} m",
            f"view{index}_found: by {pipeline.segmenter}{truth}",
        )
        labelled = [label(*pair) for pair in zip(row.values(), captions, strict=True)]
        rows.append(np.concatenate(labelled, axis=1))
    voxels, mapped = pipeline.voxels(), pipeline.objects()
    eye_world = np.mean([frame.world_from_camera[:3, 3] for frame in scene.frames], axis=0)
    for name, by_class in (("map_classes", True), ("map_rgb", False)):
        pictures[name] = draw_map(voxels, mapped, eye_world=eye_world, by_class=by_class)
    width = rows[0].shape[1]
    maps = np.concatenate([label(pictures[n], n) for n in ("map_classes", "map_rgb")], axis=1)
    parts = [*rows, fit_width(maps, width)]
    found = {item.id: pipeline.completion(item.id) for item in mapped}
    completions = {number: item for number, item in found.items() if item is not None}
    if completions:
        sides = draw_completions(scene, completions, eye_world=eye_world)
        pictures |= sides
        said = ("seen red, completed white, true mesh grey", "completed, from behind")
        panels = [label(*pair) for pair in zip(sides.values(), said, strict=True)]
        parts.append(fit_width(np.concatenate(panels, axis=1), width))
    pictures["montage"] = np.concatenate(parts, axis=0)
    files = {name: folder / f"{name}.png" for name in pictures}
    for name, path in files.items():
        write_picture(path, pictures[name])
    clouds = {number: folder / f"completed-{number}.ply" for number in completions}
    for number, path in clouds.items():
        completions[number].write_ply(path)
    completes = pipeline.completer != "none"
    return ScenePictures(
        folder=folder,
        files=tuple(files.values()),
        montage=files["montage"],
        clouds=tuple(clouds.values()),
        uncompleted={
            item.id: no_completion(pipeline, item.id)
            for item in mapped
            if completes and item.id not in completions
        },
    )


def draw_completions(
    scene: Scene, completions: Mapping[int, Completion], *, eye_world: npt.NDArray[np.float64]
) -> dict[str, Picture]:
    """Draw observed and completed points over the true meshes, from the camera's side and behind.

    Parameters
    ----------
    scene
        Frames and truth.
    completions
        By the map's id.
    eye_world : (3,) float64
        Where the camera was.
    """
    meshes = [item.mesh_world() for item in scene.objects]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    vertices = np.concatenate([vertices for vertices, _ in meshes])
    faces = np.concatenate(
        [faces + start for (_, faces), start in zip(meshes, starts[:-1], strict=True)]
    )
    observed = [observed_of(scene, item) for item in scene.objects]
    panels = draw_panels(
        MeshTruth(np.ascontiguousarray(vertices), faces.astype(np.uint32)),
        surface_world=vertices,
        observed_world=np.concatenate(
            [spread_evenly(points, count=OBSERVED_POINTS) for points in observed if len(points)]
        ),
        clouds={"all": np.concatenate([item.points_world for item in completions.values()])},
        camera_world=eye_world,
        size=COMPLETED_PX,
    )
    front, back = panels["all"]
    return {"completed_front": front, "completed_back": back}


def depth_range(depths_m: Sequence[npt.NDArray[np.float32]]) -> tuple[float, float]:
    """Near and far end (metres) of the depths (h, w) of a scene, but for a hundredth at each."""
    measured = np.concatenate([depth_m[np.isfinite(depth_m)] for depth_m in depths_m])
    near, far = np.percentile(measured, [1, 99]) if len(measured) else (0.0, 1.0)
    return float(near), float(far)


def colour_depth(depth_m: npt.NDArray[np.float32], *, near_m: float, far_m: float) -> Picture:
    """Depth (h, w) in metres as colours, near bright; pixels without a measurement are black."""
    valid = np.isfinite(depth_m)
    share = np.clip((far_m - depth_m) / max(far_m - near_m, 1e-6), 0, 1)
    colours = mpl.colormaps["viridis"](np.where(valid, share, 0.0))[..., :3]
    return np.asarray(np.where(valid[..., None], colours * 255, 0), dtype=np.uint8)


def true_masks(frame: Frame, scene: Scene) -> list[npt.NDArray[np.bool_]]:
    """List the true mask (h, w) of each object that a frame shows."""
    if frame.instance_ids is None:
        return []
    masks = [frame.instance_ids == item.instance_id for item in scene.objects]
    return [mask for mask in masks if mask.any()]


def overlay_mask(frame: Frame, scene: Scene) -> Picture:
    """Paint the grey image with each true instance in its category's colour, outlined darker."""
    grey = frame.rgb.mean(axis=-1, keepdims=True).repeat(3, axis=-1)
    if frame.instance_ids is not None:
        edge = _differs_from_neighbour(frame.instance_ids)
        for item in scene.objects:
            inside = frame.instance_ids == item.instance_id
            colour = np.array(CLASS_COLOURS[item.category])
            grey[inside] = 0.4 * grey[inside] + 0.6 * colour
            grey[inside & edge] = OUTLINE_BRIGHTNESS * colour
    return np.asarray(grey, dtype=np.uint8)


def _differs_from_neighbour(ids: npt.NDArray[np.uint16]) -> npt.NDArray[np.bool_]:
    """Whether a pixel's id (h, w) differs from that of a pixel beside, above or below it."""
    edge = np.zeros(ids.shape, dtype=bool)
    across, along = ids[:, 1:] != ids[:, :-1], ids[1:] != ids[:-1]
    edge[:, 1:] |= across
    edge[:, :-1] |= across
    edge[1:] |= along
    edge[:-1] |= along
    return edge


def draw_map(
    voxels: Voxels,
    mapped: list[MappedObject],
    *,
    eye_world: npt.NDArray[np.float64],
    by_class: bool,
) -> Picture:
    """Draw the occupied voxels about the objects in 3-D, with each tracked object's id over it.

    The viewer stands on the line from the objects to `eye_world` (3,), where the camera was, and
    what is drawn fills the picture.
    """
    centres = voxels.centres_world
    near = np.ones(len(centres), dtype=bool)
    if mapped:
        plan = cKDTree(np.concatenate([item.points_world[:, :2] for item in mapped]))
        distances, _ = plan.query(centres[:, :2], distance_upper_bound=CROP_MARGIN_M)
        near = np.isfinite(distances)
    palette = np.array([CLASS_COLOURS[name] for name in CLASS_NAMES], dtype=np.uint8)
    colours = palette[voxels.classes] if by_class else voxels.rgb
    focus = (centres[near].min(axis=0) + centres[near].max(axis=0)) / 2
    towards_eye = (eye_world - focus) / np.linalg.norm(eye_world - focus)
    view = View(eye_world=focus + VIEW_DISTANCE_M * towards_eye, focus_world=focus)
    view = view.fitted_to(centres[near])
    picture = draw_cubes(centres[near], colours[near], size_m=voxels.size_m, view=view)
    image = Image.fromarray(picture)
    pen = ImageDraw.Draw(image)
    for item in mapped:
        u, v = view.project(
            item.points_world.max(axis=0) * (0, 0, 1) + item.centroid_world * (1, 1, 0)
        )
        v -= MARKER_PX
        pen.ellipse(
            (u - MARKER_PX, v - MARKER_PX, u + MARKER_PX, v + MARKER_PX),
            fill=CLASS_COLOURS[item.category],
            outline="black",
        )
        pen.text(
            (u, v - 1.5 * MARKER_PX),
            f"{item.category} #{item.id}",
            fill="black",
            anchor="mb",
            font=ImageFont.load_default(24),
            stroke_width=3,
            stroke_fill="white",
        )
    return np.asarray(image)
