"""``simbev env``: prints the variables with which ROS's own tools find running graphs and this package."""

import os
import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

_SEARCHED = {"AMENT_PREFIX_PATH": "", "PATH": "bin"}
"""Search paths that this installation's folder, or a folder in it, is added to."""


def env(
    domain: Annotated[int | None, typer.Option(help="ROS domain of the graph.", min=0, max=232)] = None,
    network: Annotated[bool, typer.Option("--network", help="The graph may be on another host.")] = False,
) -> None:
    """Print what a shell has to export for ros2, RViz and your own nodes, in the form that source takes.

    It names the transport profile of the graph, and this installation's messages and programs for ros2 run, launch, pkg
    and interface.

    [bold]Examples[/]

    source <(simbev env)

    source <(simbev env --domain 3)
    """
    from simbev_ros.ros.graph.environment import subscriber_environment
    from simbev_ros.ros.graph.exposure import Exposure

    variables = {} if domain is None else {"ROS_DOMAIN_ID": str(domain)}
    variables |= subscriber_environment(Exposure(network=network))
    variables |= {name: _searched(name, Path(sys.prefix) / below) for name, below in _SEARCHED.items()}
    for name, value in variables.items():
        typer.echo(f"export {name}={shlex.quote(value)}")


def _searched(name: str, folder: Path) -> str:
    """A search path with a folder first."""
    others = [each for each in os.environ.get(name, "").split(os.pathsep) if each and each != str(folder)]
    return os.pathsep.join([str(folder), *others])
