"""What becomes of a map view by view, noted while it is made."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.recordings.recording import (
    RecordedDetection,
    RecordedView,
    RecordedVoxels,
    TrackedState,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.native import Detection, Pipeline, Voxels
    from sim_scenes import Frame

MOST_DETECTIONS = 255
"""Of a view; the least sure beyond them are left out, as a mask image counts them in a byte."""


@dataclass(eq=False)
class MapWatch:
    """Notes views, detections and tracker, and when each voxel was first occupied.

    Attributes
    ----------
    views
        As recorded, in order.
    """

    views: list[RecordedView] = field(default_factory=list)
    _first_view: dict[bytes, int] = field(default_factory=dict)

    def note(
        self,
        frame: Frame,
        detections: Sequence[Detection],
        object_ids: Sequence[int | None],
        pipeline: Pipeline,
    ) -> None:
        """Note a frame that was just added.

        Parameters
        ----------
        frame
            The frame.
        detections, object_ids
            What was found in it, and the tracked object of each.
        pipeline
            The map after it.
        """
        for key in _keys(pipeline.voxels()):
            self._first_view.setdefault(key, len(self.views))
        camera = frame.intrinsics
        ids = frame.instance_ids
        surest = sorted(range(len(detections)), key=lambda index: -detections[index].score)
        kept = surest[:MOST_DETECTIONS]
        self.views.append(
            RecordedView(
                rgb=frame.rgb,
                depth_m=frame.depth_m,
                true_ids=np.zeros(frame.depth_m.shape, np.uint16) if ids is None else ids,
                found=_found(frame.depth_m.shape, [detections[index].mask for index in kept]),
                detections=tuple(
                    RecordedDetection(
                        category=detections[index].category,
                        score=detections[index].score,
                        object_id=object_ids[index],
                    )
                    for index in kept
                ),
                intrinsics=np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
                world_from_camera=frame.world_from_camera,
                joint_positions_rad=frame.joint_positions_rad,
                tracked=tuple(
                    TrackedState(
                        id=item.id,
                        category=item.category,
                        score=item.score,
                        centroid_world=item.centroid_world,
                    )
                    for item in pipeline.objects()
                ),
            )
        )

    def voxels(self, pipeline: Pipeline) -> RecordedVoxels:
        """Record the map as it stands."""
        voxels = pipeline.voxels()
        last = max(len(self.views) - 1, 0)
        first = [self._first_view.get(key, last) for key in _keys(voxels)]
        return RecordedVoxels(
            size_m=voxels.size_m,
            centres_world=voxels.centres_world.astype(np.float32),
            rgb=voxels.rgb,
            classes=voxels.classes,
            object_ids=voxels.object_ids,
            confidence=voxels.confidence.astype(np.float32),
            first_view=np.array(first, dtype=np.uint8),
        )


def _found(shape: tuple[int, ...], masks: Sequence[npt.NDArray[np.bool_]]) -> npt.NDArray[np.uint8]:
    """Paint masks (h, w) with their numbers, from 1; an earlier one covers a later."""
    found = np.zeros(shape, dtype=np.uint8)
    for index in reversed(range(len(masks))):
        found[masks[index]] = index + 1
    return found


def _keys(voxels: Voxels) -> list[bytes]:
    """Name each voxel by its place in the grid."""
    keys = np.round(voxels.centres_world / voxels.size_m - 0.5).astype(np.int32)
    return [row.tobytes() for row in keys]
