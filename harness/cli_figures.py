"""The command `figures`."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import Annotated

import typer
from rich.console import Console

from harness.cli_parts import EXIT_OK, JsonOption, print_json, print_line

commands = typer.Typer()


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "Of the newest run:  [cyan]harness figures[/cyan]\n\n"
        "One figure of a run:  [cyan]harness figures results/RUN --only fig6[/cyan]\n\n"
        "With an ablation's curves:  "
        "[cyan]harness figures results/RUN --ablation results/ablations/views[/cyan]\n\n"
        "For a web page:  [cyan]harness figures results/RUN --out docs/figures --web[/cyan]\n\n"
        "Names: fig1, fig3, fig5, fig6 (as in the seed paper), risk-coverage, reliability, table3, "
        "tolerance, ablation. A figure whose data the run has not is left out, with the reason.\n\n"
        "Exit codes: 0 done, 2 bad input."
    )
)
def figures(
    run: Annotated[
        Path | None,
        typer.Argument(metavar="RUN", help="A finished run; the newest in results by default."),
    ] = None,
    *,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Folder to write, by default RUN/figures."),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="This figure alone; can be given several times."),
    ] = None,
    ablation: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DIR", help="Draw the curves of an ablation; can be given several times."
        ),
    ] = None,
    web: Annotated[
        bool, typer.Option("--web", help="Small PNGs for a web page, and no PDF.")
    ] = False,
    as_json: JsonOption = False,
) -> int:
    """Draw the paper's figures from what a run recorded, as PDF and PNG."""
    from harness.figures.draw import FigureOptions, draw_figures

    console = Console(stderr=True)
    with console.status("") as status:
        result = draw_figures(
            FigureOptions(
                run=run,
                out=out,
                only=tuple(only or ()),
                ablations=tuple(ablation or ()),
                web=web,
            ),
            progress=lambda name: status.update(f"drawing {name}"),
        )
    if as_json:
        print_json(result)
        return EXIT_OK
    for figure in result.drawn:
        print_line(f"{figure.name}: {figure.caption}")
    for skipped in result.skipped:
        print_line(f"{skipped.name} is left out: {skipped.why}")
    kinds = "PNG" if web else "PDF and PNG"
    count = "1 figure" if len(result.drawn) == 1 else f"{len(result.drawn)} figures"
    print_line(f"{count} as {kinds} in {result.out}")
    return EXIT_OK
