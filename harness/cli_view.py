"""The command `view`."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import Annotated

import typer
from rich.console import Console

from harness.cli_parts import EXIT_OK, JsonOption, number_option, print_json, print_line

commands = typer.Typer()


@commands.command(
    epilog=(
        "[bold]Examples[/bold]\n\n"
        "In a window:  [cyan]harness view results/RUN --scene mug-0003[/cyan]\n\n"
        "In a browser, from a machine without a display:  "
        "[cyan]harness view results/RUN --scene mug-0003 --serve[/cyan]\n\n"
        "As a file, for `rerun mug.rrd`:  "
        "[cyan]harness view results/RUN --scene 3 --class mug --save mug.rrd[/cyan]\n\n"
        "Needs the extra `view`:  [cyan]pip install 'credence\\[view]'[/cyan]\n\n"
        "Exit codes: 0 done, 2 bad input, 130 interrupted."
    )
)
def view(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run with recordings.")],
    *,
    scene: Annotated[
        str, typer.Option(metavar="ID", help="Such as mug-0003; or a number, with --class.")
    ],
    of_class: Annotated[
        str | None, typer.Option("--class", metavar="NAME", help="Class of a scene's number.")
    ] = None,
    model: Annotated[
        str, typer.Option(metavar="NAME", help="Model whose confidence colours the points.")
    ] = "metric",
    save: Annotated[
        Path | None,
        typer.Option(metavar="FILE.rrd", help="File to write in place of opening the viewer."),
    ] = None,
    serve: Annotated[
        bool, typer.Option("--serve", help="Serve the viewer to browsers on this machine.")
    ] = False,
    port: Annotated[
        int, number_option("Where to serve; the port after it carries the data.")
    ] = 9090,
    json: JsonOption = False,
) -> int:
    """Show a recorded scene in the Rerun viewer: images, arm, map view by view, confidence."""
    from harness.view.run import ViewOptions, view_scene

    result = view_scene(
        ViewOptions(
            run=run,
            scene=scene,
            of_class=of_class,
            model=model,
            save=save,
            serve=serve,
            port=port,
        ),
        say=lambda text: Console(stderr=True).print(
            text, highlight=False, soft_wrap=True, markup=False
        ),
    )
    if json:
        print_json(result)
        return EXIT_OK
    if result.note is not None:
        print_line(result.note)
    if result.file is not None:
        megabytes = result.size_bytes / 1e6
        print_line(f"{result.file}: {megabytes:.1f} MB; `rerun {result.file}` shows it")
    return EXIT_OK
