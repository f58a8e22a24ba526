"""Options of the verbs that draw, play and record scenes."""

from typing import Annotated

import typer

SHIPPED = "baselines, cooperative, demo, live, paper, road, stack, teams"
"""Names of the configurations that come with the package."""

Config = Annotated[str, typer.Argument(help=f"Configuration file, or {SHIPPED}.", show_default=False)]
Live = Annotated[bool, typer.Option("--live", help="In real time; sensor topics are best effort.")]
GraphWorkers = Annotated[
    str | None,
    typer.Option(
        "--workers",
        help="Number of scenes to record at once, each on a graph of its own; auto: as many as this machine carries.",
        metavar="N|auto",
    ),
]
GraphRay = Annotated[
    str | None,
    typer.Option(
        "--ray",
        help="Record the scenes on this Ray cluster; auto: the one that this machine is a node of.",
        metavar="auto|HOST:PORT",
    ),
]
