"""``simbev bench`` commands that time sensors and labels on a simulated scene, without a graph."""

from typing import Annotated

import typer

from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.picture_size import picture_size_px
from simbev_ros.cli.timing_report import Json, show_timing
from simbev_ros.config.rendering import QUALITIES, Quality, Rendering

_MIN_PX = 16

_Map = Annotated[str, typer.Option("--map", help="A town or a map file.")]
_Crowd = Annotated[
    int,
    typer.Option(
        help="Number of actors: a third are vehicles, the others pedestrians; riders come on top.", min=2, max=2_000
    ),
]
_Radius = Annotated[float, typer.Option(help="Radius around the ego in which they start, in m.", min=20)]
_Frames = Annotated[int, typer.Option(help="Number of ticks to time, of which medians are taken.", min=1, max=1000)]


def cameras(
    map_name: _Map = "Town03",
    actors: Annotated[
        int,
        typer.Option(
            help="Number of actors: half are vehicles, half pedestrians; riders come on top.", min=2, max=20_000
        ),
    ] = 100,
    quality: Annotated[
        Quality | None, typer.Option(help="Quality of the color images; default: all qualities.")
    ] = None,
    size: Annotated[str, typer.Option(help="Size of every image in pixels.", metavar="WIDTHxHEIGHT")] = "1600x900",
    frames: Annotated[
        int, typer.Option(help="Number of frames to time, of which medians are taken.", min=1, max=1000)
    ] = 5,
    processes: Annotated[
        int | None,
        typer.Option(help="Number of processes that share the cameras; default: that of a graph.", min=1, max=16),
    ] = None,
    as_json: Json = False,
) -> None:
    """Time the paper's six cameras with five modalities each, by day, at each quality: a whole frame, and its parts.

    A frame begins with the state of the world and ends when the images of all processes are in memory. The parts are
    timed in other frames and in one process, because waiting for each of them takes longer. If the package mujoco is
    installed, its renderer draws the same triangles with the same number of processes for comparison.

    [bold]Example[/]

    python -m tools.bench cameras --quality medium --frames 10 --json
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from tools.bench.camera_scene import camera_scene, paper_cameras
    from tools.bench.camera_timing import steps, timed_cameras

    size_px, console = picture_size_px(size, _MIN_PX), make_console(stderr=True)
    qualities = QUALITIES if quality is None else (quality,)
    scene = camera_scene(map_name, actors, frames + 2, SceneDisplay(console))
    rendering = Rendering(processes=processes or "auto")
    with counting_bar("frames", console, steps(scene, qualities)) as bar:
        result = timed_cameras(scene, paper_cameras(), size_px, qualities, rendering, bar.advance)
    show_timing(
        result,
        result.title(),
        ("quality", "", "wall ms/frame", "CPU ms/frame"),
        result.rows(),
        as_json=as_json,
        comparison=result.comparison(),
    )


def rays(
    map_name: _Map = "Town03",
    actors: _Crowd = 100,
    radius: _Radius = 110.0,
    frames: _Frames = 10,
    as_json: Json = False,
) -> None:
    """Time the rays of the paper's lidar and of its four radars, with moving actors updated at each tick.

    The time begins with the state of the world and ends with tables of points. For comparison, the lidar's rays are
    also cast in plain Open3D into one merged mesh of the static scene near the ego and of all actors.

    [bold]Example[/]

    python -m tools.bench rays --actors 200 --frames 20 --json
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from tools.bench.camera_scene import camera_scene
    from tools.bench.ray_timing import timed_rays

    console = make_console(stderr=True)
    scene = camera_scene(
        map_name, actors, frames + 1, SceneDisplay(console), vehicle_share=1 / 3, spawn_radius_m=radius
    )
    with counting_bar("ticks", console, frames + 1) as bar:
        result = timed_rays(scene, bar.advance)
    show_timing(
        result,
        f"{result.rays:,} lidar rays on {result.map}, {result.near_actors} of {result.actors} actors in range, "
        f"{result.triangles:,} triangles",
        ("", "", "wall ms/tick", "least", "CPU ms/tick", "rays/s"),
        result.rows(),
        as_json=as_json,
        comparison=result.comparison(),
    )


def labels(
    map_name: _Map = "Town03",
    actors: _Crowd = 150,
    radius: _Radius = 100.0,
    frames: _Frames = 10,
    as_json: Json = False,
) -> None:
    """Time the labels of a tick: grid, boxes, points in them, their visibility to cameras, vector map and voxels.

    Grid, boxes, lidar, radars and the six cameras are those of the paper. For comparison, the same grid is computed
    from the same triangles with shapely.

    [bold]Example[/]

    python -m tools.bench labels --map Town10HD --actors 200 --frames 20 --json
    """
    from simbev_ros.cli.production_display import SceneDisplay
    from tools.bench.camera_scene import camera_scene
    from tools.bench.label_timing import timed_labels

    console = make_console(stderr=True)
    scene = camera_scene(
        map_name, actors, frames + 1, SceneDisplay(console), vehicle_share=1 / 3, spawn_radius_m=radius, spacing_m=12.0
    )
    with counting_bar("ticks", console, frames + 1) as bar:
        result = timed_labels(scene, bar.advance)
    show_timing(
        result,
        result.title(),
        ("", "wall ms/tick", "least", "CPU ms/tick"),
        result.rows(),
        as_json=as_json,
        comparison=result.comparison(),
    )
