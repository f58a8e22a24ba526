"""``simbev foxglove``: serves a recorded scene to Foxglove and Lichtblick over a WebSocket."""

from pathlib import Path
from typing import Annotated

import typer

from simbev_ros.cli.console import make_console


def foxglove(
    bag: Annotated[Path, typer.Argument(help="A scene's bag: its folder or its .mcap file.", show_default=False)],
    port: Annotated[
        int, typer.Option(help="TCP port on the loopback interface; 0: any free one.", min=0, max=65535)
    ] = 8765,
) -> None:
    """Serve a scene to Foxglove and Lichtblick, which need no ROS for it, until Ctrl-C.

    In the viewer, open a connection of the kind Foxglove WebSocket. Foxglove can pause and seek; for Lichtblick the
    scene is played in a loop.

    [bold]Example[/]

    simbev foxglove out/demo/scenes/train/Blocks-0000
    """
    from simbev_ros.foxglove_server.bag_server import serve_bag
    from simbev_ros.recording.reader import SceneBag

    console = make_console()
    with SceneBag(bag) as opened:
        serve_bag(opened, port, lambda used: console.print(f"serving {opened.name} at ws://127.0.0.1:{used}"))
