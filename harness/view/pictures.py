"""What the camera saw at each view: pose, images, detections and true masks."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
import rerun as rr
from PIL import Image

from harness.pictures import CLASS_COLOURS
from harness.recordings.file import DEPTH_UNIT_M
from harness.view.names import CAMERA, DEPTH, FOUND, FOUND_BOXES, RGB, TIMELINE, TRUE_MASKS

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from harness.recordings.recording import RecordedDetection, RecordedView, Recording

PIXEL_CENTRE = 0.5
"""Rerun counts pixels from the first one's corner, this project from its centre."""

IMAGE_PLANE_M = 0.12
DEPTH_RANGE_M = (0.2, 1.0)
MASK_OPACITY = 0.6

NOTHING = rr.ClassDescription(info=rr.AnnotationInfo(0, label="background", color=(0, 0, 0, 0)))


def log_pictures(stream: rr.RecordingStream, recording: Recording) -> None:
    """Log each view at its step."""
    true = rr.AnnotationContext(
        [
            NOTHING,
            *(
                rr.ClassDescription(
                    info=rr.AnnotationInfo(
                        item.instance_id, label=item.name, color=CLASS_COLOURS[item.category]
                    )
                )
                for item in recording.objects
            ),
        ]
    )
    stream.log(TRUE_MASKS, true, static=True)
    for step, view in enumerate(recording.views):
        stream.set_time(TIMELINE, sequence=step)
        _log_camera(stream, view)
        stream.log(RGB, rr.EncodedImage(contents=_png(view.rgb), media_type="image/png"))
        stream.log(
            DEPTH,
            rr.EncodedDepthImage(
                _png(np.round(np.nan_to_num(view.depth_m / DEPTH_UNIT_M)).astype(np.uint16)),
                media_type="image/png",
                meter=1 / DEPTH_UNIT_M,
                colormap=rr.components.Colormap.Viridis,
                depth_range=[bound / DEPTH_UNIT_M for bound in DEPTH_RANGE_M],
            ),
        )
        _log_found(stream, view)
        stream.log(TRUE_MASKS, rr.SegmentationImage(view.true_ids, opacity=MASK_OPACITY))


def _log_camera(stream: rr.RecordingStream, view: RecordedView) -> None:
    pose = view.world_from_camera
    height, width = view.depth_m.shape
    fx, fy, cx, cy = view.intrinsics.tolist()
    stream.log(
        CAMERA,
        rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]),
        rr.Pinhole(
            focal_length=(fx, fy),
            principal_point=(cx + PIXEL_CENTRE, cy + PIXEL_CENTRE),
            resolution=(width, height),
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=IMAGE_PLANE_M,
        ),
    )


def _log_found(stream: rr.RecordingStream, view: RecordedView) -> None:
    """Log masks in their classes' colours, and a box with class, score and id around each."""
    names = [_detection_name(item) for item in view.detections]
    colours = [CLASS_COLOURS[item.category] for item in view.detections]
    context = rr.AnnotationContext(
        [
            NOTHING,
            *(
                rr.ClassDescription(info=rr.AnnotationInfo(number, label=name, color=colour))
                for number, (name, colour) in enumerate(zip(names, colours, strict=True), start=1)
            ),
        ]
    )
    stream.log(FOUND, context, rr.SegmentationImage(view.found, opacity=MASK_OPACITY))
    boxes = [mask_box(view.found == number) for number in range(1, len(names) + 1)]
    # A mask that surer ones cover wholly has no box.
    kept = [index for index, box in enumerate(boxes) if box is not None]
    bounds = np.array([boxes[index] for index in kept], dtype=np.float64).reshape(-1, 2, 2)
    stream.log(
        FOUND_BOXES,
        rr.Boxes2D(
            mins=bounds[:, 0],
            sizes=bounds[:, 1] - bounds[:, 0],
            labels=[names[index] for index in kept],
            colors=[colours[index] for index in kept],
            show_labels=True,
        ),
    )


def mask_box(mask: npt.NDArray[np.bool_]) -> Sequence[Sequence[float]] | None:
    """Box of a mask (h, w) from pixels' corners, ((left, top), (right, bottom)); None if empty."""
    rows, columns = np.nonzero(mask)
    if not len(rows):
        return None
    left, top = float(columns.min()), float(rows.min())
    return ((left, top), (float(columns.max()) + 1, float(rows.max()) + 1))


def _detection_name(item: RecordedDetection) -> str:
    became = "not mapped" if item.object_id is None else f"#{item.object_id}"
    return f"{item.category} {item.score:.2f} {became}"


def _png(image: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> bytes:
    file = io.BytesIO()
    Image.fromarray(image).save(file, format="PNG")
    return file.getvalue()
