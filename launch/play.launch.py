"""Plays a bag: ``ros2 launch simbev_ros play.launch.py bag:=datasets/first/scenes/train/Town01-0000``.

Our bags hold /clock. The player makes its own instead, which runs on at its own rate and also while the player is
paused, and leaves the recorded one out, as two clocks would contradict each other.
"""

from pathlib import Path

from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    OpaqueFunction,
    Shutdown,
)
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

from launch import LaunchContext, LaunchDescription

BOOLEAN = ["true", "false"]


def generate_launch_description() -> LaunchDescription:
    """Arguments, the player, and RViz if it is wanted."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("bag", description="Folder of a bag"),
            DeclareLaunchArgument("rate", default_value="1.0", description="Speed"),
            DeclareLaunchArgument("loop", default_value="false", choices=BOOLEAN, description="Play again and again"),
            DeclareLaunchArgument("start_offset", default_value="0.0", description="Time to skip at the start, s"),
            DeclareLaunchArgument(
                "clock_hz", default_value="100", description="Rate of /clock; 0: that of the bag, which stops in pauses"
            ),
            DeclareLaunchArgument(
                "qos_overrides", default_value="", description="YAML file with QoS by topic; empty: as recorded"
            ),
            DeclareLaunchArgument("view", default_value="false", choices=BOOLEAN, description="Open RViz"),
            OpaqueFunction(function=start_player),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(Path(__file__).with_name("view.launch.py"))),
                condition=IfCondition(LaunchConfiguration("view")),
            ),
        ]
    )


def start_player(context: LaunchContext) -> list[ExecuteProcess]:
    """Start ``ros2 bag play``; when it ends, all ends."""

    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    command = ["ros2", "bag", "play", value("bag"), "--disable-keyboard-controls", "--rate", value("rate")]
    if float(value("start_offset")):  # Jazzy refuses 0
        command += ["--start-offset", value("start_offset")]
    command += ["--loop"] if value("loop") == "true" else []
    command += ["--qos-profile-overrides-path", value("qos_overrides")] if value("qos_overrides") else []
    if float(value("clock_hz")):
        command += ["--clock", value("clock_hz"), "--exclude-topics", "/clock"]
    return [ExecuteProcess(cmd=command, output="screen", on_exit=Shutdown(reason="the bag has been played"))]
