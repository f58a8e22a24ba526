"""``simbev bench``: what a graph, its cameras, rays, labels, its world or its data cost on this machine."""

import tempfile
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from typer.core import TyperGroup

from simbev_ros.cli.bench_data import evaluate, reading, record
from simbev_ros.cli.bench_report import Json, progress_bar, show_timing
from simbev_ros.cli.picture_size import picture_size_px
from simbev_ros.config.load import load_scenario
from simbev_ros.config.rendering import QUALITIES, Quality, Rendering
from simbev_ros.config.scenario import Scenario, Timing

_DEFAULT = "graph"
_LEAST_PX = 16

_Map = Annotated[str, typer.Option("--map", help="A town, or a file.")]
_Crowd = Annotated[
    int, typer.Option(help="A third vehicles, the others people on foot; riders come on top.", min=2, max=2_000)
]
_Radius = Annotated[float, typer.Option(help="Of the circle around the ego that they are in, m.", min=20)]
_Frames = Annotated[int, typer.Option(help="Ticks to time; the median counts.", min=1, max=1000)]


class _DefaultGroup(TyperGroup):
    """Without a command's name the arguments are those of ``graph``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Put the name in where it is missing."""
        named = bool(args) and (args[0] in self.commands or args[0] in ctx.help_option_names)
        rest: list[str] = super().parse_args(ctx, args if named else [_DEFAULT, *args])
        return rest


bench = typer.Typer(cls=_DefaultGroup, rich_markup_mode="rich")


@bench.callback()
def _bench() -> None:
    """Time the whole graph, or its cameras, rays, labels, recorder, world or what is done with datasets alone.

    Without a name it is the graph.

    [bold]Examples[/]

    simbev bench

    simbev bench cameras --quality low --size 800x450

    simbev bench record

    simbev bench evaluate

    simbev bench world Town10HD --ticks 200
    """


@bench.command()
def graph(
    config: Annotated[str, typer.Argument(help="Configuration to time: a file, or demo, live, paper, stack.")] = "demo",
    ticks: Annotated[int, typer.Option(help="Ticks to time.", min=5, max=10_000)] = 40,
    record: Annotated[
        bool, typer.Option(help="Record too, to a temporary folder. Cameras draw only what is read.")
    ] = True,
    as_json: Json = False,
) -> None:
    """Time the whole graph: ticks per second, and for each node the time per tick and the processor time.

    [bold]Example[/]

    simbev bench live --no-record --json
    """
    from simbev_ros.bench.graph_timing import timed_graph

    with tempfile.TemporaryDirectory(prefix="simbev_ros-bench-") as folder:
        result = timed_graph(_shortened(config, ticks), Path(folder) / "dataset" if record else None)
    show_timing(
        result,
        f"{result.ticks_per_s:.2f} ticks/s",
        ("process", "busy ms/tick", "CPU ms/tick", "memory MiB"),
        [(row.name, f"{row.busy_ms:.1f}", f"{row.cpu_ms:.1f}", f"{row.memory_mib:.0f}") for row in result.processes],
        as_json=as_json,
    )


@bench.command()
def cameras(
    map_name: _Map = "Town03",
    actors: Annotated[
        int, typer.Option(help="Half vehicles, half people on foot; riders come on top.", min=2, max=20_000)
    ] = 100,
    quality: Annotated[Quality | None, typer.Option(help="Of the colour images; all of them when omitted.")] = None,
    size: Annotated[str, typer.Option(help="Of every image, pixels.", metavar="WIDTHxHEIGHT")] = "1600x900",
    frames: Annotated[int, typer.Option(help="Frames to time; the median counts.", min=1, max=1000)] = 5,
    processes: Annotated[
        int | None,
        typer.Option(help="That share the cameras; as many as a graph would have when omitted.", min=1, max=16),
    ] = None,
    as_json: Json = False,
) -> None:
    """Time the paper's six cameras with five modalities each, by day, at each quality: a whole frame, and its parts.

    A frame begins with the state of the world and ends with all images in memory, those of all processes. The parts are
    timed in one process and in frames of their own, because waiting for each takes longer. Where the package mujoco is
    installed, its renderer draws the same triangles in as many processes for comparison.

    [bold]Example[/]

    simbev bench cameras --quality medium --frames 10 --json
    """
    from simbev_ros.bench.camera_scene import camera_scene, paper_cameras
    from simbev_ros.bench.camera_timing import steps, timed_cameras

    size_px, console = picture_size_px(size, _LEAST_PX), Console(stderr=True)
    qualities = QUALITIES if quality is None else (quality,)
    scene = camera_scene(map_name, actors, frames + 2, console)
    with progress_bar("frames", console) as bars:
        task = bars.add_task("", total=steps(scene, qualities))
        rendering = Rendering(processes=processes or "auto")
        result = timed_cameras(scene, paper_cameras(), size_px, qualities, rendering, lambda: bars.advance(task))
    show_timing(
        result,
        result.title(),
        ("quality", "", "wall ms/frame", "CPU ms/frame"),
        result.rows(),
        as_json=as_json,
        comparison=result.comparison(),
    )


