"""What two machines must share for the same job to give the same bits."""

from __future__ import annotations

import functools
import hashlib
import platform
from pathlib import Path
from typing import TYPE_CHECKING

from harness.runs.code import scene_code_digest
from harness.runs.manifest import package_versions

if TYPE_CHECKING:
    from collections.abc import Mapping


@functools.cache
def code_identity() -> dict[str, str]:
    """Python, packages and our own code, by name; cached, for a process keeps what it imported."""
    return {
        "Python": platform.python_version(),
        **package_versions(),
        "code": scene_code_digest(),
    }


def differences(*, ours: Mapping[str, str], theirs: Mapping[str, str]) -> str:
    """Say in what another machine differs; empty where it does not."""
    return "; ".join(
        f"{name} {theirs.get(name, 'missing')} there, {ours.get(name, 'missing')} here"
        for name in sorted(ours.keys() | theirs.keys())
        if ours.get(name) != theirs.get(name)
    )


def other_files(files: Mapping[str, str]) -> str:
    """Say which files are not the same on this machine; empty where all are.

    Parameters
    ----------
    files
        The sha256 of each by its path.
    """
    others = {path: found for path in files if (found := file_digest(path)) != files[path]}
    if not others:
        return ""
    path, found = next(iter(others.items()))
    why = "missing there" if found is None else "another there"
    rest = f" and {len(others) - 1} more" if len(others) > 1 else ""
    return f"{path} is {why}{rest}"


@functools.cache
def file_digest(path: str) -> str | None:
    """Return a file's sha256, None where it cannot be read; a worker hashes each file once."""
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None
