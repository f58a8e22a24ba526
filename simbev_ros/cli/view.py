"""``simbev view``: shows a recorded scene in Rerun's viewer, in a browser or as a file."""

import os
import sys
import webbrowser
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from simbev_ros.cli.console import counting_bar, make_console, plural
from simbev_ros.cli.output_file import require_place
from simbev_ros.errors import InputError

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene
    from simbev_ros.viewer.recorded import ScenePlayer
    from simbev_ros.viewer.server import ViewerServer

_SUFFIX = ".rrd"
_IDLE_S = 0.5


def view(
    path: Annotated[
        Path | None, typer.Argument(metavar="BAG|DATASET", help="A scene's bag, or a dataset.", show_default=False)
    ] = None,
    scene: Annotated[
        str | None, typer.Option(help="Name or number of a dataset's scene; by default the first one.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write a .rrd file for Rerun instead of opening the viewer.")] = None,
    port: Annotated[int, typer.Option(help="Port of the viewer's page; 0: any free one.", min=0, max=65535)] = 9090,
    bind: Annotated[str, typer.Option(help="Address to listen on; by default only this machine can connect.")] = (
        "127.0.0.1"
    ),
    open_: Annotated[bool, typer.Option("--open/--no-open", help="Open the viewer in the browser.")] = True,
    memory: Annotated[
        int, typer.Option(help="MiB that the scene may take in the viewer; images and clouds are thinned out for it.")
    ] = 1000,
    points: Annotated[int, typer.Option(help="Points of a cloud that are shown.", min=1)] = 60_000,
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
    """
    require_rerun()
    if path is None:
        raise InputError("give a scene's bag or a dataset")
    console = make_console()
    chosen = _choose_scene(path, scene)
    if out is not None:
        _write_file(chosen, out, points, layers=layers, console=console)
    else:
        _serve(chosen, port, bind, memory << 20, points, layers=layers, opens=open_, console=console)


def require_rerun() -> None:
    """Raise InputError if Rerun is not installed."""
    if find_spec("rerun") is None:
        raise InputError(f"simbev view needs Rerun; install it: {sys.executable} -m pip install 'simbev_ros[view]'")


def _choose_scene(path: Path, wanted: str | None) -> "Scene":
    """Open a scene.

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


def _write_file(scene: "Scene", out: Path, points: int, *, layers: bool, console: Console) -> None:
    from simbev_ros.recording.whole_files import whole_file
    from simbev_ros.viewer.blueprint import scene_blueprint
    from simbev_ros.viewer.recorded import ScenePlayer
    from simbev_ros.viewer.scene_log import SceneLog

    if out.suffix != _SUFFIX:
        raise InputError(f"--out {out}: must end in {_SUFFIX}")
    require_place(out)
    with whole_file(out) as file, SceneLog(scene.spec) as log:
        player = ScenePlayer(scene, log, None, points, layers=layers)
        log.save(file, scene_blueprint(player.subject, with_predictions=player.has_predictions))
        with counting_bar(scene.name, console, player.steps) as bar:
            player.play(bar.advance)
    _report_damage(player, console)
    console.print(f"wrote {out}", soft_wrap=True)


def _serve(
    scene: "Scene", port: int, bind: str, memory_bytes: int, points: int, *, layers: bool, opens: bool, console: Console
) -> None:
    from simbev_ros.viewer.blueprint import scene_blueprint
    from simbev_ros.viewer.recorded import ScenePlayer
    from simbev_ros.viewer.scene_log import SceneLog
    from simbev_ros.viewer.server import ViewerServer

    with ViewerServer(port, bind, memory_bytes + memory_bytes // 4) as server, SceneLog(scene.spec) as log:
        player = ScenePlayer(scene, log, memory_bytes, points, layers=layers)
        log.connect(server.data_url, scene_blueprint(player.subject, with_predictions=player.has_predictions))
        show_address(server.page_url, console, opens=opens)
        with counting_bar(scene.name, console, player.steps) as bar:
            player.play(bar.advance)
        _report_damage(player, console)
        if player.every > 1:
            console.print(
                f"every {player.every}th image and cloud is shown, so that the scene fits in {memory_bytes >> 20} MiB; "
                "--memory allows more",
                soft_wrap=True,
            )
        console.print(f"{plural(len(scene), 'frame')} sent; Ctrl-C ends the viewer", soft_wrap=True)
        wait_for_end(server)


def show_address(url: str, console: Console, *, opens: bool) -> None:
    """Print the address of the viewer's page, and open it in a browser if there is a display."""
    console.print(f"viewer: {url}", soft_wrap=True, highlight=False)
    if not opens:
        return
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")) or not webbrowser.open(url):
        console.print("there is no display; open this address in a browser", soft_wrap=True)


def wait_for_end(server: "ViewerServer") -> None:
    """Wait until the user interrupts."""
    import time

    while True:
        server.require_running()
        time.sleep(_IDLE_S)


def _report_damage(player: "ScenePlayer", console: Console) -> None:
    if player.damage:
        console.print(f"warning: {player.damage}; the frames before are shown", soft_wrap=True)
    elif player.is_cut_off:
        console.print("warning: the bag was cut off; what it holds is shown", soft_wrap=True)
