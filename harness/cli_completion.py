"""The command `completion-report`."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import Annotated

import typer
from rich.console import Console

from harness.cli_parts import EXIT_OK, number_option, print_line, stdout
from harness.runs.progress import ConsoleProgress

commands = typer.Typer()

LEAST_WIDTH = 124
"""Columns that the report's widest table takes."""


@commands.command(
    name="completion-report",
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "Both completers on the test split:  [cyan]harness completion-report[/cyan]\n\n"
        "On your own meshes:  [cyan]harness completion-report --objects meshes/[/cyan]\n\n"
        "Your own completer:  "
        "[cyan]harness completion-report --completer python:tools.complete[/cyan]\n\n"
        "What several views gain:  [cyan]harness completion-report --views 3[/cyan]\n\n"
        "Exit codes: 0 done, 2 bad input, 130 interrupted."
    ),
)
def completion_report(
    *,
    objects: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of meshes with a manifest.json.")
    ] = None,
    scenes: Annotated[
        int | None, number_option("Scenes of each class; the first of a benchmark's.")
    ] = None,
    views: Annotated[int, number_option("Camera poses of a scene.")] = 1,
    completer: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="cloud, centersnap or python:module.function; again for more. By default the "
            "first two; each runs with and without refinement.",
        ),
    ] = None,
    of_class: Annotated[
        list[str] | None,
        typer.Option("--class", metavar="NAME", help="Class of the targets; again for more."),
    ] = None,
    seed: Annotated[int | None, number_option("Seed of the scenes.")] = None,
    cluttered: Annotated[
        bool, typer.Option("--cluttered", help="Put other objects around the targets.")
    ] = False,
    json: Annotated[
        bool, typer.Option("--json", help="Print report.json in place of the tables.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="New folder, by default results/completion-TIME-HASH."),
    ] = None,
    workers: Annotated[
        int | None, number_option("Worker processes, by default one per core.")
    ] = None,
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="TOML, as for bench.")] = None,
) -> int:
    """Measure completed shapes against the true meshes, seen and unseen, beside baselines."""
    from harness.completion.report import render_report
    from harness.completion.run import COMPLETERS, CompletionOptions, run_report

    progress = ConsoleProgress(Console(stderr=True), folder_name="report")
    result = run_report(
        CompletionOptions(
            objects=objects,
            scenes=scenes,
            views=views,
            completers=tuple(completer or COMPLETERS),
            classes=tuple(of_class or ()),
            seed=seed,
            workers=workers,
            cluttered=cluttered,
            out=out,
            config=config,
        ),
        progress=progress,
    )
    if json:
        typer.echo(result.text, nl=False)
        return EXIT_OK
    console = stdout()
    # A narrower terminal folds lines; a table squeezed into it would cut numbers.
    console.width = max(console.width, LEAST_WIDTH)
    console.print(render_report(result.report))
    failed = f", {len(result.failures)} failed" if result.failures else ""
    print_line(
        f"{result.scenes} scenes{failed} in {result.seconds:.0f} s; written to {result.folder} "
        "(report.json, sheet.png, pictures)"
    )
    return EXIT_OK
