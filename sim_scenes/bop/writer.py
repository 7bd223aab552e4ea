"""Scenes to a BOP dataset."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from sim_scenes.bop.fields import MM_PER_M
from sim_scenes.bop.images import write_image
from sim_scenes.bop.models import model_info, write_ply
from sim_scenes.errors import BopError
from sim_scenes.geometry import Floats, apply, inverse
from sim_scenes.sensor import metres_from_raw, raw_from_metres
from sim_scenes.silhouette import silhouette

if TYPE_CHECKING:
    from collections.abc import Iterable

    from sim_scenes.camera import Intrinsics
    from sim_scenes.scene import Frame, Scene, SceneObject

DEPTH_SCALE_MM = 0.1
DEPTH_UNIT_M = DEPTH_SCALE_MM / MM_PER_M

INFO = """# Simulated tabletop scenes

BOP scenewise layout, written by Credence's sim_scenes. The camera is a RealSense D435 on a Panda's
wrist; the world's origin is the Panda's base, z up; a pixel's centre has whole coordinates.

Extra keys: `world_from_camera`, `joint_positions_rad` (scene_camera), `world_from_object`,
`instance_id` (scene_gt), `name`, `category` (models_info), and the file `scene_source.json` with
each scene's spec and seed. Matrices are row-major, in metres.
"""


def write_bop(scenes: Iterable[Scene], folder: Path | str, *, split: str = "test") -> list[str]:
    """Write scenes as a BOP dataset, scene ids counting from 0.

    Parameters
    ----------
    scenes
        Consumed one by one.
    folder
        Root of the new dataset; it must not exist, or be empty. It appears only when complete.
    split
        Name of the split.

    Returns
    -------
    notes
        What reading back will not give bit for bit: depth off the grid of 0.1 mm is rounded.

    Raises
    ------
    BopError
        If the folder is taken or cannot be written.
    """
    folder = Path(folder)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise BopError(f"{folder}: exists and is not an empty folder; name a new one")
    partial = folder.with_name(f".{folder.name}.partial-{os.getpid()}")
    try:
        partial.mkdir(parents=True)
        try:
            writer = _Writer(partial)
            for scene_id, scene in enumerate(scenes):
                writer.add(scene, partial / split / f"{scene_id:06d}")
            writer.finish()
            if folder.exists():
                folder.rmdir()
            partial.rename(folder)
        finally:
            shutil.rmtree(partial, ignore_errors=True)
    except OSError as error:
        raise BopError(
            f"{folder}: cannot be written ({error.strerror or error}); "
            "choose a folder on a disk with space where you may write"
        ) from error
    return writer.notes


@dataclass(eq=False)
class _Writer:
    root: Path
    notes: list[str] = field(default_factory=list)
    # Object id by the model's content, and the ids' infos.
    ids: dict[str, int] = field(default_factory=dict)
    infos: dict[int, dict[str, Any]] = field(default_factory=dict)
    camera: dict[str, Any] | None = None

    def add(self, scene: Scene, folder: Path) -> None:
        """Write one scene."""
        known_masks = all(frame.instance_ids is not None for frame in scene.frames)
        subfolders = ["rgb", "depth"]
        if scene.objects and known_masks:
            subfolders += ["mask", "mask_visib"]
        for name in subfolders:
            (folder / name).mkdir(parents=True)
        cameras, truths, infos = {}, {}, {}
        rounded = lost = 0
        for image_id, frame in enumerate(scene.frames):
            write_image(folder / "rgb" / f"{image_id:06d}.png", frame.rgb)
            raw = raw_from_metres(frame.depth_m, unit_m=DEPTH_UNIT_M)
            write_image(folder / "depth" / f"{image_id:06d}.png", raw)
            restored = metres_from_raw(raw, unit_m=DEPTH_UNIT_M)
            lost += int((np.isnan(restored) & ~np.isnan(frame.depth_m)).sum())
            rounded += int((restored != frame.depth_m)[~np.isnan(restored)].sum())
            cameras[image_id] = _camera_entry(frame)
            self.camera = self.camera or _camera_file(frame.intrinsics)
            if scene.objects:
                truths[image_id] = [self._truth_entry(item, frame) for item in scene.objects]
            if scene.objects and known_masks:
                infos[image_id] = [
                    _write_masks(folder, image_id, gt_id, frame=frame, item=item)
                    for gt_id, item in enumerate(scene.objects)
                ]
        _write_json(folder / "scene_camera.json", cameras)
        if truths:
            _write_json(folder / "scene_gt.json", truths)
        if infos:
            _write_json(folder / "scene_gt_info.json", infos)
        source = {
            "name": scene.name,
            "seed": scene.seed,
            "spec": scene.spec.to_dict() if scene.spec else None,
            "redraws": list(scene.redraws),
        }
        _write_json(folder / "scene_source.json", source)
        if rounded:
            self.notes.append(
                f"scene {scene.name}: depth rounded to {DEPTH_SCALE_MM} mm in {rounded} pixels"
            )
        if lost:
            self.notes.append(
                f"scene {scene.name}: {lost} pixels beyond the 16-bit range left without depth"
            )

    def finish(self) -> None:
        """Write what belongs to the whole dataset."""
        (self.root / "models").mkdir(exist_ok=True)
        _write_json(self.root / "models" / "models_info.json", self.infos)
        if self.camera is not None:
            _write_json(self.root / "camera.json", self.camera)
        (self.root / "dataset_info.md").write_text(INFO, encoding="utf-8")

    def _truth_entry(self, item: SceneObject, frame: Frame) -> dict[str, Any]:
        camera_from_object = inverse(frame.world_from_camera) @ item.world_from_object
        return {
            "obj_id": self._object_id(item),
            "cam_R_m2c": camera_from_object[:3, :3].reshape(-1).tolist(),
            "cam_t_m2c": (camera_from_object[:3, 3] * MM_PER_M).tolist(),
            "instance_id": item.instance_id,
            "world_from_object": item.world_from_object.reshape(-1).tolist(),
        }

    def _object_id(self, item: SceneObject) -> int:
        """Id of the object's model, which is written when it is first met."""
        state = hashlib.blake2b(f"{item.name}/{item.category}".encode())
        state.update(item.vertices.tobytes())
        state.update(item.faces.tobytes())
        key = state.hexdigest()
        if key not in self.ids:
            object_id = self.ids[key] = len(self.ids) + 1
            (self.root / "models").mkdir(exist_ok=True)
            write_ply(self.root / "models" / f"obj_{object_id:06d}.ply", item.vertices, item.faces)
            self.infos[object_id] = model_info(
                item.vertices, item.faces, name=item.name, category=item.category
            )
            if not np.array_equal(item.vertices, item.vertices.astype(np.float32)):
                self.notes.append(f"model {item.name}: vertices are read back as float32")
        return self.ids[key]


