"""The command `segmentation-report`."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import Annotated

import typer
from rich.console import Console

from harness.cli_parts import EXIT_OK, number_option, print_line, stdout
from harness.runs.progress import ConsoleProgress

commands = typer.Typer()

LEAST_WIDTH = 172
"""Columns that the report's widest table takes."""


@commands.command(
    name="segmentation-report",
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "Both networks on the test split:  [cyan]harness segmentation-report[/cyan]\n\n"
        "On your own meshes:  [cyan]harness segmentation-report --objects meshes/[/cyan]\n\n"
        "Your own segmenter:  "
        "[cyan]harness segmentation-report --segmenter python:tools.segment[/cyan]\n\n"
        "What the classifiers lose by it:  [cyan]harness segmentation-report --table 16[/cyan]\n\n"
        "Exit codes: 0 done, 2 bad input, 130 interrupted."
    ),
)
def segmentation_report(
    *,
    objects: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of meshes with a manifest.json.")
    ] = None,
    scenes: Annotated[
        int | None, number_option("Scenes of each class, so many single and so many cluttered.")
    ] = None,
    table: Annotated[
        int,
        number_option(
            "Scenes of mugs and of bowls on which every classifier is run with the true masks and "
            "with each segmenter's."
        ),
    ] = 0,
    segmenter: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="maskrcnn, maskrcnn_rgbd, oracle or python:module.function; again for more. By "
            "default the first two.",
        ),
    ] = None,
    of_class: Annotated[
        list[str] | None,
        typer.Option(
            "--class",
            metavar="NAME",
            help="Class of the targets; again for more. By default all that the objects have.",
        ),
    ] = None,
    seed: Annotated[int | None, number_option("Seed of the scenes.")] = None,
    json: Annotated[
        bool, typer.Option("--json", help="Print report.json in place of the tables.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="New folder, by default results/segmentation-TIME-HASH."),
    ] = None,
    workers: Annotated[
        int | None, number_option("Worker processes, by default one per core.")
    ] = None,
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="TOML, as for bench.")] = None,
) -> int:
    """Measure segmenters against the true masks: precision, recall, calibration, time."""
    from harness.segmentation.report import render_report
    from harness.segmentation.run import SEGMENTERS, SegmentationOptions, run_report

    progress = ConsoleProgress(Console(stderr=True), folder_name="report")
    result = run_report(
        SegmentationOptions(
            objects=objects,
            scenes=scenes,
            table=table,
            segmenters=tuple(segmenter or SEGMENTERS),
            classes=tuple(of_class or ()),
            seed=seed,
            workers=workers,
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
    console.print(render_report(result.report, result.loss))
    failed = f", {len(result.failures)} failed" if result.failures else ""
    print_line(
        f"{result.scenes} scenes{failed} in {result.seconds:.0f} s; written to {result.folder} "
        "(report.json, frames-NAME.png, reliability.png)"
    )
    return EXIT_OK
