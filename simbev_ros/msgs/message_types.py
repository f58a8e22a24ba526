"""Message classes by name."""

import importlib
from typing import Any


def message_class(type_name: str) -> Any:
    """The class of, e.g., ``sensor_msgs/msg/Image``.

    Raises:
        ModuleNotFoundError: its package is not installed.
    """
    package, _, kind = type_name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)
