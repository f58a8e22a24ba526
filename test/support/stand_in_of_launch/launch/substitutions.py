"""Values that are known when a launch file runs."""

from launch import LaunchContext


class LaunchConfiguration:
    """The value of an argument."""

    def __init__(self, variable_name: str) -> None:
        self._name = variable_name

    def perform(self, context: LaunchContext) -> str:
        """The value."""
        return context.launch_configurations[self._name]


def text(value: "str | LaunchConfiguration", context: LaunchContext) -> str:
    """A string, or the value of a substitution."""
    assert isinstance(value, (str, LaunchConfiguration)), f"{value!r} is not a substitution"
    return value if isinstance(value, str) else value.perform(context)
