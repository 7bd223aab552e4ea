"""Commands that study models: `compare` and `tune`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self

import typer
from rich.console import Console, Group
from rich.progress import Progress as ProgressBar, TaskID
from rich.table import Table
from rich.text import Text

from harness.cli_parts import (
    EXIT_OK,
    JsonOption,
    number_option,
    print_json,
    print_line,
    stdout,
)
from harness.results import Comparison, compare_runs
from harness.table.cells import INTERVALS, TESTS, cell_label, object_count, scene_count
from harness.table.contrasts import difference_lines
from harness.table.summary import MODEL_ORDER

if TYPE_CHECKING:
    from harness.tuning.run import Step, Tuned

commands = typer.Typer()


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "Three views against one:  [cyan]harness compare results/VIEWS3 results/VIEWS1[/cyan]\n\n"
        "Across models:  "
        "[cyan]harness compare RUN_A RUN_B --model-a metric --model-b network[/cyan]\n\n"
        "For a program:  [cyan]harness compare RUN_A RUN_B --json[/cyan]\n\n"
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
    as_json: JsonOption = False,
) -> int:
    """Print what one run measures less another, paired by scene and tested over objects."""
    found = compare_runs(run_a, run_b, model_a=model_a, model_b=model_b)
    if as_json:
        print_json(found)
        return EXIT_OK
    console = stdout()
    title = f"{model_a} of {run_a} less {model_b} of {run_b}"
    items = [
        (f"{cell_label(item)}: {scene_count(item)}, {object_count(item)}", item)
        for item in found.differences
    ]
    # Not folded, for it holds paths.
    console.print(Text(title, style="bold"), soft_wrap=True)
    console.print(
        Group(
            Text(),
            *difference_lines(items, width=console.width),
            Text(),
            Text(_about(found), style="dim"),
        )
    )
    return EXIT_OK


def _about(found: Comparison) -> str:
    """Say what was compared and what was not."""
    lines = [f"{TESTS} {INTERVALS}", *found.empty]
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


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "All models:  [cyan]harness tune[/cyan]\n\n"
        "One model under other settings:  "
        "[cyan]harness tune --model metric --config embedding.toml[/cyan]\n\n"
        "WORK/tuned.toml holds the chosen keys; WORK/tune.json every trial and each parameter's "
        "curve."
    )
)
def tune(
    *,
    work: Annotated[
        Path, typer.Option(metavar="WORK", help="Folder of the meshes and of what is found.")
    ] = Path("data/tune"),
    split: Annotated[
        Literal["validation", "train"],
        typer.Option(help="Split of the objects; the test split is for measuring alone."),
    ] = "validation",
    scenes: Annotated[int, number_option("Scenes of each class, each of its own object.")] = 12,
    seed: Annotated[int, number_option("Seed of the meshes and the scenes.")] = 1,
    test_points: Annotated[int, number_option("Test points of each test set.")] = 300,
    model: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Model to tune and recalibrate; again for more."),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="TOML, as for bench: where the searches begin."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Choose hyperparameters and recalibrations by the log loss of validation scenes."""
    from harness.tuning.run import TuneOptions, tune

    options = TuneOptions(
        work=work,
        split=split,
        scenes=scenes,
        seed=seed,
        test_points=test_points,
        models=tuple(model or MODEL_ORDER),
        config=config,
    )
    with TuneProgress(Console(stderr=True)) as progress:
        found = tune(options, progress=progress)
    if as_json:
        print_json(found)
        return EXIT_OK
    console = stdout()
    console.print(_tuned_table(found))
    for scene_id, why in found.lost.items():
        print_line(f"{scene_id} is left out: {why}")
    print_line(f"\n{found.toml}")
    files = " and ".join(map(str, found.files))
    print_line(f"in {found.seconds:.0f} s; written to {files}")
    return EXIT_OK


class TuneProgress:
    """A bar for each stage on a terminal, a line for each step elsewhere.

    Parameters
    ----------
    console
        Where to write.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._bar = ProgressBar(console=console, disable=not console.is_terminal)
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> Self:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def __call__(self, step: Step) -> None:
        """Show a step."""
        if not self._console.is_terminal:
            total = "" if step.total is None else f"/{step.total}"
            self._console.print(
                f"{step.stage} {step.done}{total} {step.text}", highlight=False, soft_wrap=True
            )
            return
        if step.stage not in self._tasks:
            self._tasks[step.stage] = self._bar.add_task(step.stage, total=step.total)
        about = f"{step.stage} {step.done} {step.text}"
        self._bar.update(self._tasks[step.stage], completed=step.done, description=about)


def _tuned_table(found: Tuned) -> Table:
    """Lay out each model's log loss and calibration error, before and after recalibration."""
    table = Table(box=None, pad_edge=False, padding=(0, 0, 0, 2), header_style="")
    for name in ("", "trials", "log loss", "recalibrated", "ECE", "recalibrated"):
        table.add_column(name, justify="right" if name else "left", no_wrap=True)
    for model, item in found.calibrations.items():
        trials = len(found.searches[model].trials) if model in found.searches else 0
        values = (item.log_loss_before, item.log_loss_after, item.ece_before, item.ece_after)
        table.add_row(
            model.replace("_", " "), str(trials or ""), *(f"{value:.4f}" for value in values)
        )
    return table
