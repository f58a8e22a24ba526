"""``simbev view``: its options, and which viewer gets what."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simbev_ros.cli.console import make_console
from simbev_ros.errors import InputError

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene

RERUN_PORT = 9090
_FOXGLOVE_PORT = 8765


def view(
    path: Annotated[
        Path | None, typer.Argument(metavar="BAG|DATASET", help="A scene's bag, or a dataset.", show_default=False)
    ] = None,
    scene: Annotated[
        str | None, typer.Option(help="Name or number of a dataset's scene; by default the first one.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write a .rrd file for Rerun instead of opening the viewer.")] = None,
    live: Annotated[bool, typer.Option("--live", help="Show a running graph, and the next one.")] = False,
    domain: Annotated[
        int | None,
        typer.Option(
            help="ROS domain of the running graph; default: ROS_DOMAIN_ID, or 0.", min=0, max=232, show_default=False
        ),
    ] = None,
    network: Annotated[bool, typer.Option("--network", help="The running graph may be on another host.")] = False,
    rate: Annotated[
        float, typer.Option(help="Frames of the running graph that are shown per second.", min=0.1, max=60)
    ] = 5.0,
    foxglove: Annotated[bool, typer.Option("--foxglove", help="Serve Foxglove and Lichtblick instead.")] = False,
    port: Annotated[
        int | None,
        typer.Option(
            help=f"Port to listen on; 0: any free one; default: {RERUN_PORT}, with --foxglove {_FOXGLOVE_PORT}.",
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
    ] = 1000,
    points: Annotated[int, typer.Option(help="Points of a cloud that are shown.", min=1)] = 60_000,
    layers: Annotated[
        bool | None,
        typer.Option(
            "--layers/--no-layers",
            help="Show semantic, instance, depth and flow images too, and with --live classes of lidar points and "
            "occupancy; default: --layers, with --live --no-layers.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Look at a recorded scene or a running graph in Rerun's viewer: cameras, 3D, bird's-eye view, plots, map, table.

    The viewer's page and the data come from this machine alone. Ctrl-C ends it. A running graph does not wait for the
    viewer, which drops what it cannot show in time.

    [bold]Examples[/]

    simbev view out/demo

    simbev view datasets/first --scene Town01-0003 --port 0 --no-open

    simbev view out/demo --out demo.rrd

    simbev view out/demo --foxglove

    simbev view --live --domain 3
    """
    console = make_console()
    if live:
        _require_no_recording(path, scene, out)
        if foxglove:
            raise InputError("--live: is for Rerun's viewer; leave out --foxglove")
        from simbev_ros.cli.view.live import show_graph
        from simbev_ros.cli.view.recorded import require_rerun

        require_rerun()
        from simbev_ros.viewer.live.live_viewer import LiveOptions

        place = (RERUN_PORT if port is None else port), bind
        options = LiveOptions(rate, points, bool(layers))
        show_graph(place, domain, memory << 20, options, network=network, opens=open_, console=console)
        return
    if path is None:
        raise InputError("give a scene's bag or a dataset, or --live for a running graph")
    if foxglove:
        from simbev_ros.cli.view.foxglove import serve_recorded

        serve_recorded(choose_scene(path, scene), _FOXGLOVE_PORT if port is None else port, bind, console)
        return
    from simbev_ros.cli.view.recorded import require_rerun, show_recorded, write_file

    require_rerun()
    chosen = choose_scene(path, scene)
    if out is not None:
        write_file(chosen, out, points, layers=layers is not False, console=console)
        return
    place = (RERUN_PORT if port is None else port), bind
    show_recorded(chosen, place, memory << 20, points, layers=layers is not False, opens=open_, console=console)


def _require_no_recording(path: Path | None, scene: str | None, out: Path | None) -> None:
    """Refuse what belongs to recorded scenes."""
    given = {str(path): path, f"--scene {scene}": scene, f"--out {out}": out}
    for words, value in given.items():
        if value is not None:
            raise InputError(f"{words}: --live shows a running graph; give one or the other")


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
