"""The command `training-pictures`."""

from __future__ import annotations

import shlex
from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress as ProgressBar,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from harness.cli_parts import (
    EXIT_INTERRUPTED,
    EXIT_OK,
    JsonOption,
    number_option,
    print_json,
    print_line,
)
from harness.errors import InputError

commands = typer.Typer()

# Elsewhere than on a terminal, a line each time this many more percent are done.
LINE_PERCENT = 5


@commands.command(
    name="training-pictures",
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "To train on:  [cyan]harness training-pictures --objects data/meshes/train "
        "--out data/pictures/train --count 16000[/cyan]\n\n"
        "The same again continues what was stopped.\n\n"
        "Exit codes: 0 done, 2 bad input, 130 interrupted."
    ),
)
def training_pictures(
    *,
    objects: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder of meshes with a manifest.json.")
    ],
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder to write; one that was begun continues.")
    ],
    count: Annotated[int, number_option("Number of pictures.")],
    seed: Annotated[int, number_option("Same seed, same meshes: same bytes.")] = 0,
    workers: Annotated[
        int | None,
        number_option("Worker processes, by default one per core; no byte depends on it."),
    ] = None,
    json: JsonOption = False,
) -> int:
    """Render pictures with true masks, of random looks, to train the segmentation network on."""
    try:
        from harness.training_pictures import PictureOptions, Step, make_pictures
    except ModuleNotFoundError as error:
        if error.name != "safetensors":
            raise
        raise InputError(
            "package 'safetensors' is not installed; `pip install 'credence[train]'` has it"
        ) from error

    console = Console(stderr=True)
    bar = ProgressBar(
        TextColumn("[bold]pictures[/bold]"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("ETA"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        speed_estimate_period=600,
        disable=not console.is_terminal,
    )
    task = bar.add_task("", total=count)
    said = 0

    def hear(step: Step) -> None:
        nonlocal said
        bar.update(task, completed=step.done, total=step.total)
        percent = 100 * step.done // step.total
        if not console.is_terminal and percent >= said + LINE_PERCENT:
            said = percent
            console.print(f"{step.done}/{step.total} pictures", highlight=False)

    options = PictureOptions(objects=objects, out=out, count=count, seed=seed, workers=workers)
    try:
        with bar:
            result = make_pictures(options, progress=hear)
    except KeyboardInterrupt:
        resume = shlex.join(options.command())
        console.print(
            f"harness: interrupted: whole shards are kept; continue with `{resume}`",
            highlight=False,
            markup=False,
            soft_wrap=True,
        )
        return EXIT_INTERRUPTED
    if json:
        print_json(result)
        return EXIT_OK
    for name, why in result.repaired.items():
        print_line(f"{name} was made again: {why}")
    print_line(
        f"{result.made} pictures in {result.seconds:.0f} s, {result.kept} were there; "
        f"written to {result.folder}"
    )
    return EXIT_OK
