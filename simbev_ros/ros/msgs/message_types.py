"""Finds message classes by type name, for code that publishes and subscribes to topics of any type."""

import importlib
import re
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from simbev_ros.foundation.errors import InputError

_TYPE_NAME = re.compile(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*")


def message_class(type_name: str) -> Any:
    """Message class of a type name such as ``sensor_msgs/msg/Image``.

    Any process of the domain can announce any name, so no package is imported but those that ROS has generated.

    Raises:
        ModuleNotFoundError: There is no installed package of messages by this name.
    """
    package, _, kind = type_name.split("/") if _TYPE_NAME.fullmatch(type_name) else ("", "", "")
    if not _is_generated(package):
        raise ModuleNotFoundError(f"No message package for {type_name!r}", name=package or type_name)
    return getattr(importlib.import_module(f"{package}.msg"), kind)


@lru_cache(1024)
def _is_generated(package: str) -> bool:
    """Whether a package has ROS's type support; nothing is imported to find out."""
    spec = find_spec(package) if package else None
    folders = (spec and spec.submodule_search_locations) or ()
    return any(any(Path(folder).glob(f"{package}_s__rosidl_typesupport_c.*")) for folder in folders)


def require_installed(type_name: str, user: str) -> None:
    """Check that the package of a type is installed; ``user`` is what needs it.

    Raises:
        InputError: It is not; the message says who makes it.
    """
    if not is_installed(type_name):
        raise InputError(f"{user} needs {type_name.partition('/')[0]}, which `simbev doctor --fix` makes")


@cache
def is_installed(type_name: str) -> bool:
    """Whether the package of a type such as ``vision_msgs/msg/LabelInfo`` is installed; not all come with ROS."""
    try:
        message_class(type_name)
    except (ImportError, AttributeError):
        return False
    return True
