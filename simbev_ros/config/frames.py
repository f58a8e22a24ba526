"""Coordinate frames of the ego: where its base_link is, and which transforms the graph publishes."""

from typing import Literal, Self

from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.config.odometry import Odometry
from simbev_ros.config.rig import Rig

OdometryTransform = Literal["map_to_odom", "odom_to_base_link"]
_BOTH: tuple[OdometryTransform, ...] = ("map_to_odom", "odom_to_base_link")


class Frames(Model):
    """Coordinate frames of the ego on `/tf` (REP-105). Labels and sensor data are the same with all of them."""

    odom: bool | None = Field(
        None,
        description="whether `/tf` is `map` → `<agent>/odom` → `<agent>/base_link`; the second part drifts like the "
        "rig's first sensor of type `odometry`, or like one with defaults, and the first part corrects it. "
        "Otherwise `/tf` is `map` → `<agent>/base_link`. None: whether the rig has such a sensor",
    )
    base_link: Literal["footprint", "rear_axle"] = Field(
        "footprint",
        description="origin of `<agent>/base_link`, on the ground: footprint: below the center of the ego's box; "
        "rear_axle: below the center of the rear axle, as Autoware and Ackermann vehicles in Nav2 have it",
    )
    publish: tuple[OdometryTransform, ...] = Field(
        _BOTH,
        description="transforms of `odom: true` that the graph publishes; leave one out if a node of yours publishes "
        "it, a localizer `map_to_odom` or an odometry `odom_to_base_link`, so that no frame gets two parents",
    )

    @model_validator(mode="after")
    def _transforms_exist(self) -> Self:
        if len(set(self.publish)) < len(self.publish):
            raise ValueError("publish: a transform is listed twice")
        if not self.odom and self.publish != _BOTH:
            raise ValueError("publish: its transforms exist with odom: true only")
        return self

    def of_rig(self, rig: Rig) -> Self:
        """These frames for a rig, with ``odom`` decided."""
        return self if self.odom is not None else self.model_copy(update={"odom": bool(rig.of_type(Odometry))})


DEFAULT_FRAMES = Frames()
"""Frames of a configuration without the section."""
