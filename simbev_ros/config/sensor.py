"""Base of all sensor models: name, pose on the agent, and rate."""

from functools import cached_property
from typing import ClassVar

import numpy as np
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.names import TopicName
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array

MAX_SENSOR_HEIGHT_M = 200.0
"""Maximum height of a sensor above the foot of its mast."""
MAX_HEIGHT_ON_VEHICLE_M = 20.0
"""Maximum height of a sensor above the ground below its vehicle."""


class Pose(Model):
    """Pose of a sensor in the ego frame: x forward, y left, z up, origin on the ground below the box's center.

    On a mast, the origin is its foot, and `mast.height_m` is added to `z_m`.
    """

    x_m: float = Field(0.0, ge=-20, le=20, description="forward")
    y_m: float = Field(0.0, ge=-20, le=20, description="left")
    z_m: float = Field(
        0.0,
        ge=-5,
        le=MAX_SENSOR_HEIGHT_M,
        description=f"up from the ground; at most {MAX_HEIGHT_ON_VEHICLE_M:g} on a vehicle",
    )
    roll_deg: float = Field(0.0, ge=-180, le=180, description="rotation about x; positive tilts to the right")
    pitch_deg: float = Field(0.0, ge=-180, le=180, description="rotation about y; positive looks down (REP-103)")
    yaw_deg: float = Field(0.0, ge=-180, le=180, description="rotation about z; positive looks left (REP-103)")

    @cached_property
    def ego_from_sensor(self) -> Float64Array:
        """(4, 4) transform; for cameras the sensor frame is the body frame (x forward), not the optical frame."""
        return matrices_from_xyz_rpy(
            np.array([self.x_m, self.y_m, self.z_m]),
            np.radians([self.roll_deg, self.pitch_deg, self.yaw_deg]),
        )


class Sensor(Model):
    """Properties that all sensors have.

    Attributes:
        has_frame: Whether the kind measures at a position on the agent and so has a coordinate frame there.
    """

    has_frame: ClassVar[bool] = True

    name: TopicName = Field(description="name of the sensor, part of its topics and frame, unique in the rig")
    pose: Pose = Pose()
    rate_hz: float | None = Field(
        None, gt=0, le=1000, description="publishing rate, which must divide the tick rate; none: every tick"
    )
