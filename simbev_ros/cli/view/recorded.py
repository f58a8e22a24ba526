"""``simbev view recorded``: a recorded scene in Rerun's viewer, or as a file for it."""

from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from simbev_ros.cli.agent_option import AgentOption, require_agent
from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.output_file import require_place
from simbev_ros.cli.view.browser import show_address, wait_for_end
from simbev_ros.cli.view.options import (
    BROWSER_WIDTH_PX,
    LOOPBACK,
    RERUN_PORT,
    BagOrDataset,
    Bind,
    ImageWidth,
    Memory,
    Open,
    Points,
    Port,
    SceneOption,
    choose_scene,
    detail,
)
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.installation.extras import load_extras

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene
    from simbev_ros.show.rerun.recorded import ScenePlayer
    from simbev_ros.show.rerun.subject import Detail

_SUFFIX = ".rrd"
_SERVER_SHARE = 1.25
"""Memory that the server may use, relative to the size of what is drawn, so that it drops nothing."""


def recorded(
    path: BagOrDataset,
    scene: SceneOption = None,
    agent: AgentOption = None,
    out: Annotated[Path | None, typer.Option(help="Write a .rrd file for Rerun instead of opening the viewer.")] = None,
    port: Port = RERUN_PORT,
    bind: Bind = LOOPBACK,
    open_: Open = True,
    memory: Memory = 300,
    image_width: ImageWidth = None,
    points: Points = 40_000,
    layers: Annotated[bool, typer.Option(help="Show semantic, instance, depth and flow images too.")] = True,
) -> None:
    """Show a recorded scene in Rerun's viewer: cameras, 3D, bird's-eye view, plots, map, table.

    The viewer's page and the data come from this machine alone. Ctrl-C ends it.

    [bold]Examples[/]

    simbev view out/demo

    simbev view datasets/first --scene Town01-0003 --port 0 --no-open

    simbev view out/demo --out demo.rrd
    """
    require_rerun()
    console, chosen = make_console(), choose_scene(path, scene)
    if agent is not None:
        require_agent(agent, chosen.agents, chosen.name)
        chosen = chosen.of_agent(agent)
    if out is not None:
        write_file(chosen, out, detail(points, image_width or 0, layers=layers), console)
        return
    width_px = BROWSER_WIDTH_PX if image_width is None else image_width
    show_recorded(chosen, (port, bind), detail(points, width_px, memory, layers=layers), console, opens=open_)


def require_rerun() -> None:
    """Raise InputError if Rerun is not installed, or cannot be."""
    if version("numpy").startswith("1."):
        raise InputError(
            "simbev view needs Rerun, which needs NumPy 2, and an installed ROS 2 Jazzy needs NumPy 1; "
            "call it where no ROS is sourced, or simbev view foxglove"
        )
    load_extras()["view"].require("simbev view")


def write_file(scene: "Scene", out: Path, detail: "Detail", console: Console) -> None:
    """Write a scene as a file for Rerun.

    Raises:
        InputError: The file cannot be written there.
        BagError: The bag cannot be read.
    """
    from simbev_ros.foundation.files.whole_files import whole_file
    from simbev_ros.show.rerun.blueprint import scene_blueprint
    from simbev_ros.show.rerun.recorded import ScenePlayer
    from simbev_ros.show.rerun.scene_log import SceneLog

    if out.suffix != _SUFFIX:
        raise InputError(f"--out {out}: must end in {_SUFFIX}")
    require_place(out)
    with whole_file(out) as file, SceneLog(scene.view) as log:
        player = ScenePlayer(scene, log, detail)
        log.save(file, scene_blueprint(player.subject, with_predictions=player.has_predictions))
        with counting_bar(scene.name, console, player.steps) as bar:
            player.play(bar.advance)
    _report_damage(player, console)
    console.print(f"wrote {out}", soft_wrap=True)


def show_recorded(scene: "Scene", place: tuple[int, str], detail: "Detail", console: Console, *, opens: bool) -> None:
    """Show a scene in the browser until an interrupt.

    Raises:
        InputError: The port, or the address, of ``place`` cannot be used.
        BagError: The bag cannot be read.
    """
    from simbev_ros.show.rerun.blueprint import scene_blueprint
    from simbev_ros.show.rerun.recorded import ScenePlayer
    from simbev_ros.show.rerun.scene_log import SceneLog
    from simbev_ros.show.rerun.server import ViewerServer

    with ViewerServer(*place, int(detail.limit_bytes * _SERVER_SHARE)) as server, SceneLog(scene.view) as log:
        player = ScenePlayer(scene, log, detail)
        log.connect(server.data_url, scene_blueprint(player.subject, with_predictions=player.has_predictions))
        show_address(server.page_url, console, opens=opens)
        with counting_bar(scene.name, console, player.steps) as bar:
            player.play(bar.advance)
        _report_damage(player, console)
        _report_thinning(player, detail.limit_bytes, console)
        console.print(f"{plural(len(scene), 'frame')} sent; Ctrl-C ends the viewer", soft_wrap=True)
        wait_for_end(server)


def _report_thinning(player: "ScenePlayer", limit_bytes: float, console: Console) -> None:
    numbers = {"images and clouds": player.every, "layers": player.every_layer}
    thinned = [f"one in {every} of the {kind}" for kind, every in numbers.items() if every > 1]
    if thinned:
        console.print(
            f"shown: {', '.join(thinned)}, so that the scene fits in {limit_bytes / (1 << 20):.0f} MiB; "
            "--memory allows more",
            soft_wrap=True,
        )


def _report_damage(player: "ScenePlayer", console: Console) -> None:
    if player.damage:
        console.print(f"warning: {player.damage}; the frames before are shown", soft_wrap=True)
    elif player.is_cut_off:
        console.print("warning: the bag was cut off; what it holds is shown", soft_wrap=True)
