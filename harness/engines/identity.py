"""What two machines must share for the same job to give the same bits."""

from __future__ import annotations

import functools
import hashlib
import platform
from pathlib import Path

from harness.runs.manifest import package_versions

ROOTS = tuple(Path(__file__).parents[2] / name for name in ("harness", "sim_scenes"))
"""The packages whose code computes scenes."""


@functools.cache
def code_identity() -> dict[str, str]:
    """Python, packages and our own code, by name; cached, for a process keeps what it imported."""
    return {"Python": platform.python_version(), **package_versions(), "code": code_digest(ROOTS)}


def code_digest(roots: tuple[Path, ...]) -> str:
    """Digest of the modules of packages, compiled ones included, tests left out."""
    digest = hashlib.sha256()
    for root in roots:
        for path in sorted((*root.rglob("*.py"), *root.rglob("*.so"))):
            name = path.relative_to(root.parent)
            if "tests" in name.parts:
                continue
            digest.update(f"{name}\n{path.stat().st_size}\n".encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def differences(*, ours: dict[str, str], theirs: dict[str, str]) -> str:
    """Say in what another machine differs; empty where it does not."""
    return "; ".join(
        f"{name} {theirs.get(name, 'missing')} there, {ours.get(name, 'missing')} here"
        for name in sorted(ours.keys() | theirs.keys())
        if ours.get(name) != theirs.get(name)
    )
