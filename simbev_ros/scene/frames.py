"""Names of the ego's coordinate frames, and the fixed transforms between them.

The ego frame (x forward, y left, z up, origin on the ground below the center of the ego's box) is the frame of the
rig's poses, of grids and of voxels. It is called ``<agent>/base_link``; if base_link is at the rear axle, the ego frame
is called ``<agent>/footprint`` instead and hangs from base_link. It is not called base_footprint, because REP-120 wants
a frame of that name to be level, which the ego frame is not.

``map`` belongs to the world, so it has no prefix. ``<agent>/odom`` has one, because every agent drifts on its own.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.config.frames import Frames
from simbev_ros.config.odometry import Odometry
from simbev_ros.config.sensor import Sensor
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import Blueprint, blueprint_named
from simbev_ros.schema.scene.agents import AgentView


class FixedFrame(NamedTuple):
    """A coordinate frame that is fixed to another one.

    Attributes:
        parent: Name of the other frame.
        name: Name of the frame.
        parent_from_frame: (4, 4) pose of the frame.
        sensor: The sensor whose data are in the frame; None for the ego frame and for optical frames.
    """

    parent: str
    name: str
    parent_from_frame: Float64Array
    sensor: Sensor | None


def base_link_frame(agent: str) -> str:
    """Name of the frame that moves on /tf, and that /ego/odom describes."""
    return f"{agent}/base_link"


def odom_frame(agent: str) -> str:
    """Name of the frame in which wheel odometry is continuous (REP-105)."""
    return f"{agent}/odom"


def ego_frame(view: AgentView) -> str:
    """Name of the ego frame, that of grids and voxels."""
    agent = view.agent
    return f"{agent}/footprint" if view.frames.base_link == "rear_axle" else base_link_frame(agent)


def base_link_x_m(frames: Frames, ego: Blueprint) -> float:
    """X of the origin of base_link in the ego frame, for a scene that is drawn."""
    return -ego.footprint.axle_m if frames.base_link == "rear_axle" else 0.0


def ego_from_base_link(view: AgentView) -> Float64Array:
    """(4, 4) pose of base_link in the ego frame."""
    return matrices_from_xyz_rpy(np.array([view.base_link_x_m, 0.0, 0.0]), np.zeros(3))


def rear_axle_m(view: AgentView) -> float:
    """Distance from the origin of the ego frame back to the rear axle; the ego must be a vehicle."""
    assert view.vehicle is not None, "a roadside unit has no axles"
    return blueprint_named(view.vehicle.blueprint).footprint.axle_m


def ego_size_m(view: AgentView) -> tuple[float, float, float]:
    """Length, width and height of the ego's box; a roadside unit has no body, so its size is zero."""
    return (0.0, 0.0, 0.0) if view.vehicle is None else blueprint_named(view.vehicle.blueprint).size_m


def odometry_of_frames(view: AgentView) -> Odometry:
    """The wheel odometry by which the odom frame drifts: the rig's first one, or one with defaults."""
    return next(iter(view.rig.of_type(Odometry)), Odometry(type="odometry", name="wheel"))


def fixed_frames(view: AgentView) -> Iterator[FixedFrame]:
    """Frames that are fixed to base_link, parents first: the ego frame if it is another one, then those of sensors."""
    agent = view.agent
    base_link, ego = base_link_frame(agent), ego_frame(view)
    base_link_from_ego = None if ego == base_link else inverse(ego_from_base_link(view))
    if base_link_from_ego is not None:
        yield FixedFrame(base_link, ego, base_link_from_ego, None)
    for sensor in view.rig.sensors:
        if not sensor.has_frame:
            continue
        frame, pose = f"{agent}/{sensor.name}", sensor.pose.ego_from_sensor
        yield FixedFrame(base_link, frame, pose if base_link_from_ego is None else base_link_from_ego @ pose, sensor)
        if isinstance(sensor, Camera):
            yield FixedFrame(frame, f"{frame}_optical", SENSOR_FROM_OPTICAL, None)
