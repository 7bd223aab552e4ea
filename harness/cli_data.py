"""Commands on data: `assets`, `export` and `run`."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import Annotated, Literal

import typer
from rich.console import Console
from rich.progress import Progress as ProgressBar

from harness.cli_parts import (
    EXIT_FAILED,
    EXIT_OK,
    JsonOption,
    number_option,
    print_json,
    print_line,
    stdout,
)
from harness.errors import InputError
from harness.runs.progress import ConsoleProgress
from harness.table.brief import render_brief

commands = typer.Typer()


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "Meshes to train on:  [cyan]harness assets --out meshes --count 200[/cyan]\n\n"
        "The benchmark set again:  [cyan]harness assets --out assets --benchmark[/cyan]"
    )
)
def assets(
    *,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder to write.")],
    split: Annotated[
        Literal["train", "validation", "test"],
        typer.Option(help="Splits never share a parameter draw."),
    ] = "train",
    seed: Annotated[int, number_option("Same seed: same files, byte for byte.")] = 0,
    count: Annotated[
        int, number_option("Meshes of each of the six categories.", "--count", "--per-category")
    ] = 10,
    benchmark: Annotated[
        bool,
        typer.Option("--benchmark", help="The benchmark set instead: its split, seed and counts."),
    ] = False,
    json: JsonOption = False,
) -> int:
    """Generate watertight meshes in metres, with a manifest that `bench --objects` reads."""
    from harness.assets import generate_assets

    console = Console(stderr=True)
    with ProgressBar(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("meshes")
        try:
            records = generate_assets(
                out,
                split=split,
                seed=seed,
                per_category=count,
                benchmark=benchmark,
                progress=lambda step: bar.update(task, completed=step.done, total=step.total),
            )
        except (ValueError, OSError) as error:
            raise InputError(str(error)) from error
    if json:
        print_json({"folder": out, "meshes": len(records)})
    else:
        print_line(f"{len(records)} meshes in {out}")
    return EXIT_OK


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "The scenes of the default benchmark:  [cyan]harness export --out data/tabletop[/cyan]\n\n"
        "The records they give:  [cyan]harness run data/tabletop[/cyan]\n\n"
        "Exit codes: 0 done, 1 no scene could be simulated, 2 bad input, 130 interrupted."
    )
)
def export(
    *,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Root of the new dataset.")],
    scenes: Annotated[int | None, number_option("Scenes of each class.")] = None,
    seed: Annotated[int | None, number_option("Seed of the run.")] = None,
    objects: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of meshes with a manifest.json.")
    ] = None,
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="TOML, as for bench.")] = None,
    cluttered: Annotated[
        bool, typer.Option("--cluttered", help="Put other objects around the targets.")
    ] = False,
    json: JsonOption = False,
) -> int:
    """Write a run's scenes as a BOP dataset, from which `run` gets the same records."""
    from harness.dataset_export import ExportOptions, run_export

    progress = ConsoleProgress(Console(stderr=True), folder_name="dataset")
    result = run_export(
        ExportOptions(
            out=out, scenes=scenes, seed=seed, objects=objects, config=config, cluttered=cluttered
        ),
        progress=progress,
    )
    for note in result.notes:
        progress.note(note)
    if json:
        print_json(result)
        return EXIT_FAILED if result.all_failed else EXIT_OK
    if result.all_failed:
        print_line(f"none of {result.scenes} scenes could be simulated; nothing was written")
        return EXIT_FAILED
    failed = f" ({len(result.failures)} could not be simulated)" if result.failures else ""
    written = result.scenes - len(result.failures)
    print_line(f"{written} scenes{failed} in {result.seconds:.0f} s; written to {result.folder}")
    return EXIT_OK


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "What `harness export` wrote:  [cyan]harness run data/tabletop[/cyan]\n\n"
        "One split of a foreign dataset:  [cyan]harness run ycbv/test --config wide.toml[/cyan]\n\n"
        "Masks without a category:  [cyan]harness run mugs --category mug[/cyan]\n\n"
        "Categories are read from the key `category` of models_info.json.\n\n"
        "Exit codes: 0 done, 1 no scene could be run, 2 bad input, 130 interrupted."
    )
)
def run(
    dataset: Annotated[
        Path, typer.Argument(metavar="DATASET", help="Root of a BOP dataset or of one split.")
    ],
    *,
    out: Annotated[
        Path | None,
        typer.Option(metavar="RUN", help="Folder to write, by default results/TIME-HASH."),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="TOML, as for bench; by default the dataset's own."),
    ] = None,
    seed: Annotated[
        int | None, number_option("Seed of foreign scenes; simulated ones keep theirs.")
    ] = None,
    workers: Annotated[
        int | None, number_option("Worker processes, by default one per core.")
    ] = None,
    category: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Category of the objects that the dataset gives none."),
    ] = None,
    json: JsonOption = False,
) -> int:
    """Map, classify and score a BOP dataset; what has no truth is mapped without scores."""
    from harness.dataset_run import DatasetOptions, run_dataset

    progress = ConsoleProgress(Console(stderr=True))
    result = run_dataset(
        DatasetOptions(
            dataset=dataset, out=out, config=config, seed=seed, workers=workers, category=category
        ),
        progress=progress,
    )
    for item in result.unscored:
        progress.note(f"{item.scene_id} {item.outcome}: {item.reason}")
    if json:
        print_json(result)
        return EXIT_FAILED if result.nothing_ran else EXIT_OK
    console = stdout()
    if result.table.rows:
        console.print(render_brief(result.table, width=console.width))
    mapped, skipped, failed = map(result.count, ("mapped", "skipped", "failed"))
    print_line(
        f"{result.scored} targets scored, {len(result.failures) + failed} failed; without scores: "
        f"{mapped} scenes mapped, {skipped} skipped; in {result.seconds:.0f} s; "
        f"written to {result.folder}"
    )
    return EXIT_FAILED if result.nothing_ran else EXIT_OK
