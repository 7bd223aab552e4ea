"""The command `render`."""

from __future__ import annotations

from pathlib import Path  # noqa: TC003 - typer reads annotations at run time
from typing import Annotated

import typer

from harness.cli_parts import EXIT_OK, JsonOption, number_option, print_json, print_line

commands = typer.Typer()


@commands.command(
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
    json: JsonOption = False,
) -> int:
    """Write a scene's images, depth, masks, its map in 3-D and its completed shapes."""
    from harness.render import RenderOptions, run_render

    pictures = run_render(
        RenderOptions(
            scene=scene, cluttered=cluttered, seed=seed, objects=objects, out=out, config=config
        )
    )
    if json:
        print_json(pictures)
        return EXIT_OK
    for reason in pictures.uncompleted.values():
        print_line(reason)
    clouds = f" and {len(pictures.clouds)} completed clouds" if pictures.clouds else ""
    print_line(
        f"{len(pictures.files)} pictures{clouds} in {pictures.folder}; "
        f"all in one: {pictures.montage}"
    )
    return EXIT_OK
