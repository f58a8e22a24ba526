"""``simbev bench``: times a whole graph on this machine."""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from simbev_ros.cli.console import make_console
from simbev_ros.cli.scene_options import SHIPPED
from simbev_ros.cli.timing_report import Json, show_timing
from simbev_ros.config.rendering import Quality

_FULL = "full"


def bench(
    config: Annotated[
        str,
        typer.Argument(help=f"Configuration to time: a file, or {SHIPPED}; {_FULL}: the paper's rig."),
    ] = "demo",
    ticks: Annotated[
        int,
        typer.Option(
            help="Ticks to time; with few, what nodes did ahead is missing from CPU times.", min=5, max=10_000
        ),
    ] = 40,
    record: Annotated[
        bool, typer.Option(help="Also record, into a temporary folder. Cameras draw only images that are read.")
    ] = True,
    quality: Annotated[Quality, typer.Option(help=f"Quality of the color images of {_FULL}.")] = "medium",
    as_json: Json = False,
) -> None:
    """Time the whole graph: ticks per second, for each node the time per tick and its parts, and what limits the speed.

    With [bold]full[/] it has the paper's rig and all labels in Town03, by day, with 60 vehicles and 60 pedestrians:
    six cameras of 1600 x 900 with five modalities, a lidar of 262,144 rays, and four radars.

    [bold]Examples[/]

    simbev bench

    simbev bench full --quality low --ticks 100

    simbev bench live --no-record --json
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from simbev_ros.config.load import load_scenario
    from simbev_ros.production.graph_timing import full_rig, shortened, timed_graph

    scenario = full_rig(quality) if config == _FULL else load_scenario(config)
    with tempfile.TemporaryDirectory(prefix="simbev_ros-bench-") as folder:
        dataset = Path(folder) / "dataset" if record else None
        result = timed_graph(shortened(scenario, ticks), dataset, SceneDisplay(make_console(stderr=True)))
    show_timing(
        result,
        f"{result.ticks_per_s:.2f} ticks/s",
        ("process", "busy ms/tick", "CPU ms/tick", "memory MiB"),
        result.rows(),
        as_json=as_json,
        comparison=result.bottleneck(),
    )
