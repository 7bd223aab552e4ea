"""The command line. Every command is also a plain function that returns a result object."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.progress import Progress as ProgressBar

from harness import (
    cli_bench,
    cli_completion,
    cli_data,
    cli_merge,
    cli_pictures,
    cli_segmentation,
    cli_study,
)
from harness.bench import RunInterruptedError
from harness.cli_parts import (
    EXIT_BAD_INPUT,
    EXIT_INTERRUPTED,
    EXIT_OK,
    number_option,
    print_line,
)
from harness.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

app = typer.Typer(
    name="harness",
    help="Benchmark of confidence scores in semantic maps, on simulated scenes with known meshes.",
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.registered_commands += cli_bench.commands.registered_commands


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
    seed: Annotated[int, number_option("Same seed: same files, byte for byte.")] = 0,
    count: Annotated[
        int, number_option("Meshes of each of the six categories.", "--count", "--per-category")
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
    print_line(f"{len(records)} meshes in {out}")
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
    seed: Annotated[int | None, number_option("Seed of the run.")] = None,
    objects: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of meshes with a manifest.json.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="By default results/render/ID.")
    ] = None,
    config: Annotated[Path | None, typer.Option(metavar="FILE", help="TOML, as for bench.")] = None,
) -> int:
    """Write a scene's images, depth, masks, its map in 3-D and its completed shapes."""
    from harness.render import RenderOptions, run_render

    pictures = run_render(
        RenderOptions(
            scene=scene, cluttered=cluttered, seed=seed, objects=objects, out=out, config=config
        )
    )
    for reason in pictures.uncompleted.values():
        print_line(reason)
    clouds = f" and {len(pictures.clouds)} completed clouds" if pictures.clouds else ""
    print_line(
        f"{len(pictures.files)} pictures{clouds} in {pictures.folder}; "
        f"all in one: {pictures.montage}"
    )
    return EXIT_OK


for part in (cli_merge, cli_study, cli_segmentation, cli_completion, cli_data, cli_pictures):
    app.registered_commands += part.commands.registered_commands


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
