"""Ground truth of a scene: which objects are there, and which pixels are theirs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from sim_scenes.bop.fields import pose_exact, pose_mm, table_of, whole
from sim_scenes.bop.images import read_mask
from sim_scenes.errors import BopError
from sim_scenes.scene import SceneObject

if TYPE_CHECKING:
    from pathlib import Path

    from sim_scenes.bop.models import ModelFolder
    from sim_scenes.geometry import Floats

# Annotations of one object in several images agree to well within this; further apart, two objects
# of one model are meant.
SAME_OBJECT_M = 0.02
MAX_INSTANCES = 65535
MASK_FOLDER = "mask_visib"


@dataclass(eq=False)
class SceneTruth:
    """Collects the objects of a scene image by image; objects are at rest in the world.

    Attributes
    ----------
    scene
        Folder of the scene.
    models
        Where the meshes come from.
    objects
        Found so far, by instance id.
    bare
        Category by instance id of what has no mesh.
    notes
        What was left out, and why; each once.
    """

    scene: Path
    models: ModelFolder
    objects: dict[int, SceneObject] = field(default_factory=dict)
    bare: dict[int, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    # Model and origin in the world of each instance met.
    _places: dict[int, tuple[int, Floats]] = field(default_factory=dict)

    def read_image(
        self,
        image_id: int,
        entries: Any,
        *,
        world_from_camera: Floats,
        shape: tuple[int, int],
    ) -> npt.NDArray[np.uint16] | None:
        """Take in one image's entries of `scene_gt.json`; returns its mask (h, w) if it has one."""
        where = f"{self.scene / 'scene_gt.json'}: image {image_id}"
        if not isinstance(entries, list):
            raise BopError(f"{where} is {entries!r:.60}; it must be a list of objects")
        instances: list[int] = []
        for gt_id, value in enumerate(entries):
            at = f"{where}, object {gt_id}"
            entry = table_of(value, where=at)
            found = self._instance(
                entry, taken=instances, world_from_camera=world_from_camera, where=at
            )
            instances.append(found)
        return self._mask(image_id, instances, shape=shape)

    def read_masks(self, image_id: int, *, shape: tuple[int, int]) -> npt.NDArray[np.uint16] | None:
        """Mask (h, w) of an image of which nothing but masks is known.

        An instance id says nothing across images then; the category is the dataset's only one.
        """
        folder = self.scene / MASK_FOLDER
        if not folder.is_dir():
            return None
        category = self.models.common_category()
        if category is None:
            self._note("there are masks, but nothing says of which category their objects are")
            return None
        ids = np.zeros(shape, dtype=np.uint16)
        paths = sorted(folder.glob(f"{image_id:06d}_*.png"))
        for instance, path in enumerate(paths, start=1):
            ids[read_mask(path, shape=shape)] = instance
            self.bare[instance] = category
        return ids

    def _instance(
        self,
        entry: dict[str, Any],
        *,
        taken: list[int],
        world_from_camera: Floats,
        where: str,
    ) -> int:
        """Instance id of an entry; 0 for an object that is left out."""
        object_id = whole(entry, "obj_id", where=where, limit=10**6)
        camera_from_object = pose_mm(
            entry, rotation="cam_R_m2c", translation="cam_t_m2c", where=where
        )
        model = self.models.get(object_id)
        category = self.models.category(object_id)
        if isinstance(model, str):
            left_out = "left out" if category is None else "not scored"
            self._note(f"object {object_id} is {left_out}: {model}")
        if category is None:
            return 0
        if "world_from_object" in entry:
            pose = pose_exact(entry, "world_from_object", where=where)
        else:
            pose = world_from_camera @ camera_from_object
        if "instance_id" in entry:
            instance = whole(entry, "instance_id", where=where, limit=MAX_INSTANCES)
            if instance == 0 or instance in taken:
                raise BopError(
                    f"{where}: instance_id is {instance}; ids count from 1, each once an image"
                )
        else:
            instance = self._match(object_id, pose, taken=taken)
        self._places.setdefault(instance, (object_id, pose[:3, 3]))
        if isinstance(model, str):
            self.bare[instance] = category
        elif instance not in self.objects:
            self.objects[instance] = SceneObject(
                instance_id=instance,
                name=model.name,
                category=model.category,
                vertices=model.vertices,
                faces=model.faces,
                world_from_object=pose,
            )
        return instance

    def _match(self, object_id: int, pose: Floats, *, taken: list[int]) -> int:
        """Id of the nearest known object of this model, or a new one."""
        distances = {
            instance: float(np.linalg.norm(origin - pose[:3, 3]))
            for instance, (known_id, origin) in self._places.items()
            if known_id == object_id and instance not in taken
        }
        near = {instance: d for instance, d in distances.items() if d <= SAME_OBJECT_M}
        if near:
            return min(near, key=lambda instance: (near[instance], instance))
        if distances:
            self._note(
                f"object {object_id} stands more than {SAME_OBJECT_M} m apart in two images: "
                "taken for two objects"
            )
        return max(self._places, default=0) + 1

    def _mask(
        self, image_id: int, instances: list[int], *, shape: tuple[int, int]
    ) -> npt.NDArray[np.uint16] | None:
        folder = self.scene / MASK_FOLDER
        if not folder.is_dir():
            self._note(
                f"there is no folder {MASK_FOLDER}: which pixels are an object's is not known"
            )
            return None
        ids = np.zeros(shape, dtype=np.uint16)
        for gt_id, instance in enumerate(instances):
            if instance:
                path = folder / f"{image_id:06d}_{gt_id:06d}.png"
                ids[read_mask(path, shape=shape)] = instance
        return ids

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)
