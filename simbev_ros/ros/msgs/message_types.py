"""Finds message classes by type name, for code that publishes and subscribes to topics of any type."""

import importlib
from functools import cache
from typing import Any


def message_class(type_name: str) -> Any:
    """Message class of a type name such as ``sensor_msgs/msg/Image``.

    Raises:
        ModuleNotFoundError: Its package is not installed.
    """
    package, _, kind = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)


@cache
def is_installed(type_name: str) -> bool:
    """Whether the package of a type such as ``vision_msgs/msg/LabelInfo`` is installed; not all come with ROS."""
    try:
        message_class(type_name)
    except (ImportError, AttributeError):
        return False
    return True