def _camera_entry(frame: Frame) -> dict[str, Any]:
    camera = frame.intrinsics
    camera_from_world = inverse(frame.world_from_camera)
    entry: dict[str, Any] = {
        "cam_K": [camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0],
        "depth_scale": DEPTH_SCALE_MM,
        "cam_R_w2c": camera_from_world[:3, :3].reshape(-1).tolist(),
        "cam_t_w2c": (camera_from_world[:3, 3] * MM_PER_M).tolist(),
        "world_from_camera": frame.world_from_camera.reshape(-1).tolist(),
    }
    if frame.joint_positions_rad is not None:
        entry["joint_positions_rad"] = frame.joint_positions_rad.tolist()
    return entry


def _camera_file(camera: Intrinsics) -> dict[str, Any]:
    names = ("width", "height", "fx", "fy", "cx", "cy")
    return {**{name: getattr(camera, name) for name in names}, "depth_scale": DEPTH_SCALE_MM}


def _write_masks(
    folder: Path, image_id: int, gt_id: int, *, frame: Frame, item: SceneObject
) -> dict[str, Any]:
    """Write both masks of an object, and return its entry of `scene_gt_info.json`."""
    assert frame.instance_ids is not None
    visible = frame.instance_ids == item.instance_id
    camera_from_object: Floats = inverse(frame.world_from_camera) @ item.world_from_object
    whole = silhouette(
        apply(camera_from_object, item.vertices), item.faces, intrinsics=frame.intrinsics
    )
    # The renderer's float32 outline may differ from ours by a pixel here and there.
    whole |= visible
    name = f"{image_id:06d}_{gt_id:06d}.png"
    write_image(folder / "mask" / name, whole.astype(np.uint8) * np.uint8(255))
    write_image(folder / "mask_visib" / name, visible.astype(np.uint8) * np.uint8(255))
    all_count, visible_count = int(whole.sum()), int(visible.sum())
    return {
        "bbox_obj": _box(whole),
        "bbox_visib": _box(visible),
        "px_count_all": all_count,
        "px_count_valid": int((whole & ~np.isnan(frame.depth_m)).sum()),
        "px_count_visib": visible_count,
        "visib_fract": visible_count / all_count if all_count else 0.0,
    }


def _box(mask: npt.NDArray[np.bool_]) -> list[int]:
    """Left, top, width, height of a mask; BOP marks an empty one by -1."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return [-1, -1, -1, -1]
    left, top = int(columns[0]), int(rows[0])
    return [left, top, int(columns[-1]) - left + 1, int(rows[-1]) - top + 1]


def _write_json(path: Path, table: dict[Any, Any]) -> None:
    # One entry a line, as BOP's own files have it.
    rows = [f"  {json.dumps(str(key))}: {json.dumps(value)}" for key, value in table.items()]
    path.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")
