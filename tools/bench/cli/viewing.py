"""``python -m tools.bench view``: times a graph with and without the viewer."""

import tempfile
from pathlib import Path
from typing import Annotated

import typer

from simbev_ros.cli.console import make_console
from simbev_ros.cli.scene_options import SHIPPED
from simbev_ros.cli.timing_report import Json, show_timing
from simbev_ros.cli.view.recorded import require_rerun
from simbev_ros.config.load import load_scenario


def view(
    config: Annotated[str, typer.Argument(help=f"Configuration to time: a file, or {SHIPPED}.")] = "demo",
    ticks: Annotated[int, typer.Option(help="Ticks of each scene.", min=30, max=10_000)] = 60,
    rounds: Annotated[
        int, typer.Option(help="Number of times each case is timed, one after the other.", min=1, max=100)
    ] = 3,
    as_json: Json = False,
) -> None:
    """Time a recorded lockstep graph without a viewer, with one, and with a stopped viewer or server.

    All cases play the same scene on the same graph, in turns. Ratios are to the graph without a viewer; all figures
    are medians over the rounds. A viewer that runs needs processor time of its own, for which it competes with the
    graph if all cores are busy. There is no browser.

    [bold]Example[/]

    python -m tools.bench view live --ticks 200 --rounds 5
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from tools.bench.view_timing import timed_view

    require_rerun()
    with tempfile.TemporaryDirectory(prefix="simbev_ros-bench-") as folder:
        display = SceneDisplay(make_console(stderr=True))
        result = timed_view(load_scenario(config), ticks, rounds, Path(folder), display)
    show_timing(
        result,
        f"{result.ticks} ticks, {result.cores} cores",
        ("", "ticks/s", "ratio", "CPU ms/tick of the graph", "ratio"),
        result.rows(),
        as_json=as_json,
    )
