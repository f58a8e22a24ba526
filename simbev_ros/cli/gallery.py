"""``simbev gallery``: pictures of towns, weathers and camera modalities."""

from pathlib import Path
from typing import Annotated

import typer

from simbev_ros.cli.console import make_console
from simbev_ros.cli.output_file import Overwrite, show_written
from simbev_ros.config.rendering import Quality


def gallery(
    out: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path(),
    maps: Annotated[
        list[str] | None, typer.Option("--map", help="Only this town or map file; may be repeated.")
    ] = None,
    size: Annotated[str, typer.Option(help="Size of each picture in pixels.", metavar="WxH")] = "1600x900",
    quality: Annotated[Quality, typer.Option(help="Quality of rendering: low, medium, high.")] = "high",
    seed: Annotated[int, typer.Option(help="Seed for everything the maps do not determine.", min=0, max=2**31)] = 0,
    overwrite: Overwrite = False,
) -> None:
    """Draw every town, one street in all weathers and lights, and all camera modalities.

    [bold]Examples[/]

    simbev gallery --out pictures --map Town03 --map Town10HD
    """
    from simbev_ros.cli.gallery_pictures import make_gallery

    console = make_console()
    show_written(make_gallery(out, maps or [], size, quality, seed, overwrite=overwrite, console=console), console)
