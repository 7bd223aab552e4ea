"""The command line. Every command is also a plain function that returns a result object."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console
from rich.progress import Progress as ProgressBar

from harness.bench import (
    QUICK_SCENES,
    BenchOptions,
    RunInterruptedError,
    Wiring,
    run_bench,
    show_run,
)
from harness.errors import InputError
from harness.runs.progress import ConsoleProgress
from harness.table.terminal import render_terminal

if TYPE_CHECKING:
    from collections.abc import Sequence

EXIT_OK = 0
EXIT_FAILED = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130

UNBOUNDED_WIDTH = 160
"""Columns of a table that goes into a file or a pipe."""

app = typer.Typer(
    name="harness",
    help="Benchmark of confidence scores in semantic maps, on simulated scenes with known meshes.",
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

wiring = Wiring()
"""What the commands run on."""


def _whole_number(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise typer.BadParameter(f"'{text}' is not a whole number; pass one such as 8") from None


def _number(help_text: str, *names: str) -> Any:
    """Option for a whole number, which names the value that is none."""
    return typer.Option(*names, parser=_whole_number, metavar="N", help=help_text)


@app.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "A first look, in about a minute:  [cyan]harness bench --quick[/cyan]\n\n"
        "Continue a run that was stopped:  [cyan]harness bench --out results/RUN[/cyan]\n\n"
        "On your own meshes:  [cyan]harness bench --objects meshes/ --scenes 32[/cyan]\n\n"
        "With other settings:  [cyan]harness bench --config wide.toml[/cyan]\n\n"
        "Exit codes: 0 done, 1 every scene failed, 2 bad input, 130 interrupted."
    )
)
def bench(
    *,
    quick: Annotated[
        bool, typer.Option("--quick", help=f"{QUICK_SCENES} scenes of each class instead of 16.")
    ] = False,
    scenes: Annotated[
        int | None, _number("Scenes of each class; the first of a longer run's.")
    ] = None,
    seed: Annotated[
        int | None, _number("Same seed, same configuration: same records, bit for bit.")
    ] = None,
    workers: Annotated[
        int | None, _number("Worker processes, by default one per core; no result depends on it.")
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
        ),
        progress=ConsoleProgress(Console(stderr=True)),
        wiring=wiring,
    )
    console = _stdout()
    console.print(render_terminal(result.table, width=console.width))
    failed = ""
    if result.failures:
        failed = f", {len(result.failures)} failed (tracebacks: {result.folder / 'logs'}),"
    console.print(
        f"{result.scenes} scenes{failed} in {result.seconds:.0f} s; written to {result.folder} "
        f"(records.parquet, table.md, table.csv, table.tex)",
        highlight=False,
        soft_wrap=True,
        markup=False,
    )
    return EXIT_FAILED if result.all_failed else EXIT_OK


@app.command(epilog="Example:  [cyan]harness show results/RUN[/cyan]")
def show(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a finished run.")],
) -> int:
    """Print a run's table again."""
    table = show_run(run)
    console = _stdout()
    console.print(render_terminal(table, width=console.width))
    return EXIT_OK


@app.command(
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
    seed: Annotated[int, _number("Same seed: same files, byte for byte.")] = 0,
    count: Annotated[
        int, _number("Meshes of each of the six categories.", "--count", "--per-category")
    ] = 10,
    benchmark: Annotated[
        bool,
        typer.Option("--benchmark", help="The benchmark set instead: its split, seed and counts."),
    ] = False,
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
    _stdout().print(f"{len(records)} meshes in {out}", highlight=False, markup=False)
    return EXIT_OK


@app.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "A scene of the default benchmark:  [cyan]harness render --scene mug-0003[/cyan]\n\n"
        "A cluttered one:  [cyan]harness render --scene bowl-0001 --cluttered[/cyan]\n\n"
        "As a run saw it:  "
        "[cyan]harness render --scene mug-0000 --config results/RUN/config.toml[/cyan]"
    )
)
def render(
    *,
    scene: Annotated[
        str,
        typer.Option(
            metavar="ID", help="Class and number of a scene of the run, such as mug-0003."
        ),
    ],
    cluttered: Annotated[
        bool, typer.Option("--cluttered", help="Put other objects around the target.")
    ] = False,
    seed: Annotated[int | None, _number("Seed of the run.")] = None,
    objects: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of meshes with a manifest.json.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="By default results/render/ID.")
    ] = None,
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="TOML, as for bench.")] = None,
) -> int:
    """Write a scene's images, depth, masks and its map in 3-D as PNG."""
    from harness.render import RenderOptions, run_render

    pictures = run_render(
        RenderOptions(
            scene=scene, cluttered=cluttered, seed=seed, objects=objects, out=out, config=config
        )
    )
    _stdout().print(
        f"{len(pictures.files)} pictures in {pictures.folder}; all in one: {pictures.montage}",
        highlight=False,
        soft_wrap=True,
        markup=False,
    )
    return EXIT_OK


@app.command(
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
    scenes: Annotated[int | None, _number("Scenes of each class.")] = None,
    seed: Annotated[int | None, _number("Seed of the run.")] = None,
    objects: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of meshes with a manifest.json.")
    ] = None,
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="TOML, as for bench.")] = None,
    cluttered: Annotated[
        bool, typer.Option("--cluttered", help="Put other objects around the targets.")
    ] = False,
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
    if result.all_failed:
        _line(f"none of {result.scenes} scenes could be simulated; nothing was written")
        return EXIT_FAILED
    failed = f" ({len(result.failures)} could not be simulated)" if result.failures else ""
    written = result.scenes - len(result.failures)
    _line(f"{written} scenes{failed} in {result.seconds:.0f} s; written to {result.folder}")
    return EXIT_OK


@app.command(
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
        int | None, _number("Seed of foreign scenes; simulated ones keep theirs.")
    ] = None,
    workers: Annotated[int | None, _number("Worker processes, by default one per core.")] = None,
    category: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Category of the objects that the dataset gives none."),
    ] = None,
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
    console = _stdout()
    if result.table.rows:
        console.print(render_terminal(result.table, width=console.width))
    mapped, skipped, failed = map(result.count, ("mapped", "skipped", "failed"))
    _line(
        f"{result.scored} targets scored, {len(result.failures) + failed} failed; without scores: "
        f"{mapped} scenes mapped, {skipped} skipped; in {result.seconds:.0f} s; "
        f"written to {result.folder}"
    )
    return EXIT_FAILED if result.nothing_ran else EXIT_OK


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


def _line(text: str) -> None:
    _stdout().print(text, highlight=False, soft_wrap=True, markup=False)


def _stdout() -> Console:
    console = Console()
    if not console.is_terminal:
        console.width = UNBOUNDED_WIDTH
    return console