@bench.command()
def rays(
    map_name: _Map = "Town03",
    actors: _Crowd = 100,
    radius: _Radius = 110.0,
    frames: _Frames = 10,
    as_json: Json = False,
) -> None:
    """Time the rays of the paper's lidar and of its four radars, the moving actors placed anew for each tick.

    What is timed begins with the state of the world and ends with tables of points. For comparison, the lidar's rays
    are also cast in plain Open3D, into one merged mesh of what is static near the ego and of all actors.

    [bold]Example[/]

    simbev bench rays --actors 200 --frames 20 --json
    """
    from simbev_ros.bench.camera_scene import camera_scene
    from simbev_ros.bench.ray_timing import timed_rays

    console = Console(stderr=True)
    scene = camera_scene(map_name, actors, frames + 1, console, vehicle_share=1 / 3, spawn_radius_m=radius)
    with progress_bar("ticks", console) as bars:
        task = bars.add_task("", total=frames + 1)
        result = timed_rays(scene, lambda: bars.advance(task))
    show_timing(
        result,
        f"{result.rays:,} lidar rays on {result.map}, {result.near_actors} of {result.actors} actors in range, "
        f"{result.triangles:,} triangles",
        ("", "", "wall ms/tick", "least", "CPU ms/tick", "rays/s"),
        result.rows(),
        as_json=as_json,
        comparison=result.comparison(),
    )


@bench.command()
def labels(
    map_name: _Map = "Town03",
    actors: _Crowd = 150,
    radius: _Radius = 100.0,
    frames: _Frames = 10,
    as_json: Json = False,
) -> None:
    """Time the labels of a tick: grid, boxes, points in them, what cameras see of them, the vector map and voxels.

    Grid, boxes, lidar, radars and the six cameras are those of the paper. For comparison, the same grid is made from
    the same triangles in shapely.

    [bold]Example[/]

    simbev bench labels --map Town10HD --actors 200 --frames 20 --json
    """
    from simbev_ros.bench.camera_scene import camera_scene
    from simbev_ros.bench.label_timing import timed_labels

    console = Console(stderr=True)
    scene = camera_scene(
        map_name, actors, frames + 1, console, vehicle_share=1 / 3, spawn_radius_m=radius, spacing_m=12.0
    )
    with progress_bar("ticks", console) as bars:
        task = bars.add_task("", total=frames + 1)
        result = timed_labels(scene, lambda: bars.advance(task))
    show_timing(
        result,
        result.title(),
        ("", "wall ms/tick", "least", "CPU ms/tick"),
        result.rows(),
        as_json=as_json,
        comparison=result.comparison(),
    )


for _command in (reading, record, evaluate):
    bench.command()(_command)


@bench.command()
def world(
    map_name: Annotated[str, typer.Argument(help="A town, or a file.", metavar="MAP")] = "Town10HD",
    config: Annotated[
        str, typer.Option(help="Configuration of the traffic: a file, or demo, live, paper, stack.")
    ] = "demo",
    ticks: Annotated[int, typer.Option(help="Ticks to time.", min=5, max=10_000)] = 40,
    as_json: Json = False,
) -> None:
    """Time the world node alone on one map: traffic, motion, publishing, with 50 to 950 actors.

    A third of the actors are vehicles. The growth is the exponent of the number of actors: at most 1 is at most linear.

    [bold]Example[/]

    simbev bench world Town10HD --ticks 200
    """
    from simbev_ros.bench.world_timing import timed_world

    grown = timed_world(_shortened(config, ticks), map_name)
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


def _shortened(config: str, ticks: int) -> Scenario:
    """A configuration's first scene, of so many ticks."""
    scenario = load_scenario(config)
    timing = Timing(
        tick_s=scenario.time.tick_s, warm_up_s=scenario.time.warm_up_s, duration_s=ticks * scenario.time.tick_s
    )
    return scenario.model_copy(update={"time": timing, "scenes": scenario.scenes[:1]})
