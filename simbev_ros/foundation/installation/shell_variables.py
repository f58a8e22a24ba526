"""Variables of users' shells that would break or mislead a graph: which are set, and what happens with them.

A command calls ``prepare_shell`` before it loads ROS, which reads the variables then; a node that is started by itself
calls ``prepare_node``.
"""

import os
import socket
import sys
from collections.abc import Callable, MutableMapping
from importlib import metadata
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from simbev_ros.foundation.installation.arithmetic import rounding_variables
from simbev_ros.foundation.installation.ros_release import is_jazzy
from simbev_ros.foundation.tables import load_table

_DROPPED, _IGNORED = "dropped", "ignored"
_MIDDLEWARE = "RMW_IMPLEMENTATION"
_LOADER = ("LD_PRELOAD", "LD_LIBRARY_PATH")
_NODE_PROGRAM = "simbev_node"
_MAX_SHOWN_CHARACTERS = 80


class SetVariable(NamedTuple):
    """A variable of the table that is set.

    Attributes:
        name: Its name.
        value: Its value, shortened.
        effect: What happens with it, in words.
        was_dropped: Whether a graph cannot work with the value, so that our processes run without it.
    """

    name: str
    value: str
    effect: str
    was_dropped: bool

    def __str__(self) -> str:
        return f"{self.name}={self.value}: {self.effect}"


def settle_shell(environment: MutableMapping[str, str]) -> list[SetVariable]:
    """Take variables out of an environment that a graph must not see.

    Args:
        environment: Such as ``os.environ``; changed in place.

    Returns:
        The variables of the table that were set, in its order.
    """
    table = load_table("simbev_ros.foundation.installation", "shell_variables.yaml")
    found = []
    for name, rows in table.items():
        value = environment.get(name)
        row = next((row for row in rows if value and _CHECKS[row["when"]](value)), None)
        if value is None or row is None:
            continue
        if row["then"] in (_DROPPED, _IGNORED):
            del environment[name]
        effect = f"{row['then']}: {row['words'].format(middlewares=' and '.join(_middlewares()))}"
        shown = os.pathsep.join(_foreign_parts(value))
        found.append(SetVariable(name, f"{shown:.{_MAX_SHOWN_CHARACTERS}}", effect, row["then"] == _DROPPED))
    return found


def prepare_shell() -> None:
    """Settle the variables of this process, and print a warning for each that was dropped."""
    for variable in settle_shell(os.environ):
        if variable.was_dropped:
            print(f"warning: {variable}", file=sys.stderr)


def prepare_node() -> None:
    """Prepare a node that is started as a program of its own: how it rounds, and a middleware that is not installed.

    The latter is dropped, with a warning: ROS would end the process when it is loaded, so a package of nodes calls this
    before it imports any. Processes that a graph has started, and other programs that import the package, are left
    alone. All else that the shell sets is the choice of the one who starts the node.
    """
    is_program = sys.argv[0] == "-m" or Path(sys.argv[0]).name == _NODE_PROGRAM  # the former until a module has run
    if is_program:
        os.environ.update(rounding_variables(os.environ))
    if is_program and _MIDDLEWARE in os.environ:
        chosen = {_MIDDLEWARE: os.environ.pop(_MIDDLEWARE)}
        for variable in settle_shell(chosen):
            print(f"warning: {variable}", file=sys.stderr)
        os.environ.update(chosen)


def describe_loader() -> str:
    """The variables that send the dynamic loader to other libraries, with the remedy; empty if none is set."""
    return "; ".join(map(str, settle_shell({name: os.environ[name] for name in _LOADER if name in os.environ})))


def _middlewares() -> list[str]:
    """Names of the middlewares that this ROS has."""
    # ROS from wheels is bound to the one that it was built with, even if AMENT_PREFIX_PATH leads to others.
    is_wheel = any(metadata.distributions(name="ros-rclpy"))
    prefixes = [sys.prefix] if is_wheel else os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    folders = [Path(prefix, "share/ament_index/resource_index/rmw_typesupport") for prefix in prefixes]
    return sorted({file.name for folder in folders for file in folder.glob("rmw_*_*")})


def _holds_no_profile(value: str) -> bool:
    try:
        return not any(element.tag.endswith("profiles") for element in ElementTree.parse(value).iter())
    except (OSError, ElementTree.ParseError):
        return True


def _names_no_host(value: str) -> bool:
    try:
        for host in filter(None, value.split(";")):
            socket.getaddrinfo(host, None)
    except (OSError, UnicodeError):
        return True
    return False


def _cannot_be_written(value: str) -> bool:
    """Whether a folder cannot be made or written to; ROS would make it as well."""
    try:
        Path(value).expanduser().mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):
        return True
    return not os.access(Path(value).expanduser(), os.W_OK)


def _foreign_parts(value: str) -> list[str]:
    """The parts of a list of files or folders outside this environment, where wheels of ROS add their own."""
    environment = Path(sys.prefix).resolve()
    parts = filter(None, value.split(os.pathsep))
    return [part for part in parts if not Path(part).resolve().is_relative_to(environment)]


_CHECKS: dict[str, Callable[[str], bool]] = {
    "always": lambda value: True,
    "middleware_is_missing": lambda value: bool(_middlewares()) and value not in _middlewares(),
    "holds_no_profile": _holds_no_profile,
    "is_jazzy": lambda value: is_jazzy(),
    "is_newer_than_jazzy": lambda value: not is_jazzy(),
    "is_foreign": lambda value: Path(value).name not in ("fastdds.xml", "fastdds_network.xml"),
    "is_another_range": lambda value: value not in ("LOCALHOST", "SUBNET"),
    "names_no_host": _names_no_host,
    "cannot_be_written": _cannot_be_written,
    "has_foreign_parts": lambda value: bool(_foreign_parts(value)),
}
