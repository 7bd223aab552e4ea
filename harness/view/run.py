"""Shows a recorded scene of a run, or writes it as a file for the Rerun viewer."""

from __future__ import annotations

import difflib
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from harness.errors import InputError
from harness.native import CLASS_NAMES
from harness.results import open_checked
from harness.runs.atomic import write_atomically
from harness.runs.records import read_records
from harness.view.viewer import check_display, check_ports, serve, show, web_address

if TYPE_CHECKING:
    from collections.abc import Callable

    from harness.recordings.recording import Recording
    from harness.runs.directory import RunDirectory
    from harness.runs.records import Record

SUFFIX = ".rrd"
NEAREST = 3


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """Which scene to show, and where.

    Attributes
    ----------
    run
        Folder of a run with recordings.
    scene
        Its id, such as ``mug-0003``, or its number.
    of_class
        The target's class, for a number.
    model
        Whose confidence colours the points.
    save
        File to write; None for a viewer.
    serve
        Serve the viewer to a browser in place of a window.
    port
        Where; the port after it is taken too.
    """

    run: Path
    scene: str
    of_class: str | None = None
    model: str = "metric"
    save: Path | None = None
    serve: bool = False
    port: int = 9090


@dataclass(frozen=True, kw_only=True)
class ViewResult:
    """What was shown.

    Attributes
    ----------
    scene_id, model
        As asked.
    views
        Steps of the timeline before the last, which shows the result.
    size_bytes
        Of the file.
    file
        None where a viewer showed it.
    note
        Why there are no metrics; None if there are.
    """

    scene_id: str
    model: str
    views: int
    size_bytes: int
    file: Path | None
    note: str | None


def view_scene(options: ViewOptions, *, say: Callable[[str], object]) -> ViewResult:
    """Show a scene until the viewer is closed, or write its file.

    Parameters
    ----------
    options
        Which scene, and where.
    say
        Told where a browser finds the viewer.

    Raises
    ------
    InputError
        A package that is missing, a run of another record schema or without such a recording, a
        recording or records that are damaged, a model that was not asked, no display, a port that
        is taken, a file that cannot be written.
    """
    _check_options(options)
    _require_rerun()
    run = open_checked(options.run)
    scene_id = _scene_id(options)
    recording = _recording(run, scene_id)
    if options.model not in recording.answers:
        raise InputError(
            f"--model {options.model}: {run.folder} asked no such model; use one of "
            f"{', '.join(recording.answers)}"
        )
    content, note = _encode(run, recording, model=options.model)
    if options.save is not None:
        write_atomically(options.save, lambda file: file.write(content))
    else:
        with tempfile.TemporaryDirectory(prefix="harness-view-") as folder:
            file = Path(folder) / f"{scene_id}{SUFFIX}"
            write_atomically(file, lambda opened: opened.write(content))
            if options.serve:
                say(f"{web_address(options.port)} shows {scene_id}; Ctrl-C ends it")
                serve(file, port=options.port)
            else:
                show(file)
    return ViewResult(
        scene_id=scene_id,
        model=options.model,
        views=len(recording.views),
        size_bytes=len(content),
        file=options.save,
        note=note,
    )


def _check_options(options: ViewOptions) -> None:
    """Refuse what no run could make good."""
    if options.save is not None:
        if options.serve:
            raise InputError("--save and --serve: choose one")
        if options.save.suffix != SUFFIX:
            raise InputError(
                f"--save {options.save}: end the name in {SUFFIX}, by which the viewer knows it"
            )
    elif options.serve:
        check_ports(options.port)
    else:
        check_display()


def _require_rerun() -> None:
    try:
        import rerun  # noqa: F401 - asked for before the modules that rest on it
    except ModuleNotFoundError as error:
        if error.name != "rerun":
            raise
        raise InputError(
            "package 'rerun-sdk' is not installed; `pip install 'credence[view]'` has it"
        ) from None


def _scene_id(options: ViewOptions) -> str:
    """Id of the scene that was asked for, by id or by number and class."""
    scene, of_class = options.scene, options.of_class
    if of_class is not None and of_class not in CLASS_NAMES[1:]:
        raise InputError(f"--class {of_class}: use one of {', '.join(CLASS_NAMES[1:])}")
    if not scene.isdecimal():
        if of_class is not None:
            raise InputError(f"--class {of_class}: goes with a number, and --scene is {scene}")
        return scene
    if of_class is None:
        raise InputError(
            f"--scene {scene}: say of which class, such as --class mug or --scene mug-{scene:0>4}"
        )
    return f"{of_class}-{int(scene):04d}"


def _recording(run: RunDirectory, scene_id: str) -> Recording:
    recorded = run.recorded()
    if not recorded:
        raise InputError(f"{run.folder} holds no recordings: {run.without_recordings()}")
    if scene_id not in recorded:
        nearest = difflib.get_close_matches(scene_id, recorded, n=NEAREST, cutoff=0.0)
        raise InputError(
            f"{run.folder} has no recording of scene {scene_id}{_why(run, scene_id)}; nearest: "
            f"{', '.join(nearest)}; it has {len(recorded)}, {recorded[0]} to {recorded[-1]}"
        )
    recording = run.recording(scene_id)
    if not recording.views or not recording.objects:
        raise InputError(
            f"{run.recordings / scene_id}.npz is damaged (it holds {len(recording.views)} views "
            f"and {len(recording.objects)} objects); delete it and resume the run with "
            f"`harness bench --out {run.folder}`"
        )
    return recording


def _why(run: RunDirectory, scene_id: str) -> str:
    """Say that a scene failed, if that is why it has no recording."""
    for record in _records(run, scene_id):
        if record.failure is not None:
            return f", which failed ({record.failure})"
    return ""


def _records(run: RunDirectory, scene_id: str) -> list[Record]:
    """Read a scene's records; an unfinished run has none."""
    if not run.records_path.exists():
        return []
    return [record for record in read_records(run.records_path) if record.scene_id == scene_id]


def _encode(run: RunDirectory, recording: Recording, *, model: str) -> tuple[bytes, str | None]:
    """Encode a scene for the viewer, and say why it has no metrics, if so."""
    from harness.view.about import describe
    from harness.view.stream import encode

    tolerance_m = run.config().protocol.reported_tolerance_m
    records = [
        record for record in _records(run, recording.scene_id) if record.tolerance_m == tolerance_m
    ]
    note = None
    if not run.records_path.exists():
        note = (
            f"{run.folder} is unfinished, so that it has no metrics; finish it with "
            f"`harness bench --out {run.folder}`"
        )
    run_name = run.folder.resolve().name
    about = describe(
        recording,
        records,
        run_name=run_name,
        model=model,
        tolerance_m=tolerance_m,
        note=note,
    )
    content = encode(
        recording,
        name=f"{run_name} {recording.scene_id} {model}",
        model=model,
        tolerance_m=tolerance_m,
        about=about,
    )
    return content, note
