"""Which changes of the code make other records possible."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harness.runs import code

if TYPE_CHECKING:
    from pathlib import Path

    import pytest


def test_readers_and_the_command_line_change_no_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tmp_path / "harness"
    counted = ("scene_run.py", "_native.abi3.so", "runs/job.py", "new/thing.py")
    for name in (*counted, "figures/draw.py", "cli_bench.py", "tests/test_a.py", "notes.md"):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text("before")
    monkeypatch.setattr(code, "PACKAGES", (root,))

    def digest() -> str:
        code.scene_code_digest.cache_clear()
        return code.scene_code_digest()

    try:
        first = digest()
        assert digest() == first
        for path in sorted(root.rglob("*.*")):
            path.write_text("after")
            name = str(path.relative_to(root))
            assert (digest() != first) == (name in counted)
            path.write_text("before")
    finally:
        code.scene_code_digest.cache_clear()
