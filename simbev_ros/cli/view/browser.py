"""The browser that shows the viewer's page: opened if there is a display, and waited for."""

import os
import time
import webbrowser
from typing import TYPE_CHECKING

from rich.console import Console

if TYPE_CHECKING:
    from simbev_ros.show.rerun.server import ViewerServer

_IDLE_S = 0.5


def show_address(url: str, console: Console, *, opens: bool) -> None:
    """Print the address of the viewer's page, and open it in a browser if there is a display."""
    console.print(f"viewer: {url}", soft_wrap=True, highlight=False)
    if not opens:
        return
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")) or not webbrowser.open(url):
        console.print("there is no display; open this address in a browser", soft_wrap=True)


def wait_for_end(server: "ViewerServer") -> None:
    """Wait until the user interrupts.

    Raises:
        SimbevError: Rerun's server has ended by itself.
    """
    while True:
        server.require_running()
        time.sleep(_IDLE_S)
