"""``simbev view``: its options, and which viewer gets what."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simbev_ros.cli.console import make_console
from simbev_ros.errors import InputError

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene

_BROWSER_WIDTH_PX = 800
_RERUN_PORT, _FOXGLOVE_PORT = 9090, 8765


def view(
    path: Annotated[
        Path | None, typer.Argument(metavar="BAG|DATASET", help="A scene's bag, or a dataset.", show_default=False)
    ] = None,
    scene: Annotated[
        str | None, typer.Option(help="Name or number of a dataset's scene; by default the first one.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write a .rrd file for Rerun instead of opening the viewer.")] = None,
    foxglove: Annotated[bool, typer.Option("--foxglove", help="Serve Foxglove and Lichtblick instead.")] = False,
    live: Annotated[bool, typer.Option("--live", help="Show the running graph instead of a recorded scene.")] = False,
    domain: Annotated[
        int | None, typer.Option(help="ROS domain of the running graph; default: ROS_DOMAIN_ID, or 0.", min=0, max=232)
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            help=f"Port to listen on; 0: any free one; default: {_RERUN_PORT}, with --foxglove {_FOXGLOVE_PORT}.",
            min=0,
            max=65535,
            show_default=False,
        ),
    ] = None,
    bind: Annotated[str, typer.Option(help="Address to listen on; by default only this machine can connect.")] = (
        "127.0.0.1"
    ),
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open the viewer in the browser.")] = True,
    memory: Annotated[
        int,
        typer.Option(
            help="MiB that the scene may take in the viewer; images and clouds are thinned out for it.", min=64
        ),
    ] = 300,
    image_width: Annotated[
        int | None,
        typer.Option(
            help="Maximum width of images, px; 0: as recorded; default: 800 in the browser, 0 in a file.",
            min=0,
            show_default=False,
        ),
    ] = None,
    points: Annotated[int, typer.Option(help="Points of a cloud that are shown.", min=2)] = 40_000,
    layers: Annotated[
        bool, typer.Option("--layers/--no-layers", help="Show semantic, instance, depth and flow images too.")
    ] = True,
) -> None:
    """Look at a recorded scene in Rerun's viewer: cameras, 3D, bird's-eye view, plots, map and table.

    The viewer's page and the data come from this machine alone. Ctrl-C ends it.

    [bold]Examples[/]

    simbev view out/demo

    simbev view datasets/first --scene Town01-0003 --port 0 --no-open

    simbev view out/demo --out demo.rrd

    simbev view out/demo --foxglove

    simbev view --live --foxglove
    """
    console = make_console()
    if live and foxglove:
        from simbev_ros.cli.view.foxglove import serve_graph

        serve_graph(_FOXGLOVE_PORT if port is None else port, bind, domain, console)
        return
    if path is None:
        raise InputError("give a scene's bag or a dataset")
    if foxglove:
        from simbev_ros.cli.view.foxglove import serve_recorded

        serve_recorded(choose_scene(path, scene), _FOXGLOVE_PORT if port is None else port, bind, console)
        return
    from simbev_ros.cli.view.recorded import require_rerun, show_recorded, write_file

    require_rerun()
    from simbev_ros.viewer.subject import Detail

    chosen = choose_scene(path, scene)
    if out is not None:
        write_file(chosen, out, Detail(points, image_width or None, layers), console)
        return
    width_px = _BROWSER_WIDTH_PX if image_width is None else image_width
    detail = Detail(points, width_px or None, layers, memory << 20)
    show_recorded(chosen, (_RERUN_PORT if port is None else port, bind), detail, console, opens=open_)


def choose_scene(path: Path, wanted: str | None) -> "Scene":
    """Open a scene of a dataset, or the one of a bag, even if the bag was cut off.

    Raises:
        InputError: There is no such scene, or none at all.
        BagError: The bag cannot be read.
    """
    from simbev_ros.dataset.opened import open_dataset

    scenes = open_dataset(path).scenes
    if not scenes:
        raise InputError(f"{path}: the dataset holds no finished scene")
    found = [each for each in scenes if wanted is None or wanted in (each.name, str(each.number))]
    if not found:
        names = ", ".join(each.name for each in scenes[:8]) + (", …" if len(scenes) > 8 else "")
        raise InputError(f"--scene {wanted!r}: {path} has {names}")
    if not len(found[0]):
        raise InputError(f"{found[0].path}: the bag holds no frame")
    return found[0]
