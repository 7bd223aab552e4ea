"""Where a run's numbers come from, as the page states it."""

from __future__ import annotations

import json
import shlex
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from harness.config import load_config
from harness.html_report.grid import Cell, Grid, Heading

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from harness.config import Config
    from harness.runs.directory import RunDirectory


@dataclass(frozen=True)
class Provenance:
    """Code, machine, configuration and the command that computes the run again.

    Attributes
    ----------
    sessions
        Each sitting at the run.
    packages
        Their versions in the last sitting.
    changed
        Keys of the configuration that are not at this version's defaults.
    unchanged
        The others.
    command
        Shell lines.
    warnings
        What stands in the way of computing it again.
    """

    sessions: Grid
    packages: str
    changed: Grid
    unchanged: Grid
    command: str
    warnings: Sequence[str]


def provenance(run: RunDirectory, config: Config) -> Provenance:
    """Take from a run's manifest where it comes from."""
    manifest = run.manifest()
    sessions = manifest["sessions"]
    last = sessions[-1] if sessions else {}
    ours, defaults = config.identity(), load_config(None).identity()
    keys = sorted(ours, key=lambda key: (key.startswith("pipeline."), key))
    changed = [key for key in keys if key not in defaults or ours[key] != defaults[key]]
    return Provenance(
        sessions=_sessions(sessions),
        packages=", ".join(f"{k} {v}" for k, v in sorted(last.get("packages", {}).items())),
        changed=Grid(
            "Settings that are not at this version's defaults",
            (Heading("key", numeric=False), *_texts("value", "default")),
            [
                (Cell(key), Cell(_plain(ours[key])), Cell(_plain(defaults.get(key, "unset"))))
                for key in changed
            ],
        ),
        unchanged=Grid(
            "Settings at their defaults",
            _texts("key", "value"),
            [(Cell(key), Cell(_plain(ours[key]))) for key in keys if key not in changed],
        ),
        command=_command(run.folder, last),
        warnings=tuple(_warnings(sessions, objects=config.scenes.objects)),
    )


def _texts(*names: str) -> tuple[Heading, ...]:
    return tuple(Heading(name, numeric=False) for name in names)


def _plain(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _sessions(sessions: Sequence[Mapping[str, Any]]) -> Grid:
    rows = []
    for item in sessions:
        git, machine = item.get("git", {}), item.get("machine", {})
        dirty = " with changes" if git.get("dirty") is True else ""
        rows.append(
            (
                Cell(str(item.get("started", "unknown"))),
                Cell(f"{git.get('revision', 'unknown')}{dirty}"),
                Cell(str(item.get("python", "unknown"))),
                Cell(f"{machine.get('cpu', 'unknown')}, {machine.get('cores', '?')} cores"),
                Cell(f"{machine.get('memory_mib', '?')} MiB"),
                Cell(str(machine.get("system", "unknown"))),
            )
        )
    names = ("started", "git revision", "Python", "processor", "memory", "system")
    return Grid("Sittings at the run", _texts(*names), rows)


def _command(folder: Path, last: Mapping[str, Any]) -> str:
    revision = last.get("git", {}).get("revision", "unknown")
    lines = [] if revision == "unknown" else [f"git checkout {shlex.quote(str(revision))}"]
    config = shlex.quote(str(folder / "config.toml"))
    again = shlex.quote(f"{folder}-again")
    return "\n".join([*lines, "make setup", f"harness bench --config {config} --out {again}"])


def _warnings(sessions: Sequence[Mapping[str, Any]], *, objects: Path | None) -> Iterator[str]:
    if any(item.get("git", {}).get("dirty") is True for item in sessions):
        yield "Tracked files differed from the git revision while the run was made."
    revisions = {str(item.get("git", {}).get("revision")) for item in sessions}
    if len(revisions) > 1:
        yield f"The run was made by {len(revisions)} revisions of the code."
    if objects is not None:
        yield f"The run is on meshes of its own, in {objects}."
