"""What a scene is made of: frames, and the true objects in them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from sim_scenes.geometry import Floats, Ints, apply

if TYPE_CHECKING:
    from collections.abc import Mapping

    from sim_scenes.camera import Intrinsics
    from sim_scenes.spec import SceneSpec


@dataclass(frozen=True, eq=False)
class Frame:
    """One RGB-D view; colour, depth and mask share one pixel grid.

    Attributes
    ----------
    rgb : (h, w, 3) uint8
    depth_m : (h, w) float32
        Depth along the optical axis, metres; NaN where nothing was measured.
    instance_ids : (h, w) uint16 or None
        The object seen at each pixel, 0 for background; None where it is not known.
    intrinsics
        The camera.
    world_from_camera : (4, 4) float64
        Its pose, metres, OpenCV axes.
    joint_positions_rad : (7,) float64 or None
        The Panda's joints; None for data that no Panda took.
    """

    rgb: npt.NDArray[np.uint8]
    depth_m: npt.NDArray[np.float32]
    instance_ids: npt.NDArray[np.uint16] | None
    intrinsics: Intrinsics
    world_from_camera: Floats
    joint_positions_rad: Floats | None = None


@dataclass(frozen=True, eq=False)
class SceneObject:
    """An object at rest, as it truly is.

    Attributes
    ----------
    instance_id
        Its value in `Frame.instance_ids`, from 1.
    name, category
        Of its model; the category is one of the six of NOCS.
    vertices : (n, 3) float64
        Metres in the object's own frame, each coordinate exact in float32.
    faces : (m, 3) int64
    world_from_object : (4, 4) float64
    """

    instance_id: int
    name: str
    category: str
    vertices: Floats
    faces: Ints
    world_from_object: Floats

    def mesh_world(self) -> tuple[Floats, Ints]:
        """Vertices (n, 3) in the world, metres, and faces (m, 3)."""
        return apply(self.world_from_object, self.vertices), self.faces


@dataclass(frozen=True, eq=False)
class Scene:
    """Views of objects at rest.

    Attributes
    ----------
    frames
        In the order they were taken.
    objects
        In order of instance id; the target is the first. Empty where there is no truth.
    bare
        Category by instance id of what has masks but no mesh, so that nothing can be scored on it.
    name
        Unique in its dataset.
    redraws
        Why each rejected draw of the scene was rejected; empty when the first one served.
    spec, seed
        What the scene was simulated from; None for foreign data.
    notes
        What a reader left out or rounded, in words.
    """

    frames: tuple[Frame, ...]
    objects: tuple[SceneObject, ...]
    name: str
    redraws: tuple[str, ...] = ()
    spec: SceneSpec | None = None
    seed: int | None = None
    notes: tuple[str, ...] = ()
    bare: Mapping[int, str] = field(default_factory=dict)

    @property
    def categories(self) -> dict[int, str]:
        """Category by instance id of all that the masks show."""
        return {**{item.instance_id: item.category for item in self.objects}, **self.bare}

    @property
    def redraw_count(self) -> int:
        """Number of draws rejected before this one."""
        return len(self.redraws)

    def digest(self) -> str:
        """Hexadecimal hash of every frame, object, and redraw, bit for bit."""
        state = hashlib.blake2b(digest_size=16)
        parts: tuple[Frame | SceneObject, ...] = (*self.frames, *self.objects)
        for part in parts:
            for item in fields(part):
                _feed(state, getattr(part, item.name))
        _feed(state, (self.redraws, self.spec, self.seed))
        return state.hexdigest()


def _feed(state: hashlib.blake2b, value: object) -> None:
    if isinstance(value, np.ndarray):
        state.update(f"{value.dtype.str}{value.shape}".encode())
        state.update(np.ascontiguousarray(value).tobytes())
    else:
        state.update(repr(value).encode())
