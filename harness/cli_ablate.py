"""The command `ablate`."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from harness.ablation.run import RECORDS, SUMMARY, AblateOptions, plan_ablation, run_ablation
from harness.ablation.spec import ready_grids, short_name
from harness.ablation.summary import METRICS
from harness.cli_parts import (
    EXIT_FAILED,
    EXIT_OK,
    JsonOption,
    number_option,
    print_json,
    print_line,
    stdout,
)
from harness.engines.choice import EngineName, make_engine
from harness.errors import InputError
from harness.runs.progress import ConsoleProgress
from harness.statistics import ALPHA
from harness.table.cells import compact
from harness.table.summary import MODEL_ORDER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.ablation.run import Ablation
    from harness.ablation.summary import Entry

commands = typer.Typer()


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "What comes with the project:  [cyan]harness ablate --list[/cyan]\n\n"
        "With and without shape completion, as in the seed's Table III:  "
        "[cyan]harness ablate table3[/cyan]\n\n"
        "What each further view is worth:  [cyan]harness ablate views --scenes 16[/cyan]\n\n"
        "Your own grid:  [cyan]harness ablate resolution.toml --metric precision[/cyan]\n\n"
        "A grid's file has \\[base], the tables of a configuration; \\[grid], a list of values for "
        "any key, such as scenes.views = \\[1, 2, 3]; and \\[choices.NAME.STEP] for steps that set "
        "several keys. What cells share is computed once; the same command continues what was "
        "stopped, and every cell is a run that `harness show`, `compare` and `report` read.\n\n"
        "Exit codes: 0 done, 1 every scene failed, 2 bad input, 130 interrupted."
    )
)
def ablate(
    file: Annotated[
        str | None, typer.Argument(metavar="FILE", help="A grid's TOML, or a ready one's name.")
    ] = None,
    *,
    ready: Annotated[bool, typer.Option("--list", help="List the ready grids.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="List the cells; compute nothing.")
    ] = False,
    scenes: Annotated[
        int | None, number_option("Scenes of each class, in place of the grid's.")
    ] = None,
    seed: Annotated[int | None, number_option("Seed, in place of the grid's.")] = None,
    workers: Annotated[
        int | None, number_option("Worker processes, by default one per core.")
    ] = None,
    engine: Annotated[
        EngineName, typer.Option(help="Where to compute: this machine or a Ray cluster.")
    ] = "local",
    address: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="Of the Ray cluster.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="By default results/ablations/NAME; one in it continues."),
    ] = None,
    keep_old: Annotated[
        bool, typer.Option("--keep-old", help="Take what other code computed as it is.")
    ] = False,
    metric: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help=f"What to print, again for more: {', '.join(METRICS)}."),
    ] = None,
    json: JsonOption = False,
) -> int:
    """Vary any settings over a grid; what cells share is computed once."""
    if ready or file is None:
        grids = ready_grids()
        if json:
            print_json(grids)
        for name, about in grids.items() if not json else ():
            print_line(f"{name:16} {about}")
        return EXIT_OK
    asked = metric or ["precision", "accuracy"]
    if odd := next((name for name in asked if name not in METRICS), None):
        raise InputError(f"--metric {odd}: is none; there are {', '.join(METRICS)}")
    options = AblateOptions(file=file, scenes=scenes, seed=seed, out=out, keep_old=keep_old)
    if dry_run:
        cells = plan_ablation(options)
        if json:
            print_json([{"cell": cell.index, **cell.labels} for cell in cells])
        for cell in cells if not json else ():
            print_line(f"{cell.index:4} {cell} ({cell.config.short_hash()})")
        return EXIT_OK
    found = run_ablation(
        options,
        engine=make_engine(engine, address=address, workers=workers),
        progress=ConsoleProgress(Console(stderr=True)),
    )
    if json:
        print_json(_as_json(found))
    else:
        stdout().print(Group(*_tables(found, asked)))
        print_line(_about(found))
    return EXIT_FAILED if found.all_failed else EXIT_OK


def _as_json(found: Ablation) -> dict[str, object]:
    return {
        "folder": str(found.folder),
        "cells": [
            {"cell": cell.index, "hash": cell.config.short_hash(), **cell.labels}
            for cell in found.cells
        ],
        "scenes": found.scenes,
        "computed": found.computed,
        "stages": found.stages,
        "failures": found.failures,
        "seconds": found.seconds,
        "entries": found.summary.entries,
    }


def _tables(found: Ablation, metrics: Sequence[str]) -> list[Table | Text]:
    """Lay out a table for every metric, class and test set: a row per cell, a column per model."""
    made: list[Table | Text] = []
    for name in metrics:
        entries = [item for item in found.summary.entries if item.metric == name]
        for category, test_set in dict.fromkeys(item.group[:2] for item in entries):
            group = [item for item in entries if item.group[:2] == (category, test_set)]
            made += [
                Text(f"{name.replace('_', ' ')}: {category}, {test_set}", style="bold"),
                _table(found, group),
                Text(),
            ]
    return made


def _table(found: Ablation, group: Sequence[Entry]) -> Table:
    present = {item.group[2] for item in group}
    models = [model for model in MODEL_ORDER if model in present]
    models += sorted(present - set(models))
    axes = list(found.cells[0].labels)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="")
    for axis in axes:
        table.add_column(short_name(axis))
    for model in models:
        table.add_column(model.replace("_", " "), justify="right", no_wrap=True)
    by_place = {(item.cell, item.group[2]): item for item in group}
    for cell in found.cells:
        shown = [by_place.get((cell.index, model)) for model in models]
        if any(shown):
            steps = [str(cell.labels[axis]) for axis in axes]
            table.add_row(*steps, *(_entry(item) for item in shown))
    return table


def _entry(item: Entry | None) -> str:
    if item is None:
        return ""
    marked = item.q_value is not None and item.q_value <= ALPHA
    return compact(item.estimate.mean) + ("*" if marked else " ")


def _about(found: Ablation) -> str:
    failed = (
        f", {len(found.failures)} failed (see {found.folder / 'logs'})" if found.failures else ""
    )
    stages = ", ".join(f"{stage} {count}" for stage, count in found.stages.items()) or "none"
    return (
        f"Means over scenes; * differs from a table's first row (paired by scene, objects change "
        f"sign together, q <= {ALPHA:g} by Benjamini-Hochberg over the ablation). Where no * "
        f"stands, a difference was not detected; {SUMMARY} says how great a lone one would have to "
        "be.\n"
        f"{found.scenes} scenes of {len(found.cells)} cells, {found.computed} of them computed now"
        f"{failed}, in {found.seconds:.0f} s; stages computed: {stages}.\n"
        f"Written to {found.folder} ({RECORDS}, {SUMMARY}; each cell is a run under cells)"
    )
