"""What was asked of a model and what it learned from: test points and training points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rerun as rr

from harness.figures.style import confidence_colours
from harness.native import CLASS_NAMES
from harness.pictures import CLASS_COLOURS
from harness.view.names import CONFIDENCE, JUDGED, TIMELINE, TRAINING, set_name

if TYPE_CHECKING:
    from harness.recordings.recording import Recording

POINT_RADIUS_M = 0.0015
TRAINING_RADIUS_M = 0.001

# Okabe and Ito's palette, as the classes' colours.
OUTCOMES = {
    "true negative": (153, 153, 153),
    "false negative": (230, 159, 0),
    "true positive": (0, 158, 115),
    "false positive": (213, 94, 0),
}
"""Colours; an outcome's place is 2 x (put on the target) + (wrongly)."""


def log_answers(
    stream: rr.RecordingStream, recording: Recording, *, model: str, tolerance_m: float
) -> None:
    """Log at the result each test set by a model's confidence, and by whether it is right."""
    answers = recording.answers[model]
    on_target = recording.on_target(tolerance_m)
    predicted = answers.classes == CLASS_NAMES.index(recording.category)
    outcomes = (2 * predicted + (predicted != on_target)).astype(np.uint16)
    context = rr.AnnotationContext(
        [
            rr.ClassDescription(info=rr.AnnotationInfo(number, label=name, color=colour))
            for number, (name, colour) in enumerate(OUTCOMES.items())
        ]
    )
    stream.log(JUDGED, context, static=True)
    stream.set_time(TIMELINE, sequence=len(recording.views))
    for item in recording.test_sets:
        points = recording.test_world[item.part]
        if not len(points):
            continue
        name = set_name(item.completion)
        confidence = answers.confidence[item.part]
        stream.log(
            f"{CONFIDENCE}/{name}",
            rr.Points3D(points, radii=POINT_RADIUS_M, colors=confidence_colours(confidence)),
            # A selected point's panel shows these beside its colour.
            rr.AnyValues(
                confidence=confidence,
                probability=answers.probability[item.part],
                distance_from_target_m=recording.distances_m[0, item.part],
            ),
        )
        stream.log(
            f"{JUDGED}/{name}",
            rr.Points3D(
                points, radii=POINT_RADIUS_M, class_ids=outcomes[item.part], show_labels=False
            ),
        )


def log_training(stream: rr.RecordingStream, recording: Recording) -> None:
    """Log at the result what the models learned from, free space apart."""
    stream.set_time(TIMELINE, sequence=len(recording.views))
    palette = np.array([CLASS_COLOURS[name] for name in CLASS_NAMES], dtype=np.uint8)
    free = recording.training_classes == 0
    for name, chosen in (("object", ~free), ("free", free)):
        if chosen.any():
            stream.log(
                f"{TRAINING}/{name}",
                rr.Points3D(
                    recording.training_world[chosen],
                    radii=TRAINING_RADIUS_M,
                    colors=palette[recording.training_classes[chosen]],
                ),
            )
