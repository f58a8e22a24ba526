"""Quality of service of every kind of topic."""

from dataclasses import replace

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from simbev_ros.recording.qos import QosProfile
from simbev_ros.ros.msgs.topic import Topic

_DEPTH = 16
"""More than the lockstep window can fill: at most 8 ticks are in flight."""

LATCHED = QosProfile(reliability="reliable", durability="transient_local", depth=1)
STEERING = replace(LATCHED, depth=4000)
"""Subscriptions to latched topics that steer the graph: a busy node must not lose one among messages of others."""
STEERING_VOLATILE = replace(STEERING, durability="volatile")
"""Additional subscriptions, for publishers that are not latched."""
STATE = QosProfile(reliability="reliable", durability="volatile", depth=_DEPTH)
EVENTS = QosProfile(reliability="reliable", durability="volatile", depth=1000)
"""A pile-up causes many events at once, and all of them count."""
STATE_READER = replace(STATE, depth=1000)
"""Subscriptions to the world state in lockstep, in which a busy node must not lose a message among those of others."""
SENSOR_LOCKSTEP = QosProfile(reliability="reliable", durability="volatile", depth=_DEPTH)
SENSOR_LIVE = QosProfile(reliability="best_effort", durability="volatile", depth=5)


def qos_of(topic: Topic, *, live: bool, reliable: bool = False) -> QosProfile:
    """QoS profile with which a topic is published.

    Args:
        topic: The topic.
        live: Whether the graph is paced by the wall clock.
        reliable: Whether a live graph's sensor topics are reliable all the same.
    """
    if topic.period_ticks == 0 or topic.keeps_newest:
        return LATCHED
    if topic.sporadic:
        return EVENTS
    if topic.sensor:
        profile = SENSOR_LIVE if live else SENSOR_LOCKSTEP
        depth = profile.depth * topic.messages_per_tick
        return replace(profile, depth=depth, reliability="reliable" if reliable else profile.reliability)
    return STATE


def reader_qos_of(topic: Topic, *, live: bool) -> QosProfile:
    """QoS profile with which the graph's own nodes subscribe to a topic; it fits publishers of both reliabilities."""
    profile = qos_of(topic, live=live)
    return STATE_READER if profile == STATE and not live else profile


def rclpy_qos(profile: QosProfile) -> QoSProfile:
    """The same profile as an object of rclpy."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=profile.depth,
        reliability=ReliabilityPolicy[profile.reliability.upper()],
        durability=DurabilityPolicy[profile.durability.upper()],
    )
