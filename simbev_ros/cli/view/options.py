"""Options of the commands of ``simbev view``, and what several of them choose by these."""

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene
    from simbev_ros.show.rerun.subject import Detail

RERUN_PORT, FOXGLOVE_PORT = 9090, 8765
LOOPBACK = "127.0.0.1"
BROWSER_WIDTH_PX = 800
_SHOWN_NAMES = 8

BagOrDataset = Annotated[
    Path, typer.Argument(metavar="BAG|DATASET", help="A scene's bag, or a dataset.", show_default=False)
]
SceneOption = Annotated[
    str | None, typer.Option("--scene", help="Name or number of a dataset's scene; by default the first one.")
]
Domain = Annotated[
    int | None,
    typer.Option(
        help="ROS domain of the running graph; default: ROS_DOMAIN_ID, or 0.", min=0, max=232, show_default=False
    ),
]
Network = Annotated[bool, typer.Option("--network", help="The running graph may be on another host.")]
Port = Annotated[int, typer.Option(help="Port to listen on; 0: any free one.", min=0, max=65535)]
Bind = Annotated[str, typer.Option(help="Address to listen on; by default only this machine can connect.")]
Open = Annotated[bool, typer.Option("--open/--no-open", help="Open the viewer in the browser.")]
Memory = Annotated[
    int,
    typer.Option(help="MiB that the scene may take in the viewer; images and clouds are thinned out.", min=64),
]
ImageWidth = Annotated[
    int | None,
    typer.Option(
        help=f"Maximum width of images, px; 0: as recorded; default: {BROWSER_WIDTH_PX} in the browser, 0 in a file.",
        min=0,
        show_default=False,
    ),
]
Points = Annotated[int, typer.Option(help="Points of a cloud that are shown.", min=2)]


@dataclass(frozen=True)
class RunningGraph:
    """Where a running graph is looked for.

    Attributes:
        domain: ROS domain; None: that of ROS_DOMAIN_ID, or 0.
        network: Whether the graph may be on another host.
        ros: ROS arguments for the nodes of the graph, and its namespace.
    """

    domain: int | None
    network: bool
    ros: RosArguments = PLAIN

    def enter_domain(self) -> int:
        """Give this process the environment of the graph's nodes; return the domain.

        Raises:
            InputError: ROS_DOMAIN_ID is not a domain.
        """
        from simbev_ros.ros.graph.domain import domain_from_environment
        from simbev_ros.ros.graph.environment import graph_environment
        from simbev_ros.ros.graph.exposure import Exposure

        number = domain_from_environment() if self.domain is None else self.domain
        os.environ.update(graph_environment(number, Exposure(network=self.network)))
        return number


def detail(points: int, width_px: int, memory_mib: float = math.inf, *, layers: bool) -> "Detail":
    """Limits on what is shown; a width of 0 means as recorded."""
    from simbev_ros.show.rerun.subject import Detail

    return Detail(points, width_px or None, layers, memory_mib * (1 << 20))


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
        names = ", ".join(each.name for each in scenes[:_SHOWN_NAMES]) + (", …" if len(scenes) > _SHOWN_NAMES else "")
        raise InputError(f"--scene {wanted!r}: {path} has {names}")
    if not len(found[0]):
        raise InputError(f"{found[0].path}: the bag holds no frame")
    return found[0]
