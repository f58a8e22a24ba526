"""What our launch files need of ROS's package ``launch``, as its API is in Jazzy; it starts nothing by itself."""

import os
from typing import Any


class LaunchContext:
    """Values of arguments, variables, and the processes that a description wants to start, in order."""

    def __init__(self, arguments: dict[str, str]) -> None:
        self.launch_configurations = dict(arguments)
        self.environment = dict(os.environ)
        self.processes: list[Any] = []
        self.declared: dict[str, Any] = {}


class LaunchDescription:
    """A list of actions."""

    def __init__(self, entities: list[Any]) -> None:
        self.entities = entities

    def execute(self, context: LaunchContext) -> None:
        """Execute the actions in order, and those that they return."""
        for entity in self.entities:
            if entity.condition is None or entity.condition.evaluate(context):
                returned = entity.execute(context)
                LaunchDescription(list(returned or ())).execute(context)
