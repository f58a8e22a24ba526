"""Finds message classes by type name, for code that subscribes to topics of any type."""

import importlib
from typing import Any


def message_class(type_name: str) -> Any:
    """Message class of a type name such as ``sensor_msgs/msg/Image``.

    Raises:
        ModuleNotFoundError: Its package is not installed.
    """
    package, _, kind = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)
