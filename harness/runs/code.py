"""Which code computes scenes, by its content: two checkouts of one digest give the same records."""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path

PACKAGES = tuple(Path(__file__).parents[2] / name for name in ("harness", "sim_scenes"))

READERS = frozenset(
    {"benchmarks", "calibration", "figures", "gate", "html_report", "table", "tests", "view"}
)
"""Folders whose code only reads what scenes gave."""


@functools.cache
def scene_code_digest() -> str:
    """Digest of all modules, compiled ones included, that a scene may pass through.

    Left out are the command line and `READERS`; a new folder counts until it is named there.
    Cached, for a process keeps the code that it imported.
    """
    digest = hashlib.sha256()
    for root in PACKAGES:
        for path in sorted((*root.rglob("*.py"), *root.rglob("*.so"))):
            name = path.relative_to(root.parent)
            if READERS.isdisjoint(name.parts) and not name.name.startswith("cli"):
                digest.update(f"{name}\n{path.stat().st_size}\n".encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
