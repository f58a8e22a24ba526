"""The group of all benchmarks, and those of the world node and of several agents."""

from typing import Annotated

import typer

from simbev_ros.cli.console import make_console
from simbev_ros.cli.scene_options import SHIPPED
from simbev_ros.cli.timing_report import Json, show_timing
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_AGENTS
from tools.bench.cli.data import city, evaluate, reading, record
from tools.bench.cli.endurance import endurance
from tools.bench.cli.number_list import numbers_in
from tools.bench.cli.production import production
from tools.bench.cli.sensing import cameras, labels, rays
from tools.bench.cli.viewing import view

_DEFAULT = "graph"
Ticks = Annotated[
    int,
    typer.Option(help="Ticks to time; with few, what nodes did ahead is missing from CPU times.", min=5, max=10_000),
]
Record = Annotated[
    bool, typer.Option(help="Also record, into a temporary folder. Cameras draw only images that are read.")
]


bench = typer.Typer(rich_markup_mode="rich", no_args_is_help=True, add_completion=False)


@bench.callback()
def _bench() -> None:
    """Time scenes, cameras, rays, labels, recorder, world or agents, or work on datasets; watch long runs.

    [bold]Examples[/]

    python -m tools.bench cameras --quality low --size 800x450

    python -m tools.bench record

    python -m tools.bench evaluate

    python -m tools.bench production datasets/first

    python -m tools.bench world Town10HD --ticks 200
    """


for _command in (cameras, rays, labels, reading, record, evaluate, city, production, endurance, view):
    bench.command()(_command)


@bench.command()
def world(
    map_name: Annotated[str, typer.Argument(help="A town or a map file.", metavar="MAP")] = "Town10HD",
    config: Annotated[str, typer.Option(help=f"Configuration of the traffic: a file, or {SHIPPED}.")] = "demo",
    ticks: Ticks = 40,
    as_json: Json = False,
) -> None:
    """Time the world node alone on one map: traffic, motion, publishing, with 50 to 950 actors.

    A third of the actors are vehicles. Processor time grows as the number of actors to the power of the printed growth.

    [bold]Example[/]

    python -m tools.bench world Town10HD --ticks 200
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from simbev_ros.production.graph_timing import shortened
    from tools.bench.world_timing import timed_world

    scenario, observer = shortened(load_scenario(config), ticks), SceneDisplay(make_console(stderr=True))
    grown = timed_world(scenario, map_name, observer=observer)
    show_timing(
        grown,
        f"world node on {grown.map}, growth {grown.growth:.2f}",
        ("vehicles", "people", "busy ms/tick", "99th percentile", "CPU ms/tick"),
        [
            (f"{row.vehicles}", f"{row.people}", f"{row.mean_ms:.1f}", f"{row.p99_ms:.1f}", f"{row.cpu_ms:.1f}")
            for row in grown.scenes
        ],
        as_json=as_json,
    )


@bench.command()
def scene(
    maps: Annotated[str, typer.Option(help="Two maps: that of two scenes, and another one.")] = "Town03,Town02",
    workers: Annotated[int, typer.Option(help="Number of graphs side by side.", min=1, max=100)] = 1,
    as_json: Json = False,
) -> None:
    """Time whole scenes with four cameras at 1 Hz, core-seconds by phase and process: first, same town, another town.

    The parts of loading are timed in one process without a graph; several processes of a graph may need the same part.

    [bold]Example[/]

    python -m tools.bench scene --maps Town12,Town04 --workers 8
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from tools.bench.scene_timing import CASES, timed_scenes

    if len(names := maps.split(",")) != 2:
        raise InputError(f"{maps}; must be two maps, separated by a comma", parameter="maps")
    result = timed_scenes(names, workers, SceneDisplay(make_console(stderr=True)))
    title = f"core-seconds, {result.workers:.0f} workers, peak memory of one {result.memory_mib:.0f} MiB"
    show_timing(result, title, ("", *CASES), result.rows(), as_json=as_json)


@bench.command()
def agents(
    map_name: Annotated[str, typer.Argument(help="A town or a map file.", metavar="MAP")] = "Town05",
    numbers: Annotated[str, typer.Option(help="Numbers of agents, separated by commas.")] = "1,2,4,8",
    ticks: Ticks = 40,
    rounds: Annotated[int, typer.Option(help="How often each number is timed, in turns.", min=1, max=100)] = 1,
    as_json: Json = False,
) -> None:
    """Time recorded scenes with several agents near one another: processor time and memory by number of agents.

    Each has a lidar of 64 x 1024 rays, a camera of 800 x 450, boxes and a grid.

    [bold]Example[/]

    python -m tools.bench agents Town05 --numbers 1,2 --rounds 3
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from tools.bench.agent_timing import timed_agents

    counts = numbers_in(numbers, "--numbers", MAX_AGENTS)
    timing = timed_agents(map_name, counts, ticks, rounds, SceneDisplay(make_console(stderr=True)))
    show_timing(
        timing,
        f"{timing.rounds} {'round' if timing.rounds == 1 else 'rounds'} on {timing.map}, CPU ms/tick",
        ("agents", "ticks/s", "all", "world", "sensors and labels", "recorder", "memory MiB"),
        timing.rows(),
        as_json=as_json,
        comparison=timing.comparison(),
    )
