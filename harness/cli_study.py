"""Commands that study runs: `compare`."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import Annotated

import typer
from rich.console import Group
from rich.text import Text

from harness.cli_parts import EXIT_OK, stdout
from harness.results import Comparison, compare_runs
from harness.table.brief import difference_grids
from harness.table.cells import INTERVALS, cell_label, object_count, scene_count

commands = typer.Typer()


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "Three views against one:  [cyan]harness compare results/VIEWS3 results/VIEWS1[/cyan]\n\n"
        "Across models:  "
        "[cyan]harness compare RUN_A RUN_B --model-a metric --model-b network[/cyan]\n\n"
        "Both runs must hold the same scenes: same seed, classes, objects and scene settings."
    )
)
def compare(
    run_a: Annotated[Path, typer.Argument(metavar="RUN_A", help="Folder of a finished run.")],
    run_b: Annotated[
        Path, typer.Argument(metavar="RUN_B", help="Folder of the run that is subtracted.")
    ],
    *,
    model_a: Annotated[str, typer.Option(metavar="NAME", help="Model of the first run.")] = (
        "metric"
    ),
    model_b: Annotated[str, typer.Option(metavar="NAME", help="Model of the second run.")] = (
        "metric"
    ),
) -> int:
    """Print what one run measures less another, paired by scene, with intervals over objects."""
    found = compare_runs(run_a, run_b, model_a=model_a, model_b=model_b)
    console = stdout()
    title = f"{model_a} of {run_a} less {model_b} of {run_b}"
    columns = [(cell_label(item), item) for item in found.differences]
    counts = "; ".join(
        f"{cell_label(item)}: {scene_count(item)}, {object_count(item)}"
        for item in found.differences
    )
    console.print(
        Group(
            Text(title, style="bold"),
            Text(counts),
            Text(),
            *difference_grids(columns, width=console.width),
            Text(),
            Text(_about(found), style="dim"),
        )
    )
    return EXIT_OK


def _about(found: Comparison) -> str:
    """Say what was compared and what was not."""
    lines = [f"Differences [95 % interval] are paired by scene. {INTERVALS}"]
    lines += [
        f"{key}: {ours} in the first, {theirs} in the second"
        for key, ours, theirs in found.settings
    ]
    lines += [f"Left out, not the same scene in both runs: {text}" for text in found.unlike]
    if found.only_first or found.only_second:
        lines.append(
            f"Scenes of one run alone, left out: {found.only_first} of the first, "
            f"{found.only_second} of the second."
        )
    return "\n".join(lines)
