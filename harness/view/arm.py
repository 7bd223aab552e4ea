"""The Panda's links and where its joints put them, from the description beside PyBullet.

Its collision meshes are shown, 0.4 MB where the visual ones are 9.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
import rerun as rr
import trimesh
from scipy.spatial.transform import Rotation

from harness.view.names import ARM, TIMELINE
from sim_scenes.arm import FINGER_OPEN_M

if TYPE_CHECKING:
    from collections.abc import Mapping

    from harness.recordings.recording import Recording

Floats = npt.NDArray[np.float64]

COLOUR = (200, 200, 205)


@dataclass(frozen=True, eq=False, kw_only=True)
class Joint:
    """A joint of the description.

    Attributes
    ----------
    name, kind
        The kind is ``revolute``, ``prismatic`` or ``fixed``.
    parent, child
        Links.
    parent_from_joint : (4, 4) float64
        At rest.
    axis : (3,) float64
        In the joint's frame.
    """

    name: str
    kind: str
    parent: str
    child: str
    parent_from_joint: Floats
    axis: Floats

    def parent_from_child(self, position: float) -> Floats:
        """Pose (4, 4) of the child at a position, radians or metres."""
        moved = np.eye(4)
        if self.kind == "revolute":
            moved[:3, :3] = Rotation.from_rotvec(position * self.axis).as_matrix()
        elif self.kind == "prismatic":
            moved[:3, 3] = position * self.axis
        return self.parent_from_joint @ moved


@dataclass(frozen=True, eq=False, kw_only=True)
class Panda:
    """The arm's joints, parents before children, and its links' collision meshes."""

    joints: tuple[Joint, ...]
    meshes: Mapping[str, trimesh.Trimesh]

    def world_from_links(self, joint_positions_rad: Floats) -> dict[str, Floats]:
        """Poses (4, 4) of all links, the fingers open.

        Parameters
        ----------
        joint_positions_rad : (7,) float64
        """
        arm = dict(zip(ARM_JOINTS, joint_positions_rad.tolist(), strict=True))
        poses = {self.joints[0].parent: np.eye(4)}
        for joint in self.joints:
            position = arm.get(joint.name, FINGER_OPEN_M)
            poses[joint.child] = poses[joint.parent] @ joint.parent_from_child(position)
        return poses


ARM_JOINTS = tuple(f"panda_joint{number}" for number in range(1, 8))


def load_panda() -> Panda:
    """Read the Panda that the simulator drives."""
    import pybullet_data

    folder = Path(pybullet_data.getDataPath()) / "franka_panda"
    root = ElementTree.parse(folder / "panda.urdf").getroot()
    meshes = {}
    for link in root.iter("link"):
        if (collision := link.find("collision")) is not None:
            name = collision.find("geometry/mesh").attrib["filename"]  # type: ignore[union-attr]
            mesh = cast(
                "trimesh.Trimesh",
                trimesh.load(folder / name.removeprefix("package://"), force="mesh"),
            )
            meshes[link.attrib["name"]] = mesh.apply_transform(_origin(collision))
    return Panda(joints=tuple(_joint(item) for item in root.iter("joint")), meshes=meshes)


def log_arm(stream: rr.RecordingStream, recording: Recording) -> None:
    """Log the links' meshes once, and their poses at each view; nothing where no arm was used."""
    angles = [view.joint_positions_rad for view in recording.views]
    if all(item is None for item in angles):
        return
    panda = load_panda()
    for link, mesh in panda.meshes.items():
        stream.log(
            f"{ARM}/{link}",
            rr.Mesh3D(
                vertex_positions=mesh.vertices,
                triangle_indices=mesh.faces,
                vertex_normals=mesh.vertex_normals,
                albedo_factor=COLOUR,
            ),
            static=True,
        )
    for step, positions in enumerate(angles):
        if positions is None:
            continue
        stream.set_time(TIMELINE, sequence=step)
        poses = panda.world_from_links(positions)
        for link in panda.meshes:
            pose = poses[link]
            stream.log(
                f"{ARM}/{link}", rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3])
            )


def _joint(item: ElementTree.Element) -> Joint:
    axis = item.find("axis")
    return Joint(
        name=item.attrib["name"],
        kind=item.attrib["type"],
        parent=_named(item, "parent"),
        child=_named(item, "child"),
        parent_from_joint=_origin(item),
        axis=np.array([1.0, 0.0, 0.0]) if axis is None else _three(axis.attrib["xyz"]),
    )


def _named(item: ElementTree.Element, what: str) -> str:
    return item.find(what).attrib["link"]  # type: ignore[union-attr]


def _origin(item: ElementTree.Element) -> Floats:
    """Pose (4, 4) that an element states: URDF's roll, pitch and yaw turn about fixed axes."""
    pose = np.eye(4)
    if (origin := item.find("origin")) is not None:
        stated: Mapping[str, Any] = origin.attrib
        angles = _three(stated.get("rpy", "0 0 0"))
        pose[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix()
        pose[:3, 3] = _three(stated.get("xyz", "0 0 0"))
    return pose


def _three(text: str) -> Floats:
    return np.array([float(word) for word in text.split()])
