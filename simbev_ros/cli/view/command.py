"""``simbev view``: its options, and which viewer gets what."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simbev_ros.cli.agent_option import AgentOption, require_agent
from simbev_ros.cli.console import make_console
from simbev_ros.cli.ros_options import NamespaceOption, ros_arguments
from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.conventions.arguments import RosArguments

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene
    from simbev_ros.show.rerun.subject import Detail

_BROWSER_WIDTH_PX = 800
RERUN_PORT = 9090
_FOXGLOVE_PORT = 8765
_RATE_HZ = 5.0


def view(
    context: typer.Context,
    path: Annotated[
        Path | None, typer.Argument(metavar="BAG|DATASET", help="A scene's bag, or a dataset.", show_default=False)
    ] = None,
    scene: Annotated[
        str | None, typer.Option(help="Name or number of a dataset's scene; by default the first one.")
    ] = None,
    agent: AgentOption = None,
    out: Annotated[Path | None, typer.Option(help="Write a .rrd file for Rerun instead of opening the viewer.")] = None,
    live: Annotated[bool, typer.Option("--live", help="Show a running graph, and the next one.")] = False,
    domain: Annotated[
        int | None,
        typer.Option(
            help="ROS domain of the running graph; default: ROS_DOMAIN_ID, or 0.", min=0, max=232, show_default=False
        ),
    ] = None,
    network: Annotated[bool, typer.Option("--network", help="The running graph may be on another host.")] = False,
    namespace: NamespaceOption = None,
    rate: Annotated[
        float | None,
        typer.Option(
            help=f"Frames of the running graph that are shown per second; default: {_RATE_HZ:g}.",
            min=0.1,
            max=60,
            show_default=False,
        ),
    ] = None,
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

    simbev view --live --foxglove
    """
    console = make_console()
    place = ((_FOXGLOVE_PORT if foxglove else RERUN_PORT) if port is None else port), bind
    width_px = _BROWSER_WIDTH_PX if image_width is None else image_width
    if foxglove and agent is not None:
        raise InputError(f"--agent {agent!r:.80}: --foxglove serves the topics of all agents; give one or the other")
    if live:
        _require_no_recording(path, scene, out)
        ros = ros_arguments(context, namespace)
        if foxglove:
            from simbev_ros.cli.view.foxglove import serve_graph

            serve_graph(*place, domain, network=network, console=console, ros=ros)
            return
        detail = _detail(points, width_px, layers=bool(layers), memory_mib=memory)
        _show_live(place, domain, rate, detail, agent=agent, network=network, opens=open_, ros=ros)
        return
    named, told = namespace is not None, bool(context.obj)
    of_graphs = {"--network": network, f"--namespace {namespace}": named, "--ros-args": told}
    _require_recording_options(domain, rate, of_graphs)
    if path is None:
        raise InputError("give a scene's bag or a dataset, or --live for a running graph")
    if foxglove:
        if out is not None:
            raise InputError(
                f"--out {out}: a file is for Rerun, --foxglove serves other viewers; give one or the other"
            )
        from simbev_ros.cli.view.foxglove import serve_recorded

        serve_recorded(choose_scene(path, scene), *place, console)
        return
    from simbev_ros.cli.view.recorded import require_rerun, show_recorded, write_file

    require_rerun()
    chosen = choose_scene(path, scene)
    if agent is not None:
        require_agent(agent, chosen.agents, chosen.name)
        chosen = chosen.of_agent(agent)
    if out is not None:
        everything = _detail(points, image_width or 0, layers=layers is not False, memory_mib=math.inf)
        write_file(chosen, out, everything, console)
        return
    detail = _detail(points, width_px, layers=layers is not False, memory_mib=memory)
    show_recorded(chosen, place, detail, console, opens=open_)


def _detail(points: int, width_px: int, *, layers: bool, memory_mib: float) -> "Detail":
    """How much is shown; a width of 0 means as recorded."""
    from simbev_ros.show.rerun.subject import Detail

    return Detail(points, width_px or None, layers, memory_mib * (1 << 20))


def _show_live(
    place: tuple[int, str],
    domain: int | None,
    rate_hz: float | None,
    detail: "Detail",
    *,
    agent: str | None,
    network: bool,
    opens: bool,
    ros: RosArguments,
) -> None:
    """Show a running graph in Rerun's viewer."""
    from simbev_ros.cli.view.recorded import require_rerun

    require_rerun()
    from simbev_ros.cli.view.live import show_graph

    console = make_console()
    show_graph(
        place,
        domain,
        rate_hz or _RATE_HZ,
        detail,
        agent=agent,
        network=network,
        opens=opens,
        console=console,
        ros=ros,
    )


def _require_no_recording(path: Path | None, scene: str | None, out: Path | None) -> None:
    """Refuse what belongs to recorded scenes."""
    given = {str(path): path is not None, f"--scene {scene}": scene is not None, f"--out {out}": out is not None}
    for words, is_given in given.items():
        if is_given:
            raise InputError(f"{words}: --live shows a running graph; give one or the other")


def _require_recording_options(domain: int | None, rate: float | None, others: Mapping[str, bool]) -> None:
    """Refuse what belongs to running graphs; ``others`` says of further options whether they are given."""
    given = {f"--domain {domain}": domain is not None, f"--rate {rate}": rate is not None, **others}
    for words, is_given in given.items():
        if is_given:
            raise InputError(f"{words}: is for --live")


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
