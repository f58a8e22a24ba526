"""Conditions of actions."""

from launch import LaunchContext
from launch.substitutions import LaunchConfiguration, text


class IfCondition:
    """True if a value is ``true`` or ``1``."""

    def __init__(self, predicate_expression: "str | LaunchConfiguration") -> None:
        self._expression = predicate_expression

    def evaluate(self, context: LaunchContext) -> bool:
        """Whether it is."""
        value = text(self._expression, context).lower()
        assert value in ("true", "1", "false", "0"), f"{value!r} is not a boolean"
        return value in ("true", "1")
