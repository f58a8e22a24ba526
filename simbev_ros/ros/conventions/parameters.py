"""Declares read-only parameters so that every one of them has a value, a description and the values it may have.

``ros2 param dump`` and rqt ask a node for all of its parameters at once. rclpy answers with nothing if a single one has
no value, which a list of strings that is declared by its type, or overridden with ``[]``, does not have.
"""

import math
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, ParameterType
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from simbev_ros.foundation.errors import InputError

_MAX_INTEGER = 2**63 - 1
_KINDS = {bool: "true or false", int: "an integer", float: "a number", str: "a string", list: "a list of strings"}


def declare_read_only(
    node: Node, name: str, default: Any, description: str, *, minimum: float | None = None, allowed: str = ""
) -> Any:
    """Declare a read-only parameter and return its value.

    Args:
        node: The node.
        name: The parameter's name.
        default: Its default, which determines its type; ``[]`` means a list of strings.
        description: What it says.
        minimum: Minimum of a number.
        allowed: Further constraints, as text.

    Raises:
        InputError: The value has another type, or is below the minimum.
    """
    descriptor = ParameterDescriptor(description=description, additional_constraints=allowed, read_only=True)
    if isinstance(default, float) and minimum is not None:
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(minimum), to_value=math.inf)]
    elif minimum is not None:
        descriptor.integer_range = [IntegerRange(from_value=int(minimum), to_value=_MAX_INTEGER)]
    try:
        if default == []:
            return _declare_strings(node, name, descriptor)
        return node.declare_parameter(name, default, descriptor).value
    except (InvalidParameterTypeException, InvalidParameterValueException):
        least = "" if minimum is None else f" that is at least {minimum:g}"
        raise InputError(f"parameter {name}: must be {_KINDS[type(default)]}{least}") from None


def _declare_strings(node: Node, name: str, descriptor: ParameterDescriptor) -> list[str]:
    """Declare a list of strings, which rclpy can only be given by its type, as it takes ``[]`` for bytes."""
    value = node.declare_parameter(name, Parameter.Type.STRING_ARRAY, ParameterDescriptor()).value
    if value is None:
        node.set_parameters([Parameter(name, Parameter.Type.STRING_ARRAY, [])])
    descriptor.type = ParameterType.PARAMETER_STRING_ARRAY
    node.set_descriptor(name, descriptor)
    return list(value or [])
