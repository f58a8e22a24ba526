"""The option ``--namespace`` and ROS's own arguments, which the verbs that start nodes take."""

from typing import Annotated

import typer

from simbev_ros.ros.conventions.arguments import RosArguments

NamespaceOption = Annotated[
    str | None, typer.Option(help="Namespace of the graph, such as sim1: all its names are below it.", metavar="NAME")
]


def ros_arguments(context: typer.Context, namespace: str | None) -> RosArguments:
    """Arguments of nodes on the command line, after --ros-args and with --namespace.

    Raises:
        InputError: ROS does not understand it, or the namespace is invalid.
    """
    ros = RosArguments.parse(context.obj or (), namespace)
    if ros.words:
        ros.require_valid()
    return ros
