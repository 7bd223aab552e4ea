"""What the README shows is what the program does."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from harness.cli import app
from harness.config import load_config

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_configuration_shown_is_the_default(tmp_path: Path) -> None:
    (shown,) = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    path = tmp_path / "shown.toml"
    path.write_text(shown, encoding="utf-8")
    assert load_config(path) == load_config(None)


def test_the_commands_shown_exist() -> None:
    shown = {
        shlex.split(line, comments=True)[1]
        for line in re.findall(r"\.venv/bin/(harness .*)", README)
    }
    known = {
        command.name or getattr(command.callback, "__name__", "")
        for command in app.registered_commands
    } | {group.name for group in app.registered_groups}
    assert shown == known


def test_links_and_pictures_exist() -> None:
    targets = re.findall(r"\]\(([^)#]+)\)", README)
    assert targets
    assert [target for target in targets if not (ROOT / target).exists()] == []
