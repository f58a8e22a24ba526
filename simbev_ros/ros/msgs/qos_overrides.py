"""QoS that a user overrides with ROS parameters ``qos_overrides.<topic>.publisher.<policy>``, as for any ROS node."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.qos import QoSPolicyKind
from rclpy.qos_overriding_options import QoSOverridingOptions

from simbev_ros.foundation.errors import InputError


class _Policy(NamedTuple):
    """A policy that can be overridden, and which values are allowed, as a test and in words."""

    kind: QoSPolicyKind
    allows: Callable[[Any], bool]
    allowed: str


_POLICIES: Mapping[str, _Policy] = {
    "depth": _Policy(QoSPolicyKind.DEPTH, lambda value: type(value) is int and value >= 1, "a number from 1 on"),
    # With keep_all, a publisher would wait for its slowest subscriber, and the graph with it.
    "history": _Policy(QoSPolicyKind.HISTORY, lambda value: value == "keep_last", "keep_last"),
    "reliability": _Policy(
        QoSPolicyKind.RELIABILITY, lambda value: value in ("reliable", "best_effort"), "reliable, best_effort"
    ),
}


def override_options(node: Node, topic: str) -> QoSOverridingOptions | None:
    """Options for the publisher of a topic, with those policies that the node's parameters override; None: no policy.

    Only overridden policies become parameters: three of each topic of a rig would be hundreds in ``ros2 param list``.

    Raises:
        InputError: An overridden policy does not exist, or cannot have this value.
    """
    prefix = f"qos_overrides.{node.resolve_topic_name(topic)}.publisher."
    given = {name.removeprefix(prefix): name for name in node._parameter_overrides if name.startswith(prefix)}
    for policy, name in given.items():
        if policy not in _POLICIES:
            raise InputError(f"parameter {name}: there is no such policy; allowed: {', '.join(_POLICIES)}")
        value = node._parameter_overrides[name].value
        if not _POLICIES[policy].allows(value):
            raise InputError(f"parameter {name}: {value!r}; allowed: {_POLICIES[policy].allowed}")
    return QoSOverridingOptions([_POLICIES[policy].kind for policy in given]) if given else None
