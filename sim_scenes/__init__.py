"""Tabletop scenes as the Panda's wrist camera sees them: simulated with PyBullet, or read from BOP.

A `SceneSpec` and a seed make a `Scene`: a few `Frame`s of objects at rest, and the truth about
those objects. Only `simulate` needs PyBullet; it says so where PyBullet is missing.
"""

from __future__ import annotations

from sim_scenes.bop import BopDataset, open_bop, read_bop, write_bop
from sim_scenes.bullet import require_pybullet
from sim_scenes.camera import HAND_FROM_CAMERA, Intrinsics, d435_intrinsics
from sim_scenes.errors import BopError, SceneError, SimulatorMissing, SpecError
from sim_scenes.objects import ObjectModel, ObjectSet, load_object_set
from sim_scenes.scene import Frame, Scene, SceneObject
from sim_scenes.sensor import DepthNoise
from sim_scenes.simulation import simulate
from sim_scenes.spec import Appearance, Arc, SceneSpec

__all__ = [
    "Appearance",
    "Arc",
    "BopDataset",
    "BopError",
    "DepthNoise",
    "Frame",
    "HAND_FROM_CAMERA",
    "Intrinsics",
    "ObjectModel",
    "ObjectSet",
    "Scene",
    "SceneError",
    "SceneObject",
    "SceneSpec",
    "SimulatorMissing",
    "SpecError",
    "d435_intrinsics",
    "load_object_set",
    "open_bop",
    "read_bop",
    "require_pybullet",
    "simulate",
    "write_bop",
]
