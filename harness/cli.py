"""The command line: what commands there are, and how they end.

Every command is also a plain function that returns a result object, and has its module ``cli_*``.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from harness import (
    cli_ablate,
    cli_bench,
    cli_calibration,
    cli_completion,
    cli_data,
    cli_figures,
    cli_gate,
    cli_merge,
    cli_pictures,
    cli_render,
    cli_report,
    cli_segmentation,
    cli_study,
    cli_view,
)
from harness.cli_parts import EXIT_BAD_INPUT, EXIT_INTERRUPTED, EXIT_OK
from harness.errors import InputError
from harness.sitting import RunInterruptedError

if TYPE_CHECKING:
    from collections.abc import Sequence

MODULES = (
    cli_bench,
    cli_ablate,
    cli_gate,
    cli_calibration,
    cli_merge,
    cli_data,
    cli_study,
    cli_render,
    cli_report,
    cli_figures,
    cli_view,
    cli_segmentation,
    cli_completion,
    cli_pictures,
)
"""Whose commands there are."""

CONTENTS = {
    "Measure": ("bench", "ablate", "run", "merge"),
    "Judge": ("gate", "baseline", "compare", "calibration", "threshold"),
    "Look": ("show", "report", "figures", "view", "render"),
    "Measure and tune single stages": ("segmentation-report", "completion-report", "tune"),
    "Make data": ("assets", "export", "training-pictures"),
}
"""The table of contents: what `harness --help` lists, in its order."""

app = typer.Typer(
    name="harness",
    help=(
        "Benchmark of confidence scores in semantic maps, on simulated scenes with known meshes."
        "\n\nBegin with [cyan]harness bench --quick[/cyan]; each command's --help has examples, "
        "and --json prints its result for machines."
    ),
    epilog=(
        "Exit codes: 0 done; 1 the gate or every scene failed; 2 bad input, said in one line; "
        "130 interrupted, what is finished is kept."
    ),
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _register() -> None:
    """Put every module's commands under their heading of `CONTENTS`."""
    commands = {
        command.name or str(getattr(command.callback, "__name__", "")): command
        for module in MODULES
        for command in module.commands.registered_commands
    }
    groups = {
        group.name: group for module in MODULES for group in module.commands.registered_groups
    }
    for heading, names in CONTENTS.items():
        for name in names:
            if name in groups:
                groups[name].rich_help_panel = heading
                app.registered_groups.append(groups.pop(name))
            else:
                commands[name].rich_help_panel = heading
                app.registered_commands.append(commands.pop(name))
    if left := [*commands, *groups]:
        raise LookupError(f"commands without a heading: {left}")


_register()


def check_python(version: tuple[int, int]) -> None:
    """Refuse a Python for which the simulator has no build.

    Raises
    ------
    InputError
        The version is above 3.11.
    """
    if version > (3, 11):
        raise InputError(
            f"Python {version[0]}.{version[1]} is too new: PyBullet has no wheel above 3.11; "
            "make a virtual environment with python3.11 and install there"
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit code."""
    try:
        check_python(sys.version_info[:2])
        given = sys.argv[1:] if arguments is None else list(arguments)
        code = app(given or ["--help"], prog_name="harness", standalone_mode=False)
        sys.stdout.flush()
    except InputError as error:
        return _fail(str(error), EXIT_BAD_INPUT)
    except typer.TyperException as error:
        return _fail(error.format_message(), EXIT_BAD_INPUT)
    except RunInterruptedError as error:
        return _fail(str(error), EXIT_INTERRUPTED)
    except KeyboardInterrupt:
        return _fail("interrupted", EXIT_INTERRUPTED)
    except OSError as error:
        return _fail_to_write(error)
    return EXIT_OK if code is None else int(code)


def _fail(message: str, code: int) -> int:
    print(f"harness: {' '.join(message.split())}", file=sys.stderr)
    return code


def _fail_to_write(error: OSError) -> int:
    """Say what the system refused, such as output to a full disk, and drop unwritten output."""
    try:
        sys.stdout.flush()
    except OSError:
        # Python flushes once more at exit, with a traceback and an exit code of its own.
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
    where = error.filename or "the output"
    return _fail(
        f"cannot read or write {where}: {error.strerror or error}; check the path and the disk",
        EXIT_BAD_INPUT,
    )
