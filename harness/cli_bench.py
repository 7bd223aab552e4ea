"""Commands that run the benchmark and show its table: `bench` and `show`."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from harness.bench import QUICK_SCENES, BenchOptions, Wiring, run_bench
from harness.cli_parts import (
    EXIT_FAILED,
    EXIT_OK,
    JsonOption,
    number_option,
    print_json,
    print_line,
    stdout,
)
from harness.engines.choice import EngineName  # noqa: TC001 - as above
from harness.results import is_cluttered, show_confusion, show_run
from harness.runs.progress import ConsoleProgress
from harness.runs.shards import Shard
from harness.table.brief import render_brief
from harness.table.confusion import render_confusion
from harness.table.terminal import render_full

if TYPE_CHECKING:
    from harness.table.summary import Table

commands = typer.Typer()

wiring = Wiring()
"""What `bench` runs on."""


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "A first look, in about two minutes:  [cyan]harness bench --quick[/cyan]\n\n"
        "Continue a run that was stopped:  [cyan]harness bench --out results/RUN[/cyan]\n\n"
        "On your own meshes:  [cyan]harness bench --objects meshes/ --scenes 32[/cyan]\n\n"
        "With other settings:  [cyan]harness bench --config wide.toml[/cyan]\n\n"
        "On a Ray cluster:  "
        "[cyan]harness bench --engine ray --address HOST:6379 --out results/RUN[/cyan]\n\n"
        "As an array of batch jobs:  "
        "[cyan]harness bench --shard 3/8 --out part3[/cyan], then [cyan]harness merge[/cyan]\n\n"
        "Exit codes: 0 done, 1 every scene failed, 2 bad input, 130 interrupted."
    )
)
def bench(
    *,
    quick: Annotated[
        bool, typer.Option("--quick", help=f"{QUICK_SCENES} scenes of each class instead of 16.")
    ] = False,
    scenes: Annotated[
        int | None, number_option("Scenes of each class; the first of a longer run's.")
    ] = None,
    seed: Annotated[
        int | None, number_option("Same seed, same configuration: same records, bit for bit.")
    ] = None,
    workers: Annotated[
        int | None,
        number_option(
            "Worker processes of one thread each, by default one per core; on Ray most tasks at "
            "a time, by default as many as keep it busy. No result depends on it."
        ),
    ] = None,
    objects: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of meshes with a manifest.json (path, category), z up."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="RUN",
            help="Folder to write, by default results/TIME-HASH; a run in it continues.",
        ),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="TOML with \\[run], \\[scenes], \\[protocol], \\[pipeline]."
        ),
    ] = None,
    cluttered: Annotated[
        bool, typer.Option("--cluttered", help="Put other objects around the targets.")
    ] = False,
    engine: Annotated[
        EngineName, typer.Option(help="Compute on this machine, or on a Ray cluster.")
    ] = "local",
    address: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help=(
                "The Ray cluster: auto (the default), HOST:PORT or ray://HOST:PORT; its nodes "
                "need this checkout, its wheel and its virtual environment."
            ),
        ),
    ] = None,
    shard: Annotated[
        str | None,
        typer.Option(metavar="I/N", help="Compute the I-th of N parts; `harness merge` joins."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Render scenes, map and classify them, score against the true meshes, print the table."""
    result = run_bench(
        BenchOptions(
            quick=quick,
            scenes=scenes,
            seed=seed,
            workers=workers,
            objects=objects,
            cluttered=cluttered,
            out=out,
            config=config,
            engine=engine,
            address=address,
            shard=None if shard is None else Shard.parse(shard),
        ),
        progress=ConsoleProgress(Console(stderr=True)),
        wiring=wiring,
    )
    code = EXIT_FAILED if result.all_failed else EXIT_OK
    if as_json:
        print_json(result)
        return code
    print_run(result.folder, result.table)
    failed = ""
    if result.failures:
        failed = f", {len(result.failures)} failed (tracebacks: {result.folder / 'logs'}),"
    print_line(
        f"{result.scenes} scenes{failed} in {result.seconds:.0f} s; written to {result.folder} "
        "(table.md, table.csv and table.tex have all of it; records.parquet, confusion.parquet)"
    )
    return code


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "A run's table again:  [cyan]harness show results/RUN[/cyan]\n\n"
        "With intervals, every metric and tolerance:  [cyan]harness show results/RUN --all[/cyan]"
    )
)
def show(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a finished run.")],
    *,
    everything: Annotated[
        bool, typer.Option("--all", help="Intervals, all metrics and all tolerances.")
    ] = False,
    confusion: Annotated[
        bool,
        typer.Option(
            "--confusion",
            help="Which categories are taken for which; always shown of cluttered scenes.",
        ),
    ] = False,
    json: JsonOption = False,
) -> int:
    """Print a run's table again."""
    if json:
        print_json({"table": show_run(run), "confusion": show_confusion(run)})
        return EXIT_OK
    print_run(run, show_run(run), everything=everything, confusion=confusion)
    return EXIT_OK


def print_run(
    folder: Path, table: Table, *, everything: bool = False, confusion: bool = False
) -> None:
    """Print a finished run's table, and its confusion where that tells something."""
    console = stdout()
    render = render_full if everything else render_brief
    console.print(render(table, width=console.width))
    if confusion or is_cluttered(folder):
        console.print(render_confusion(show_confusion(folder)))
