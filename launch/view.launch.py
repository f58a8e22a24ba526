"""Opens RViz with the layout for our topics: ``ros2 launch simbev_ros view.launch.py``, for a graph or a bag.

There is no robot_state_publisher: graphs and bags have /tf_static themselves, and the model in /robot_description has
the same frames, so that it would publish each transform a second time.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription

OF_EVERY_LAYOUT = ("/tf", "/tf_static", "/clock")
"""Topics that RViz subscribes to without a line in the layout."""


def generate_launch_description() -> LaunchDescription:
    """Arguments, and RViz."""
    layout = str(Path(get_package_share_directory("simbev_ros"), "config", "rviz", "simbev.rviz"))
    return LaunchDescription(
        [
            DeclareLaunchArgument("layout", default_value=layout, description="Layout of RViz"),
            DeclareLaunchArgument("namespace", default_value="", description="Namespace of the graph; empty: none"),
            OpaqueFunction(function=start_rviz),
        ]
    )


def start_rviz(context: LaunchContext) -> list[Node]:
    """Start RViz, with the layout's topics below the namespace of the graph."""
    layout = LaunchConfiguration("layout").perform(context)
    namespace = LaunchConfiguration("namespace").perform(context).strip("/")
    names = topics_of(yaml.safe_load(Path(layout).read_text(encoding="utf-8"))) if namespace else ()
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        name="rviz",
        arguments=["-d", layout],
        parameters=[{"use_sim_time": True}],
        remappings=[(name, f"/{namespace}{name}") for name in sorted({*names, *OF_EVERY_LAYOUT})] if namespace else [],
        output="screen",
    )
    return [rviz]


def topics_of(layout: Any) -> Iterator[str]:
    """All names of topics in a layout: values with a leading slash."""
    if isinstance(layout, dict):
        layout = list(layout.values())
    if isinstance(layout, list):
        for each in layout:
            yield from topics_of(each)
    elif isinstance(layout, str) and layout.startswith("/"):
        yield layout
