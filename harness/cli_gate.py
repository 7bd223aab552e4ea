"""Commands that guard against regressions: `gate`, `baseline update` and `baseline show`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from harness.bench import QUICK_SCENES, BenchOptions, Wiring
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
from harness.gate.baseline import Baseline, read_baseline
from harness.gate.run import BASELINE_FOLDER, GateOptions, run_gate
from harness.gate.speed import SpeedMode  # noqa: TC001 - as above
from harness.gate.text import headline, render_verdict
from harness.gate.timed import run_timed
from harness.gate.update import UpdateOptions, update_baseline
from harness.runs.progress import ConsoleProgress

commands = typer.Typer()
baseline_commands = typer.Typer(no_args_is_help=True)
commands.add_typer(
    baseline_commands, name="baseline", help="Replace the gate's baseline, or say what it is."
)

wiring = Wiring()
"""What `gate` runs on."""

BaselineOption = Annotated[
    Path, typer.Option("--baseline", metavar="DIR", help="Folder of the baseline.")
]


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "On every commit:  [cyan]harness gate --against results/baseline --quick[/cyan]\n\n"
        "Before a release, all of the baseline's scenes:  [cyan]harness gate[/cyan]\n\n"
        "A run that is there already:  [cyan]harness gate --run results/RUN[/cyan]\n\n"
        "A gate fails where the mean of a metric over a cell's scenes is surely worse than the "
        "baseline's by more than the metric's margin, where a scene that the baseline scored is "
        "lost, or where a stage is surely slower. A change that is meant is accepted with "
        "[cyan]harness baseline update[/cyan].\n\n"
        "Exit codes: 0 passed, 1 failed, 2 bad input, 130 interrupted."
    )
)
def gate(
    *,
    against: Annotated[
        Path, typer.Option(metavar="DIR", help="Folder of the baseline.")
    ] = BASELINE_FOLDER,
    quick: Annotated[
        bool,
        typer.Option("--quick", help=f"The baseline's first {QUICK_SCENES} scenes of each class."),
    ] = False,
    run: Annotated[
        Path | None,
        typer.Option(metavar="RUN", help="Judge this finished run; no benchmark is run."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="RUN", help="Folder for the run, by default results/TIME-HASH."),
    ] = None,
    workers: Annotated[
        int | None, number_option("Worker processes, by default as the baseline's.")
    ] = None,
    speed: Annotated[
        SpeedMode,
        typer.Option(
            help="Judge times where the baseline is of this machine; require that; or do not."
        ),
    ] = "auto",
    everything: Annotated[
        bool, typer.Option("--all", help="Show every metric of every cell.")
    ] = False,
    as_json: JsonOption = False,
) -> int:
    """Run the benchmark as the baseline was and say whether anything is worse: exit 0 or 1."""
    result = run_gate(
        GateOptions(against=against, quick=quick, run=run, out=out, workers=workers, speed=speed),
        progress=ConsoleProgress(Console(stderr=True)),
        wiring=wiring,
    )
    if as_json:
        print_json(result)
    else:
        stdout().print(render_verdict(result, everything=everything), highlight=False)
        print_line(headline(result))
    return EXIT_OK if result.passed else EXIT_FAILED


@baseline_commands.command(
    "run",
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "A run to become the baseline:  "
        "[cyan]harness baseline run --scenes 32 --out results/RUN[/cyan]\n\n"
        "The same as [cyan]harness bench[/cyan], with a workload of two seconds timed before and "
        "after, by which the gate tells a slower stage from a slower machine.\n\n"
        "Exit codes: 0 done, 1 every scene failed, 2 bad input, 130 interrupted."
    ),
)
def run_for_baseline(
    *,
    scenes: Annotated[int | None, number_option("Scenes of each class.")] = None,
    workers: Annotated[int | None, number_option("Worker processes, by default one per core.")] = (
        None
    ),
    config: Annotated[
        Path | None, typer.Option(metavar="FILE", help="TOML, as for `harness bench`.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="RUN", help="Folder to write, by default results/TIME-HASH."),
    ] = None,
    as_json: JsonOption = False,
) -> int:
    """Run the benchmark so that its times can be held against, for `baseline update` to take."""
    result = run_timed(
        BenchOptions(scenes=scenes, workers=workers, config=config, out=out),
        progress=ConsoleProgress(Console(stderr=True)),
        wiring=wiring,
    )
    if as_json:
        print_json(
            {"folder": result.folder, "scenes": result.scenes, "failures": dict(result.failures)}
        )
    else:
        print_line(
            f"{result.scenes} scenes, {len(result.failures)} failed; make it the baseline: "
            f"harness baseline update --from {result.folder}"
        )
    return EXIT_FAILED if result.all_failed else EXIT_OK


@baseline_commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "A change that is meant:  [cyan]harness baseline update --from results/RUN "
        '--reason "Masks are trimmed where the depth jumps"[/cyan]\n\n'
        "The run must be finished, of a clean checkout and without failed scenes. Commit the "
        "folder afterwards: history.json keeps every reason.\n\n"
        "Exit codes: 0 done, 2 bad input."
    )
)
def update(
    *,
    run: Annotated[Path, typer.Option("--from", metavar="RUN", help="Folder of a finished run.")],
    reason: Annotated[
        str | None,
        typer.Option(metavar="TEXT", help="Why it changes; asked for where it is not given."),
    ] = None,
    baseline: BaselineOption = BASELINE_FOLDER,
    allow_dirty: Annotated[
        bool, typer.Option("--allow-dirty", help="Take a run whose code is no single revision.")
    ] = False,
    allow_failed: Annotated[
        bool, typer.Option("--allow-failed", help="Take a run with failed scenes.")
    ] = False,
    as_json: JsonOption = False,
) -> int:
    """Make a finished run the baseline, and keep the reason why."""
    if reason is None:
        if not sys.stdin.isatty():
            raise InputError('no reason is given; pass --reason "TEXT": why the baseline changes')
        reason = typer.prompt("Why does the baseline change?", default="", show_default=False)
    done = update_baseline(
        UpdateOptions(
            run=run,
            baseline=baseline,
            reason=reason,
            allow_dirty=allow_dirty,
            allow_failed=allow_failed,
        ),
        check_pipeline=wiring.check_pipeline,
    )
    if as_json:
        print_json(done)
        return EXIT_OK
    for note in done.notes:
        print_line(f"Note: {note}")
    for change in done.entry.changes:
        print_line(f"{change.cell} {change.metric}: {change.before:.4f} -> {change.after:.4f}")
    print_line(
        f"{done.folder} is now {run}, {done.size_bytes / 2**10:.0f} KiB; commit it: "
        f"git add {done.folder}"
    )
    return EXIT_OK


@baseline_commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "What the gate compares with, and its history:  [cyan]harness baseline show[/cyan]\n\n"
        "Its table:  [cyan]harness show results/baseline[/cyan]"
    )
)
def show(*, baseline: BaselineOption = BASELINE_FOLDER, as_json: JsonOption = False) -> int:
    """Say what the baseline is, and when and why it was replaced."""
    found = read_baseline(baseline)
    if as_json:
        print_json({"folder": baseline, "scenes": found.config.run.scenes, **_about(found)})
        return EXIT_OK
    config = found.config
    print_line(
        f"{baseline}: {config.run.scenes} scenes of each of {', '.join(config.run.classes)}, "
        f"{len(found.records)} records"
    )
    if found.calibration is None:
        print_line("without a calibration: its times are not judged")
    else:
        machine = found.calibration.machine
        print_line(f"timed on {machine.cpu}, {machine.cores} cores, {machine.workers} workers")
    for entry in reversed(found.history):
        dirty = " and uncommitted changes" if entry.dirty else ""
        print_line(f"{entry.date} {entry.revision[:10]}{dirty}: {entry.reason}")
        for change in entry.changes:
            print_line(
                f"  {change.cell} {change.metric}: {change.before:.4f} -> {change.after:.4f}"
            )
    return EXIT_OK


def _about(found: Baseline) -> dict[str, object]:
    return {
        "classes": list(found.config.run.classes),
        "records": len(found.records),
        "calibration": found.calibration,
        "history": list(found.history),
    }
