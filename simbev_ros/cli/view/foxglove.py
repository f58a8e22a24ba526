"""A recorded scene for Foxglove and Lichtblick, over a WebSocket."""

from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene


def serve_recorded(scene: "Scene", port: int, bind: str, console: Console) -> None:
    """Serve a scene until an interrupt.

    Raises:
        InputError: foxglove-sdk is not installed, or the port cannot be used.
        BagError: The bag cannot be read.
    """
    from simbev_ros.foxglove_server.bag_server import serve_bag
    from simbev_ros.recording.reader import SceneBag

    with SceneBag(scene.path) as bag:
        serve_bag(bag, port, lambda used: console.print(f"serving {bag.name} at ws://{bind}:{used}", soft_wrap=True))
