"""Commands on how far confidences can be trusted: `calibration` and `threshold`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

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

commands = typer.Typer()

LEAST_WIDTH = 110
"""Columns that the widest table takes."""

SPLITS = 200
"""Random halves of ``--validate``."""

Run = Annotated[
    Path, typer.Argument(metavar="RUN", help="Folder of a finished run with recordings.")
]
Tolerance = Annotated[
    float | None,
    typer.Option(
        metavar="METRES",
        help="Distance within which a point lies on the mesh; by default the one the run reports.",
    ),
]
Classes = Annotated[
    list[str] | None,
    typer.Option("--class", metavar="NAME", help="Class of the targets; again for more."),
]


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "All scores of all models:  [cyan]harness calibration results/RUN[/cyan]\n\n"
        "One model, more strictly:  "
        "[cyan]harness calibration results/RUN --model metric --tolerance-m 0.0025[/cyan]\n\n"
        "Numbers, diagrams and curves as files:  "
        "[cyan]harness calibration results/RUN --out calibration/[/cyan]\n\n"
        "Exit codes: 0 done, 2 bad input."
    )
)
def calibration(
    run: Run,
    *,
    model: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Model; again for more.")
    ] = None,
    of_class: Classes = None,
    completion: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="Test set: none for the box, or a completion's; again for more."
        ),
    ] = None,
    tolerance_m: Tolerance = None,
    as_json: JsonOption = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write calibration.json and calibration.csv there."),
    ] = None,
) -> int:
    """Hold every score against the truth: as a probability, and as a ranking."""
    from harness.calibration import output, summarise_run
    from harness.calibration.text import render_calibration
    from harness.runs.directory import RunDirectory

    found = summarise_run(
        RunDirectory(run),
        models=model or (),
        classes=of_class or (),
        completions=completion or (),
        tolerance_m=tolerance_m,
    )
    files = () if out is None else output.write_calibration(found, out)
    if as_json:
        print_json(output.as_json(found))
        return EXIT_OK
    console = stdout()
    console.width = max(console.width, LEAST_WIDTH)
    console.print(render_calibration(found))
    if files:
        print_line(f"written to {' and '.join(map(str, files))}")
    return EXIT_OK


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "Where 95 % of kept points lie on the mesh:  [cyan]harness threshold results/RUN[/cyan]\n\n"
        "With probability 0.9, for mugs:  [cyan]harness threshold results/RUN --class mug "
        "--keep-precision 0.9 --delta 0.1[/cyan]\n\n"
        "Chosen on one run, judged on another:  "
        "[cyan]harness threshold results/VALIDATION --judge results/TEST[/cyan]\n\n"
        "Choose on a run whose objects nothing was trained, tuned or tested on.\n\n"
        "Exit codes: 0 done, 1 no threshold can be guaranteed, 2 bad input."
    )
)
def threshold(
    run: Run,
    *,
    keep_precision: Annotated[
        float,
        typer.Option(metavar="SHARE", help="Share of the kept points that shall lie on the mesh."),
    ] = 0.95,
    delta: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE",
            help="Guarantee it with probability 1 - delta, not in expectation.",
        ),
    ] = None,
    model: Annotated[
        str, typer.Option(metavar="NAME", help="Model whose confidence is cut.")
    ] = "metric",
    of_class: Classes = None,
    completion: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Test set: a completion's, by default the run's, or none for the box.",
        ),
    ] = None,
    tolerance_m: Tolerance = None,
    validate: Annotated[
        bool,
        typer.Option(
            "--validate", help="Choose on random halves of the objects, check on the others."
        ),
    ] = False,
    splits: Annotated[
        int | None, number_option(f"Random halves of --validate, by default {SPLITS}.")
    ] = None,
    judge: Annotated[
        Path | None,
        typer.Option(metavar="RUN", help="Judge the threshold on a run of other objects."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Choose the lowest confidence above which points lie on the mesh, with a guarantee."""
    from harness.calibration.choosing import ThresholdOptions, find_threshold
    from harness.calibration.text import render_threshold
    from harness.calibration.threshold import Goal
    from harness.runs.directory import RunDirectory

    if splits is not None and not validate:
        raise InputError(f"--splits {splits} goes with --validate; pass that too, or leave it out")
    found = find_threshold(
        RunDirectory(run),
        ThresholdOptions(
            goal=Goal(keep_precision=keep_precision, delta=delta),
            model=model,
            completion=completion,
            classes=tuple(of_class or ()),
            tolerance_m=tolerance_m,
            splits=(SPLITS if splits is None else splits) if validate else None,
            judge=None if judge is None else RunDirectory(judge),
        ),
    )
    if as_json:
        print_json(found)
    else:
        console = stdout()
        console.width = max(console.width, LEAST_WIDTH)
        console.print(render_threshold(found))
    return EXIT_OK if found.choice.threshold is not None else EXIT_FAILED
