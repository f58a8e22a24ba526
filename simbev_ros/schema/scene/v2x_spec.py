"""Specification of the messages that the agents of a scene send each other."""

from pydantic import Field

from simbev_ros.config.names import TopicName
from simbev_ros.config.v2x import V2x


class V2xSpec(V2x):
    """Messages between agents, with the range that was drawn for the scene; the latency is drawn for each message."""

    range_m: float = Field(gt=0)
    agents: tuple[TopicName, ...] = Field(min_length=2, description="agents that send and receive, in their order")
