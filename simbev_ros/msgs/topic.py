"""One topic: what its publisher, its recorder and its readers must agree on. Pure: imports no ROS."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Topic:
    """One topic of a scene. Its QoS follows from these fields: see ``msgs.qos``.

    Attributes:
        name: With leading slash.
        type: ROS type, e.g. ``sensor_msgs/msg/Image``.
        period_ticks: One message every ``period_ticks`` ticks from tick 0 on; 0: latched, one message a scene.
        sensor: Sensor data, which live graphs send as best effort.
        sporadic: Messages come when something happens: none, one or more at a tick.
        messages_per_tick: Messages at each tick but the first, stamped at equal distances, the last one at the tick; at
            tick 0 there is one. Above 1 only where ``period_ticks`` is 1.
    """

    name: str
    type: str
    period_ticks: int = 1
    sensor: bool = False
    sporadic: bool = False
    messages_per_tick: int = 1


def agent_topic(agent: str, name: str) -> str:
    """Name of a topic in an agent's namespace."""
    return f"/{agent}/{name}"
