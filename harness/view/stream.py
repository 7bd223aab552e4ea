"""A scene as the bytes of a file that the Rerun viewer opens."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

import rerun as rr

from harness.view.about import draw_legend
from harness.view.arm import log_arm
from harness.view.layout import lay_out
from harness.view.names import ABOUT, LEGEND, WORLD
from harness.view.pictures import log_pictures
from harness.view.points import log_answers, log_training
from harness.view.world import log_clouds, log_map, log_tracker, log_truth

if TYPE_CHECKING:
    from collections.abc import Iterator

    from harness.recordings.recording import Recording

APPLICATION = "harness view"


def encode(recording: Recording, *, name: str, model: str, tolerance_m: float, about: str) -> bytes:
    """Encode a scene as the bytes of an ``.rrd`` file.

    The same input gives the same rows. Not so the same bytes, for Rerun numbers rows by the clock;
    ``rerun rrd compare`` holds two files against each other.

    Parameters
    ----------
    recording
        The scene.
    name
        What the viewer lists it as; a file of the same name replaces it there.
    model
        Whose confidence is shown.
    tolerance_m
        A point lies on the mesh within this distance.
    about
        The text panel, as Markdown.
    """
    # Neither the clock nor the machine is in it; an entity's rows stay together.
    stream = rr.RecordingStream(
        APPLICATION,
        recording_id=name,
        send_properties=False,
        batcher_config=rr.ChunkBatcherConfig.NEVER(),
    )
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    written = rr.binary_stream(stream)
    with _strict():
        stream.send_blueprint(lay_out(recording))
        stream.send_recording_name(name)
        stream.log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        stream.log(ABOUT, rr.TextDocument(about, media_type=rr.MediaType.MARKDOWN), static=True)
        stream.log(LEGEND, rr.Image(draw_legend(recording)), static=True)
        log_truth(stream, recording)
        log_pictures(stream, recording)
        log_arm(stream, recording)
        log_map(stream, recording)
        log_tracker(stream, recording)
        log_clouds(stream, recording)
        log_answers(stream, recording, model=model, tolerance_m=tolerance_m)
        log_training(stream, recording)
    stream.flush()
    content = written.read()
    stream.disconnect()
    return content or b""


@contextmanager
def _strict() -> Iterator[None]:
    """Let Rerun raise what it would else print as a warning, leaving the entity out."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)
