"""The driver of ``drive.stack``: its processes, and what becomes of a drive that it deserts.

A drive counts whatever its driver does. When the driver dies, or keeps the world waiting for too long, the world goes
on without it: the vehicle brakes when its last command is too old, and the scene ends as every drive does. What is
recorded depends on the commands that were sent, not on the time at which the driver was given up.
"""

import sys

from simbev_ros.config.agents import driver_participant
from simbev_ros.config.scenario import Scenario
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.graph.evaluated_stack import boxes_command

DRIVER = "driver"
"""Label of the driver's process."""
_MODULE = "simbev_ros.baselines.driving"


def driver_commands(scenario: Scenario, ros: RosArguments = PLAIN, *, live: bool = False) -> dict[str, tuple[str, ...]]:
    """Commands of the driver and of the stack that it needs, by the labels of their processes.

    Raises:
        InputError: The rig lacks sensors, or the weights do not exist.
    """
    drive = scenario.drive
    if drive is None or drive.stack is None:
        return {}
    if (name := drive.included_driver) is None:
        return {DRIVER: drive.stack}
    words = (name.removeprefix("drive-"), "--agent", scenario.rig.agent)
    commands = {DRIVER: (sys.executable, "-m", _MODULE, *words, *ros.command())}
    if boxes := boxes_command(scenario, ros, live=live):
        commands["stack"] = boxes
    return commands


def dispensable_driver(scenario: Scenario) -> str | None:
    """Name on /sync/ready of the driver without which a drive goes on; None: nobody outside drives a route."""
    name = driver_participant(scenario.rig.agent)
    return name if scenario.drive is not None and name in scenario.participants else None
