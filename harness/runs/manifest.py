"""Where a run's numbers come from: the code, the packages and the machine."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harness.runs.code import scene_code_digest

if TYPE_CHECKING:
    from collections.abc import Mapping

PACKAGES = (
    "credence",
    "manifold3d",
    "numpy",
    "polars",
    "pybullet",
    "pycocotools",
    "scipy",
    "trimesh",
)
"""Packages whose version a run's numbers may depend on."""

UNKNOWN = "unknown"


def core_count() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def describe_session() -> dict[str, Any]:
    """Code, packages, machine and time of one sitting at a run."""
    return {
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "git": git_state(Path(__file__)),
        "code": scene_code_digest(),
        "python": platform.python_version(),
        "packages": package_versions(),
        "machine": {
            "system": platform.platform(),
            "cpu": _cpu_model(),
            "cores": core_count(),
            "memory_mib": os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2**20,
        },
    }


def differing_code(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, str]:
    """In what two sittings' code differs: ``first -> second`` by kind."""
    return {
        what: f"{first.get(what)} -> {second.get(what)}"
        for what in ("git", "code", "packages", "python")
        if first.get(what) != second.get(what)
    }


def package_versions() -> dict[str, str]:
    """Version of each of `PACKAGES`, ``unknown`` where it is not installed."""
    return {name: _version(name) for name in PACKAGES}


def git_state(file: Path) -> dict[str, Any]:
    """Revision of the checkout that tracks a file, and whether tracked files differ from it.

    An installed package has no checkout, even where its folder lies inside one: ``unknown``.
    """
    folder = file.parent
    if _git(folder, "ls-files", "--error-unmatch", file.name) is None:
        return {"revision": UNKNOWN, "dirty": UNKNOWN}
    revision = _git(folder, "rev-parse", "HEAD")
    changes = _git(folder, "status", "--porcelain", "--untracked-files=no")
    return {
        "revision": revision or UNKNOWN,
        "dirty": UNKNOWN if changes is None else bool(changes),
    }


def _git(folder: Path, *arguments: str) -> str | None:
    command = ["git", "-C", str(folder), *arguments]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=30)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return UNKNOWN


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or UNKNOWN
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, UNKNOWN)
