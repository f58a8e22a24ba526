"""The command ``simbev scene``."""

from typing import Annotated

import typer


def scene(
    config: Annotated[str, typer.Argument(help="Configuration file, or demo, live, paper, stack.", show_default=False)],
    count: Annotated[
        int | None,
        typer.Option(help="Number of scenes; default: that of the configuration.", min=1, max=100_000),
    ] = None,
    map_name: Annotated[
        str | None, typer.Option("--map", help="Draw all scenes on this town or map file instead.", metavar="MAP")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> None:
    """Draw scenes without simulating them; print statistics, a histogram and the distribution of every parameter.

    Scene k is the one that [bold]simbev run[/] would play as number k; after the last one the maps are repeated.

    [bold]Examples[/]

    simbev scene demo

    simbev scene paper --map Town05 --count 2000

    simbev scene my.yaml --count 500 --json
    """
    from simbev_ros.cli.scene.report import report_scenes

    report_scenes(config, count, map_name, as_json=as_json)
