"""Training pictures: domain-randomised renders of objects among things of no category."""

from __future__ import annotations

from sim_scenes.pictures.picture import (
    GROUP,
    MOST_OBJECTS,
    TrainingPicture,
    draw_group,
    picture_intrinsics,
)

__all__ = ["GROUP", "MOST_OBJECTS", "TrainingPicture", "draw_group", "picture_intrinsics"]
