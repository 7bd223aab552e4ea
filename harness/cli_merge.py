"""The command that joins shards."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import Annotated

import typer
from rich.console import Console

from harness.cli_bench import print_run
from harness.cli_parts import EXIT_FAILED, EXIT_OK, JsonOption, print_json, print_line
from harness.merge import merge_shards

commands = typer.Typer()


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "Two parts, on two machines:  [cyan]harness bench --shard 1/2 --out part1[/cyan]  and  "
        "[cyan]harness bench --shard 2/2 --out part2[/cyan]\n\n"
        "Then, anywhere:  [cyan]harness merge part1 part2 --out results/whole[/cyan]\n\n"
        "Exit codes: 0 done, 1 every scene failed, 2 bad input, 130 interrupted."
    )
)
def merge(
    shards: Annotated[
        list[Path],
        typer.Argument(metavar="SHARD", help="Folders of all shards, in any order."),
    ],
    *,
    out: Annotated[Path, typer.Option(metavar="RUN", help="Folder to write.")],
    as_json: JsonOption = False,
) -> int:
    """Join the shards of a run: the same files as a run in one piece, byte for byte."""
    result = merge_shards(shards, out=out)
    code = EXIT_FAILED if len(result.failures) == result.scenes else EXIT_OK
    if as_json:
        print_json(result)
        return code
    console = Console(stderr=True)
    for note in result.notes:
        console.print(note, style="yellow", highlight=False, soft_wrap=True, markup=False)
    print_run(result.folder, result.table)
    failed = f", {len(result.failures)} of them failed," if result.failures else ""
    print_line(
        f"{result.scenes} scenes of {result.shards} shards{failed} written to {result.folder}"
    )
    return code
