"""The command ``simbev scene``."""

from pathlib import Path
from typing import Annotated

import typer

from simbev_ros.cli.pool import Workers, processes
from simbev_ros.cli.scene_options import Config
from simbev_ros.foundation.errors import InputError


def scene(
    config: Config,
    count: Annotated[
        int | None,
        typer.Option(help="Number of scenes; default: that of the configuration.", min=1, max=100_000),
    ] = None,
    map_name: Annotated[
        str | None, typer.Option("--map", help="Draw all scenes on this town or map file instead.", metavar="MAP")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Write a page with a small map and the parameters of each scene instead.", metavar="FILE.html"
        ),
    ] = None,
    workers: Workers = None,
) -> None:
    """Draw scenes without simulating them; print statistics, a histogram and the distribution of every parameter.

    Scene k is the one that [bold]simbev run[/] would play as number k; after the last one the maps are repeated.

    [bold]Examples[/]

    simbev scene demo

    simbev scene paper --map Town05 --count 2000

    simbev scene my.yaml --count 500 --json

    simbev scene my.yaml --count 50 --out scenes.html
    """
    pool = processes(workers)
    if out is not None:
        from simbev_ros.cli.scene.sheet import write_sheet

        if as_json:
            raise InputError("--json and --out exclude each other")
        write_sheet(config, count, map_name, out, pool)
        return
    from simbev_ros.cli.scene.report import report_scenes

    report_scenes(config, count, map_name, as_json=as_json)
