"""Describes one topic, on which publisher, recorder and readers must agree. Pure: imports no ROS."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Topic:
    """Description of a topic of a scene; its QoS follows from these fields, see ``ros.msgs.qos``.

    Attributes:
        name: Name with leading slash.
        type: ROS type, such as ``sensor_msgs/msg/Image``.
        period_ticks: One message every ``period_ticks`` ticks, from tick 0 on; 0: latched, one message per scene.
        sensor: Whether this is sensor data, which live graphs send as best effort by default.
        sporadic: Whether messages depend on events: none, one or more per tick.
        keeps_newest: Whether a late subscriber gets the newest message at once, like that of a map in ROS.
        messages_per_tick: Number of messages at each tick but the first, stamped at equal intervals, the last one at
            the tick; at tick 0 there is one. Above 1 only if ``period_ticks`` is 1.
    """

    name: str
    type: str
    period_ticks: int = 1
    sensor: bool = False
    sporadic: bool = False
    keeps_newest: bool = False
    messages_per_tick: int = 1


def agent_topic(agent: str, name: str) -> str:
    """Name of a topic in an agent's namespace."""
    return f"/{agent}/{name}"
