"""Scenes from a BOP dataset, our own or foreign."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sim_scenes.bop.fields import (
    MM_PER_M,
    number,
    numbers,
    pose_exact,
    pose_mm,
    read_numbered,
    read_table,
    table_of,
)
from sim_scenes.bop.images import check_size, find_colour, read_colour, read_depth
from sim_scenes.bop.models import ModelFolder
from sim_scenes.bop.truth import SceneTruth
from sim_scenes.camera import Intrinsics
from sim_scenes.errors import BopError, SpecError
from sim_scenes.geometry import Floats, inverse
from sim_scenes.objects import CATEGORIES
from sim_scenes.scene import Frame, Scene
from sim_scenes.sensor import metres_from_raw
from sim_scenes.spec import SceneSpec

if TYPE_CHECKING:
    from collections.abc import Iterator

CAMERA_FILE, TRUTH_FILE, SOURCE_FILE = "scene_camera.json", "scene_gt.json", "scene_source.json"
# A unit beyond this would put the farthest depth of 16 bits over 655 m away.
MAX_DEPTH_SCALE_MM = 10.0


@dataclass(frozen=True, eq=False)
class BopDataset:
    """One split of a dataset.

    Attributes
    ----------
    folder
        Of the split; it holds one folder a scene.
    scene_ids
        In order.
    """

    folder: Path
    scene_ids: tuple[int, ...]
    _models: ModelFolder = field(repr=False)

    def read_scene(self, scene_id: int) -> tuple[Scene, ...]:
        """Read a scene.

        Without camera poses in the world, the views of a scene cannot be joined: each image is
        then a scene of its own, in the camera's frame.

        Raises
        ------
        BopError
            If a file is missing, malformed, or holds values that no camera gives; names the file.
        """
        folder = self.folder / f"{scene_id:06d}"
        if not folder.is_dir():
            raise BopError(
                f"{folder}: is missing; the split has {len(self.scene_ids)} scenes, "
                f"{self.scene_ids[0]} to {self.scene_ids[-1]}"
            )
        cameras = {
            image_id: table_of(entry, where=f"{folder / CAMERA_FILE}: image {image_id}")
            for image_id, entry in read_numbered(folder / CAMERA_FILE).items()
        }
        if not cameras:
            raise BopError(f"{folder / CAMERA_FILE}: lists no image")
        poses = {
            image_id: _world_pose(entry, where=f"{folder / CAMERA_FILE}: image {image_id}")
            for image_id, entry in cameras.items()
        }
        lost = [image_id for image_id, pose in poses.items() if pose is None]
        if lost and len(lost) < len(poses):
            raise BopError(
                f"{folder / CAMERA_FILE}: image {lost[0]} has no cam_R_w2c and cam_t_w2c while "
                "others have; views are joined by their poses in the world, so all or none"
            )
        truth_file = folder / TRUTH_FILE
        truths = read_numbered(truth_file) if truth_file.is_file() else None
        builder = _SceneReader(folder, cameras, truths, self._models)
        name = f"{scene_id:06d}"
        if not lost:
            world_poses = {image_id: pose for image_id, pose in poses.items() if pose is not None}
            return (builder.scene(world_poses, name=name),)
        note = "no camera pose in the world: each image is a scene of its own, in its camera's axes"
        return tuple(
            builder.scene({image_id: np.eye(4)}, name=f"{name}-{image_id:06d}", notes=(note,))
            for image_id in cameras
        )

    def __iter__(self) -> Iterator[Scene]:
        for scene_id in self.scene_ids:
            yield from self.read_scene(scene_id)


def open_bop(
    folder: Path | str, *, split: str | None = None, category: str | None = None
) -> BopDataset:
    """Find the scenes of a dataset.

    Parameters
    ----------
    folder
        Root of the dataset, or of one split.
    split
        Which split; may be left out where there is only one.
    category
        Category of the objects that the dataset gives none, one of the six of NOCS.
    """
    if category is not None and category not in CATEGORIES:
        raise BopError(f"category is '{category}'; choose one of {', '.join(CATEGORIES)}")
    root = Path(folder)
    if not root.is_dir():
        raise BopError(f"{root}: is not a folder; name the root of a BOP dataset")
    own_scenes = _scene_ids(root)
    if split is None and own_scenes:
        return BopDataset(root, own_scenes, ModelFolder(root.parent, category=category))
    splits = {path.name: _scene_ids(path) for path in sorted(root.iterdir()) if path.is_dir()}
    splits = {name: scene_ids for name, scene_ids in splits.items() if scene_ids}
    if split is not None and split in splits:
        return BopDataset(root / split, splits[split], ModelFolder(root, category=category))
    if split is None and len(splits) == 1:
        (name,) = splits
        return BopDataset(root / name, splits[name], ModelFolder(root, category=category))
    if splits:
        raise BopError(f"{root}: split is {split!r}; choose one of {', '.join(sorted(splits))}")
    raise BopError(f"{root}: holds no scene, that is no SPLIT/000000/{CAMERA_FILE}")


def read_bop(folder: Path | str, *, split: str | None = None) -> Iterator[Scene]:
    """Read the scenes of a dataset one by one; see `open_bop` and `BopDataset.read_scene`."""
    return iter(open_bop(folder, split=split))


def _scene_ids(folder: Path) -> tuple[int, ...]:
    """Numbers of the folder's scenes; none where no scene has cameras, for it is then no split."""
    scenes = [
        path
        for path in folder.iterdir()
        if path.name.isascii() and path.name.isdigit() and len(path.name) <= 9 and path.is_dir()
    ]
    # One scene without its cameras is listed: reading it says what is missing.
    if not any((path / CAMERA_FILE).is_file() for path in scenes):
        return ()
    return tuple(sorted({int(path.name) for path in scenes}))


