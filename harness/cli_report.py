"""The command that writes a run as one HTML file."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import Annotated

import typer
from rich.console import Console

from harness.cli_parts import EXIT_OK, JsonOption, print_json, print_line

commands = typer.Typer()


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "Into the run's folder, as report.html:  [cyan]harness report results/RUN[/cyan]\n\n"
        "With its differences to another run:  "
        "[cyan]harness report results/RUN --against results/baseline[/cyan]\n\n"
        "The file opens in any browser and needs no network. Exit codes: 0 done, 2 bad input."
    )
)
def report(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a finished run.")],
    *,
    against: Annotated[
        Path | None,
        typer.Option(metavar="RUN", help="A run of the same scenes; its values are subtracted."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The page, by default report.html in the run's folder."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Write a run as one HTML file: verdict, tables, curves, scenes, timings, provenance."""
    from harness.html_report.write import write_report

    console = Console(stderr=True)
    with console.status("reading") as status:
        found = write_report(
            run, against=against, out=out, progress=lambda step: status.update(step)
        )
    if as_json:
        print_json(found)
        return EXIT_OK
    print_line(found.verdict)
    for text in found.lacking:
        print_line(text)
    print_line(
        f"{found.scenes} scenes, {found.failed} failed, {found.missed} targets missed; "
        f"{found.bytes / 1e6:.1f} MB in {found.seconds:.0f} s, written to {found.file}"
    )
    return EXIT_OK
