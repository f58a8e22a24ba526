"""ROS's command line arguments, which go to all nodes of a graph: ``--ros-args -r … -p … --params-file …``.

The rule ``__ns:=…`` is taken out of them: it would put every node into one namespace, while nodes of an agent are one
level below the graph.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from simbev_ros.foundation.errors import InputError

_BEGIN, _END = "--ros-args", "--"
_REMAP = ("-r", "--remap")
_NODE_NAMES = ("__node", "__name")
_NAMESPACE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")
_INTERNAL = re.compile(r"^Failed to parse ROS arguments: |, at /.*|\. Error: Expected lexeme.*", re.DOTALL)
"""Prefix of ROS's messages that concerns its own code."""
_MAX_LENGTH = 64
"""Leaves room for the names of topics: ROS allows 255 characters in all."""


@dataclass(frozen=True, slots=True)
class RosArguments:
    """ROS arguments of all nodes of a graph.

    Attributes:
        namespace: Namespace of the graph, such as ``/sim1``; empty: none.
        words: The other arguments, without ``--ros-args``.
    """

    namespace: str = ""
    words: tuple[str, ...] = ()

    @classmethod
    def parse(cls, words: Sequence[str], namespace: str | None = None) -> "RosArguments":
        """The arguments as options of a command line.

        Args:
            words: The words after ``--ros-args``.
            namespace: The graph's namespace, if it is given in another way.

        Raises:
            InputError: It is not a namespace, there are two different ones, or a rule would rename all nodes.
        """
        found = [] if namespace is None else [_checked_namespace(namespace)]
        kept: list[str] = []
        for word in words:
            rule, _, value = word.partition(":=")
            is_rule = bool(kept) and kept[-1] in _REMAP
            if is_rule and rule in _NODE_NAMES:
                raise InputError(f"--ros-args -r {word}: all nodes would have this name; allowed: NODE:{word}")
            if is_rule and rule == "__ns":
                kept.pop()
                found.append(_checked_namespace(value, rule="--ros-args -r __ns"))
            else:
                kept.append(word)
        if len(set(found)) > 1:
            raise InputError(f"the graph is given two namespaces: {found[0] or '/'} and {found[1] or '/'}")
        return cls(found[0] if found else "", tuple(kept))

    def require_valid(self) -> None:
        """Raise InputError if ROS does not understand the arguments, or cannot read a file of parameters."""
        from rclpy.impl.implementation_singleton import rclpy_implementation
        from rclpy.utilities import remove_ros_args

        try:
            remove_ros_args(self.for_nodes)
        except rclpy_implementation.UnknownROSArgsError as error:
            raise InputError(f"--ros-args: ROS knows no {error}") from None
        except rclpy_implementation.RCLError as error:
            raise InputError(f"--ros-args: {_INTERNAL.sub('', str(error))}") from None

    @property
    def for_nodes(self) -> list[str]:
        """Arguments of ``rclpy.init`` in a process of the graph; its nodes know their namespace."""
        return [_BEGIN, *self.words]

    def command(self, *first: str) -> list[str]:
        """Arguments with which a process of the graph is started.

        Args:
            first: Arguments for ROS that come before these, which have priority.
        """
        namespace = [_REMAP[0], f"__ns:={self.namespace}"] if self.namespace else []
        return [_BEGIN, *first, *self.words, *namespace]


PLAIN = RosArguments()
"""No namespace and no arguments."""


def split_ros_arguments(words: Sequence[str]) -> tuple[list[str], list[str]]:
    """The words of a command line that are for the command, and those between ``--ros-args`` and ``--``."""
    own: list[str] = []
    of_ros: list[str] = []
    taking = own
    for word in words:
        if word == _BEGIN:
            taking = of_ros
        elif word == _END and taking is of_ros:
            taking = own
        else:
            taking.append(word)
    return own, of_ros


def _checked_namespace(text: str, rule: str = "") -> str:
    """A namespace, of one of ROS's rules or else a parameter, with one slash before each part; empty for the root."""
    namespace = f"/{text.strip('/')}" if text.strip("/") else ""
    if namespace and not (_NAMESPACE.fullmatch(namespace) and len(namespace) <= _MAX_LENGTH):
        problem = (
            f"{text!r:.80} is not a namespace; allowed: letters, digits and _ in parts that / separates and no digit "
            f"begins, at most {_MAX_LENGTH} characters"
        )
        raise InputError(f"{rule}: {problem}") if rule else InputError(problem, parameter="namespace")
    return namespace
