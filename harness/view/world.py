"""The map as it grew, the tracker, and what was made of each object beside its true mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
import trimesh

from harness.figures.style import confidence_colours
from harness.native import CLASS_NAMES
from harness.pictures import CLASS_COLOURS
from harness.view.names import (
    BY_CLASS,
    BY_COLOUR,
    BY_CONFIDENCE,
    COMPLETED,
    OBSERVED,
    TIMELINE,
    TRACKER,
    TRACKER_NAMES,
    TRUE,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from harness.recordings.recording import MappedCloud, Recording, TrackedState

TRACKER_RADIUS_M = 0.008
NAMES_ABOVE_M = 0.14
NAMES_RADIUS_M = 0.001
OBSERVED_RADIUS_M = 0.0008
COMPLETED_RADIUS_M = 0.0012
TRUE_COLOUR = (140, 140, 140, 110)


def log_truth(stream: rr.RecordingStream, recording: Recording) -> None:
    """Log the true meshes, translucent, for all times."""
    for item in recording.objects:
        mesh = trimesh.Trimesh(item.vertices_world, item.faces, process=False)
        stream.log(
            f"{TRUE}/{rr.escape_entity_path_part(f'{item.instance_id}_{item.name}')}",
            rr.Mesh3D(
                vertex_positions=item.vertices_world,
                triangle_indices=item.faces,
                vertex_normals=mesh.vertex_normals,
                albedo_factor=TRUE_COLOUR,
            ),
            static=True,
        )


def log_map(stream: rr.RecordingStream, recording: Recording) -> None:
    """Log at each view's step the voxels that it was the first to occupy.

    They stay from then on. Class and colour are those that they have at the end.
    """
    voxels = recording.voxels
    keys = np.round(voxels.centres_world / voxels.size_m - 0.5).astype(np.int32)
    edges = (voxels.size_m,) * 3
    palette = np.array([CLASS_COLOURS[name] for name in CLASS_NAMES], dtype=np.uint8)
    for step in range(len(recording.views)):
        new = voxels.first_view == step
        if not new.any():
            continue
        stream.set_time(TIMELINE, sequence=step)
        for path, colours in ((BY_CLASS, palette[voxels.classes]), (BY_COLOUR, voxels.rgb)):
            stream.log(
                f"{path}/view_{step}", rr.VoxelGridMap(keys[new], edges, colors=colours[new])
            )
    asked = np.isfinite(voxels.confidence)
    if asked.any():
        stream.set_time(TIMELINE, sequence=len(recording.views))
        stream.log(
            BY_CONFIDENCE,
            rr.VoxelGridMap(
                keys[asked], edges, colors=confidence_colours(voxels.confidence[asked])
            ),
        )


def log_tracker(stream: rr.RecordingStream, recording: Recording) -> None:
    """Log the tracked objects after each view, and at the result, as labelled spheres."""
    for step, view in enumerate(recording.views):
        stream.set_time(TIMELINE, sequence=step)
        _log_tracked(stream, view.tracked, target_id=None)
    stream.set_time(TIMELINE, sequence=len(recording.views))
    _log_tracked(stream, recording.tracked, target_id=recording.target_id)


def log_clouds(stream: rr.RecordingStream, recording: Recording) -> None:
    """Log at the result the points that were observed of each object, and its completion's."""
    stream.set_time(TIMELINE, sequence=len(recording.views))
    for item in recording.tracked:
        for path, points, radius in (
            (OBSERVED, item.observed_world, OBSERVED_RADIUS_M),
            (COMPLETED, item.completed_world, COMPLETED_RADIUS_M),
        ):
            if len(points):
                colour = CLASS_COLOURS[item.category]
                stream.log(f"{path}/{item.id}", rr.Points3D(points, radii=radius, colors=colour))


def _log_tracked(
    stream: rr.RecordingStream,
    tracked: Sequence[TrackedState | MappedCloud],
    *,
    target_id: int | None,
) -> None:
    found: npt.NDArray[np.float64] = np.array([item.centroid_world for item in tracked])
    centroids = found.reshape(-1, 3)
    colours = [CLASS_COLOURS[item.category] for item in tracked]
    stream.log(TRACKER, rr.Points3D(centroids, radii=TRACKER_RADIUS_M, colors=colours))
    # Above, where a label does not hide its object.
    stream.log(
        TRACKER_NAMES,
        rr.Points3D(
            centroids + np.array([0.0, 0.0, NAMES_ABOVE_M]),
            radii=NAMES_RADIUS_M,
            colors=colours,
            labels=[
                f"#{item.id} {item.category} {item.score:.2f}"
                + (", the target" if item.id == target_id else "")
                for item in tracked
            ],
            show_labels=True,
        ),
    )
