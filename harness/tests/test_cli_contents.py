"""The command line as a whole: its table of contents, and what every command promises."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
import typer

from harness import cli

if TYPE_CHECKING:
    from collections.abc import Iterator


def commands() -> Iterator[tuple[str, Any]]:
    """Every command, those of groups by both names."""
    for name, command in typer.main.get_group(cli.app).commands.items():
        inner = getattr(command, "commands", None)
        if inner is None:
            yield name, command
        else:
            yield from ((f"{name} {below}", item) for below, item in inner.items())


COMMANDS = dict(commands())


def test_help_reads_like_a_table_of_contents(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--help"]) == 0
    said = capsys.readouterr().out
    places = [said.index(heading) for heading in cli.CONTENTS]
    assert places == sorted(places)
    assert "Exit codes: 0 done; 1 the gate or every scene failed; 2 bad input" in said
    for names in cli.CONTENTS.values():
        for name in names:
            assert f" {name} " in said


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_teaches_and_speaks_to_machines(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([*name.split(), "--help"]) == 0
    said = capsys.readouterr().out
    assert "Examples" in said
    options = {option for item in COMMANDS[name].params for option in item.opts}
    assert "--json" in options


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_can_complete_commands(shell: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import sys; from harness.cli import main; sys.exit(main())"],
        env={
            **os.environ,
            "_HARNESS_COMPLETE": f"complete_{shell}",
            "_TYPER_COMPLETE_ARGS": "harness abl",
            "COMP_WORDS": "harness abl",
            "COMP_CWORD": "1",
            "_TYPER_COMPLETE_FISH_ACTION": "get-args",
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert "ablate" in done.stdout
