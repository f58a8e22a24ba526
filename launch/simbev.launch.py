"""Starts a graph: ``ros2 launch simbev_ros simbev.launch.py config:=live``.

It ends when the graph ends, and the graph ends with it. Other launch files include it, set a namespace for it with
``PushRosNamespace``, or start the program ``simbev`` of this package as a ``Node`` with parameters and remappings.
"""

import os
import shlex
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    SetEnvironmentVariable,
    Shutdown,
)
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription
from simbev_ros.foundation.installation.ros_release import profile_variable

PATIENCE_S = "30"
"""Time that the recorder has to close its bag, before launch becomes impatient."""
BOOLEAN = ["true", "false"]


def generate_launch_description() -> LaunchDescription:
    """Arguments, the graph, and RViz if it is wanted."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("config", default_value="live", description="Configuration: demo, live, … or a file"),
            DeclareLaunchArgument("live", default_value="true", choices=BOOLEAN, description="In real time"),
            DeclareLaunchArgument("record", default_value="", description="Folder to record scenes into; empty: none"),
            DeclareLaunchArgument("domain", default_value="", description="ROS domain; empty: ROS_DOMAIN_ID, or 0"),
            DeclareLaunchArgument("namespace", default_value="", description="Namespace of the graph; empty: none"),
            DeclareLaunchArgument(
                "network", default_value="false", choices=BOOLEAN, description="Let other hosts take part"
            ),
            DeclareLaunchArgument("view", default_value="false", choices=BOOLEAN, description="Open RViz"),
            DeclareLaunchArgument(
                "simbev_args", default_value="", description="More options of simbev run, such as '--reliable'"
            ),
            DeclareLaunchArgument(
                "ros_args", default_value="", description="For all nodes, such as '-r /ego/lidar/points:=/points'"
            ),
            OpaqueFunction(function=prepare_environment),
            OpaqueFunction(function=start_graph),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(Path(__file__).with_name("view.launch.py"))),
                launch_arguments={"namespace": LaunchConfiguration("namespace")}.items(),
                condition=IfCondition(LaunchConfiguration("view")),
            ),
        ]
    )


def prepare_environment(context: LaunchContext) -> list[SetEnvironmentVariable]:
    """Set what subscribers need as well: the domain, the transport for large messages, the range of discovery."""
    on_network = LaunchConfiguration("network").perform(context) == "true"
    folder = Path(get_package_share_directory("simbev_ros"), "config")
    variables = {
        profile_variable(): str(folder / ("fastdds_network.xml" if on_network else "fastdds.xml")),
        "SKIP_DEFAULT_XML_FILE": "1",  # of Fast DDS in the current folder
        "CYCLONEDDS_URI": "" if on_network else (folder / "cyclonedds.xml").as_uri(),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET" if on_network else "LOCALHOST",
    }
    chosen = {name: value for name, value in variables.items() if name not in os.environ}
    if domain := LaunchConfiguration("domain").perform(context):
        chosen["ROS_DOMAIN_ID"] = domain
    return [SetEnvironmentVariable(name, value) for name, value in chosen.items()]


def start_graph(context: LaunchContext) -> list[Node]:
    """Start ``simbev run``, which starts and stops the nodes."""

    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    words = ["run", value("config")]
    words += [f"--{name}" for name in ("live", "network") if value(name) == "true"]
    words += [word for name in ("record", "namespace") if value(name) for word in (f"--{name}", value(name))]
    words += shlex.split(value("simbev_args"))
    of_ros = shlex.split(value("ros_args"))
    words += ["--ros-args", *of_ros, "--"] if of_ros else []
    graph = Node(
        package="simbev_ros",
        executable="simbev",
        arguments=words,
        output="screen",
        sigterm_timeout=PATIENCE_S,
        sigkill_timeout=PATIENCE_S,
        on_exit=Shutdown(reason="the graph has ended"),
    )
    return [graph]
