"""Section ``v2x``: the messages between the agents of a scene, with their range, latency and losses."""

from typing import Annotated

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Drawn, within

_MAX_SIGMA_M = 100.0
_MAX_SIGMA_DEG = 180.0


class V2x(Model):
    """Messages between agents: each sends its pose and the boxes that it sees."""

    rate_hz: float = Field(10.0, gt=0, le=1000, description="rate of each sender, which must divide the tick rate")
    range_m: Annotated[Drawn, within(1, 100_000)] = Field(
        200.0, description="maximum distance between sender and receiver, drawn for each scene"
    )
    latency_s: Annotated[Drawn, within(0, 10)] = Field(
        0.1, description="time from sending to arrival, rounded up to whole ticks; drawn for each message"
    )
    loss: float = Field(0.0, ge=0, le=1, description="probability that a message does not reach a receiver in range")
    min_points: int | None = Field(
        1,
        ge=1,
        le=1_000_000,
        description="number of lidar and radar points inside from which the sender sees a box; none: it uses no points",
    )
    min_visibility: float | None = Field(
        0.0,
        ge=0,
        le=1,
        description="visible share from which the sender's cameras see a box, 0: any pixel; none: it uses no cameras",
    )
    pose_sigma_m: float = Field(
        0.0, ge=0, le=_MAX_SIGMA_M, description="error of the sender's position along x and y; its boxes move with it"
    )
    pose_yaw_sigma_deg: float = Field(
        0.0, ge=0, le=_MAX_SIGMA_DEG, description="error of the sender's heading; its boxes turn with it"
    )
    position_sigma_m: float = Field(
        0.0, ge=0, le=_MAX_SIGMA_M, description="error of the position of each box along x and y"
    )
    yaw_sigma_deg: float = Field(0.0, ge=0, le=_MAX_SIGMA_DEG, description="error of the heading of each box")