def _world_pose(entry: dict[str, Any], *, where: str) -> Floats | None:
    if "world_from_camera" in entry:
        return pose_exact(entry, "world_from_camera", where=where)
    if "cam_R_w2c" in entry or "cam_t_w2c" in entry:
        return inverse(pose_mm(entry, rotation="cam_R_w2c", translation="cam_t_w2c", where=where))
    return None


@dataclass(frozen=True, eq=False)
class _SceneReader:
    """A scene's tables, from which scenes of some or all of its images are made."""

    folder: Path
    cameras: dict[int, dict[str, Any]]
    truths: dict[int, Any] | None
    models: ModelFolder

    def scene(self, poses: dict[int, Floats], *, name: str, notes: tuple[str, ...] = ()) -> Scene:
        """Read the images whose `world_from_camera` are given."""
        truth = SceneTruth(self.folder, self.models)
        frames = []
        for image_id, pose in poses.items():
            frame = self._frame(image_id, pose, truth)
            if np.isnan(frame.depth_m).all():
                truth.notes.append(f"image {image_id} is left out: it has no depth at all")
            else:
                frames.append(frame)
        if not frames:
            raise BopError(f"{self.folder / 'depth'}: no image of scene {name} holds any depth")
        if self.truths is None:
            truth.notes.append(f"there is no {TRUTH_FILE}: nothing to score against")
        if not (truth.objects or truth.bare):
            frames = [_without_truth(frame) for frame in frames]
        objects = tuple(truth.objects[instance] for instance in sorted(truth.objects))
        scene_notes = (*notes, *truth.notes)
        path = self.folder / SOURCE_FILE
        if not path.is_file():
            return Scene(tuple(frames), objects, name, notes=scene_notes, bare=truth.bare)
        source = read_table(path)
        spec, seed, redraws = (source.get(key) for key in ("spec", "seed", "redraws"))
        if not isinstance(redraws, list) or not isinstance(seed, int | None):
            raise BopError(f"{path}: seed must be a whole number and redraws a list")
        try:
            rebuilt = None if spec is None else SceneSpec.from_dict(spec)
        except SpecError as error:
            raise BopError(f"{path}: spec is not a scene's ({error})") from error
        return Scene(
            tuple(frames),
            objects,
            str(source.get("name", name)),
            redraws=tuple(map(str, redraws)),
            spec=rebuilt,
            seed=seed,
            notes=scene_notes,
            bare=truth.bare,
        )

    def _frame(self, image_id: int, pose: Floats, truth: SceneTruth) -> Frame:
        entry = self.cameras[image_id]
        where = f"{self.folder / CAMERA_FILE}: image {image_id}"
        rgb = read_colour(find_colour(self.folder, image_id))
        height, width = rgb.shape[:2]
        depth_path = self.folder / "depth" / f"{image_id:06d}.png"
        raw = read_depth(depth_path)
        check_size(depth_path, raw.shape, (height, width))
        scale = number(entry, "depth_scale", where=where)
        if not 0 < scale <= MAX_DEPTH_SCALE_MM:
            raise BopError(
                f"{where}: depth_scale is {scale}; millimetres a unit lie in (0, "
                f"{MAX_DEPTH_SCALE_MM}]"
            )
        if self.truths is None:
            instance_ids = truth.read_masks(image_id, shape=(height, width))
        else:
            instance_ids = truth.read_image(
                image_id,
                self.truths.get(image_id, []),
                world_from_camera=pose,
                shape=(height, width),
            )
        joints = None
        if "joint_positions_rad" in entry:
            joints = numbers(entry, "joint_positions_rad", count=7, where=where)
        return Frame(
            rgb=rgb,
            depth_m=metres_from_raw(raw, unit_m=scale / MM_PER_M),
            instance_ids=instance_ids,
            intrinsics=_intrinsics(entry, size=(width, height), where=where),
            world_from_camera=pose,
            joint_positions_rad=joints,
        )


def _without_truth(frame: Frame) -> Frame:
    return Frame(
        rgb=frame.rgb,
        depth_m=frame.depth_m,
        instance_ids=None,
        intrinsics=frame.intrinsics,
        world_from_camera=frame.world_from_camera,
        joint_positions_rad=frame.joint_positions_rad,
    )


def _intrinsics(entry: dict[str, Any], *, size: tuple[int, int], where: str) -> Intrinsics:
    fx, skew, cx, lower, fy, cy, *last = numbers(entry, "cam_K", count=9, where=where).tolist()
    if not (fx > 0 and fy > 0):
        raise BopError(f"{where}: cam_K has focal lengths {fx} and {fy}; they must be positive")
    if abs(skew) > 1e-6 or lower != 0 or last != [0, 0, 1]:
        raise BopError(f"{where}: cam_K is {entry['cam_K']}; it must be fx 0 cx, 0 fy cy, 0 0 1")
    return Intrinsics(*size, fx, fy, cx, cy)
