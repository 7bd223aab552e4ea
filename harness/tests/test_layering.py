"""The dependency arrows drawn in crates/README.md are the ones cargo and Python see."""

from __future__ import annotations

import ast
import json
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROW = re.compile(r"^\| (credence-\w+) \|[^|]*\|([^|]*)\|$", re.MULTILINE)


def documented_arrows() -> dict[str, set[str]]:
    table = (ROOT / "crates" / "README.md").read_text(encoding="utf-8")
    return {name: set(re.findall(r"credence-\w+", arrows)) for name, arrows in ROW.findall(table)}


def test_crate_arrows() -> None:
    metadata = subprocess.run(
        ["cargo", "metadata", "--no-deps", "--format-version=1"],
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    packages = json.loads(metadata)["packages"]
    ours = {package["name"] for package in packages}
    arrows = {
        package["name"]: {d["name"] for d in package["dependencies"] if d["kind"] is None} & ours
        for package in packages
    }
    assert arrows == documented_arrows()


def imported_modules(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


@pytest.mark.parametrize("path", sorted((ROOT / "sim_scenes").rglob("*.py")), ids=str)
def test_scenes_import_neither_the_harness_nor_rust(path: Path) -> None:
    assert not {name for name in imported_modules(path) if name.split(".")[0] == "harness"}


def test_one_door_to_rust() -> None:
    doors = {
        path.relative_to(ROOT).as_posix()
        for path in (ROOT / "harness").rglob("*.py")
        if "harness._native" in imported_modules(path)
    }
    assert doors == {"harness/native.py"}
