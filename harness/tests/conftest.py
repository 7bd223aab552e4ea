"""Fixtures that several test modules share."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def orders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder whose files tell the fake scenes what shall go wrong."""
    folder = tmp_path / "orders"
    folder.mkdir()
    monkeypatch.setenv("FAKE_SCENES", str(folder))
    return folder
