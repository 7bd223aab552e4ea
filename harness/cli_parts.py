"""What the modules of the command line share."""

from __future__ import annotations

import json
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

EXIT_OK = 0
EXIT_FAILED = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130

UNBOUNDED_WIDTH = 160
"""Columns of a table that goes into a file or a pipe."""


def _whole_number(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"'{text}' is not a whole number; pass one such as 8") from None


def number_option(help_text: str, *names: str) -> Any:
    """Option for a whole number, which names the value that is none."""
    return typer.Option(*names, parser=_whole_number, metavar="N", help=help_text)


JsonOption = Annotated[
    bool, typer.Option("--json", help="Print one JSON object in place of the text.")
]
"""``--json``: the same result for machines."""


def print_json(result: object) -> None:
    """Print a result as JSON: dataclasses as objects, paths as text; NaN is refused."""
    print_line(json.dumps(result, default=_plain, indent=1, allow_nan=False))


def _plain(value: object) -> object:
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} cannot be printed as JSON")


def print_line(text: str) -> None:
    """Print a line that is not folded, for it holds paths."""
    stdout().print(text, highlight=False, soft_wrap=True, markup=False)


def stdout() -> Console:
    """Console for what a command is asked for: as wide as the terminal, or wide enough."""
    console = Console()
    if not console.is_terminal:
        console.width = UNBOUNDED_WIDTH
    return console
