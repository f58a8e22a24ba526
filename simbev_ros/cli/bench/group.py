"""The group of commands ``simbev bench``, and those that time the whole graph or its world node."""

import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from simbev_ros.cli.bench.data import city, evaluate, reading, record
from simbev_ros.cli.bench.endurance import endurance
from simbev_ros.cli.bench.number_list import numbers_in
from simbev_ros.cli.bench.production import production
from simbev_ros.cli.bench.report import Json, show_timing
from simbev_ros.cli.bench.sensing import cameras, labels, rays
from simbev_ros.cli.bench.viewing import view
from simbev_ros.cli.console import make_console
from simbev_ros.config.load import load_scenario
from simbev_ros.config.rendering import Quality
from simbev_ros.config.scenario import Scenario, Timing
from simbev_ros.limits import MAX_AGENTS

_DEFAULT = "graph"
Ticks = Annotated[
    int,
    typer.Option(help="Ticks to time; with few, what nodes did ahead is missing from CPU times.", min=5, max=10_000),
]
Record = Annotated[
    bool, typer.Option(help="Also record, into a temporary folder. Cameras draw only images that are read.")
]


class _DefaultGroup(TyperGroup):
    """A group whose default command is ``graph``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert the name of the default command if there is none."""
        named = bool(args) and (args[0] in self.commands or args[0] in ctx.help_option_names)
        return super().parse_args(ctx, args if named else [_DEFAULT, *args])


bench = typer.Typer(cls=_DefaultGroup, rich_markup_mode="rich")


@bench.callback()
def _bench() -> None:
    """Time the whole graph, its cameras, rays, labels, recorder, world or agents, or work on datasets; watch long runs.

    Without a command the whole graph is timed.

    [bold]Examples[/]

    simbev bench

    simbev bench cameras --quality low --size 800x450

    simbev bench record

    simbev bench evaluate

    simbev bench production datasets/first

    simbev bench world Town10HD --ticks 200
    """


@bench.command()
def graph(
    config: Annotated[str, typer.Argument(help="Configuration to time: a file, or demo, live, paper, stack.")] = "demo",
    ticks: Ticks = 40,
    record: Record = True,
    as_json: Json = False,
) -> None:
    """Time the whole graph: ticks per second, for each node the time per tick and its parts, and what limits the speed.

    [bold]Example[/]

    simbev bench graph live --no-record --json
    """
    _show_graph(load_scenario(config), ticks, record=record, as_json=as_json)


@bench.command()
def full(
    quality: Annotated[Quality, typer.Option(help="Quality of the color images.")] = "medium",
    ticks: Ticks = 40,
    record: Record = True,
    as_json: Json = False,
) -> None:
    """Time the whole graph with the paper's rig and all labels in Town03, by day, with 60 vehicles and 60 pedestrians.

    The rig has six cameras of 1600 x 900 with five modalities, a lidar of 262,144 rays, and four radars.

    [bold]Example[/]

    simbev bench full --quality low --ticks 100
    """
    from simbev_ros.bench.graph_timing import full_rig

    _show_graph(full_rig(quality), ticks, record=record, as_json=as_json)


def _show_graph(scenario: Scenario, ticks: int, *, record: bool, as_json: bool) -> None:
    """Time a graph and show the result."""
    from simbev_ros.bench.graph_timing import timed_graph
    from simbev_ros.cli.production_display import SceneDisplay

    with tempfile.TemporaryDirectory(prefix="simbev_ros-bench-") as folder:
        dataset = Path(folder) / "dataset" if record else None
        result = timed_graph(_shortened(scenario, ticks), dataset, SceneDisplay(make_console(stderr=True)))
    show_timing(
        result,
        f"{result.ticks_per_s:.2f} ticks/s",
        ("process", "busy ms/tick", "CPU ms/tick", "memory MiB"),
        result.rows(),
        as_json=as_json,
        comparison=result.bottleneck(),
    )


for _command in (cameras, rays, labels, reading, record, evaluate, city, production, endurance, view):
    bench.command()(_command)


@bench.command()
def world(
    map_name: Annotated[str, typer.Argument(help="A town or a map file.", metavar="MAP")] = "Town10HD",
    config: Annotated[
        str, typer.Option(help="Configuration of the traffic: a file, or demo, live, paper, stack.")
    ] = "demo",
    ticks: Ticks = 40,
    as_json: Json = False,
) -> None:
    """Time the world node alone on one map: traffic, motion, publishing, with 50 to 950 actors.

    A third of the actors are vehicles. Processor time grows as the number of actors to the power of the printed growth.

    [bold]Example[/]

    simbev bench world Town10HD --ticks 200
    """
    from simbev_ros.bench.world_timing import timed_world
    from simbev_ros.cli.production_display import SceneDisplay

    scenario, observer = _shortened(load_scenario(config), ticks), SceneDisplay(make_console(stderr=True))
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

    simbev bench agents Town05 --numbers 1,2 --rounds 3
    """
    from simbev_ros.bench.agent_timing import timed_agents
    from simbev_ros.cli.production_display import SceneDisplay

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


def _shortened(scenario: Scenario, ticks: int) -> Scenario:
    """The first scenes of a configuration, shortened to a number of ticks."""
    time = scenario.time
    timing = Timing(tick_s=time.tick_s, warm_up_s=time.warm_up_s, duration_s=ticks * time.tick_s)
    return scenario.model_copy(update={"time": timing, "scenes": scenario.scenes[:1]})
