"""Extracts from the JSON on /world/scene the facts about a scene that the stack needs."""

import json
from dataclasses import dataclass

import numpy as np

from simbev_ros.reference_stack.arrays import Floats
from simbev_ros.reference_stack.grid import GridShape

_NS_PER_S = 1_000_000_000


class UsageError(Exception):
    """Base of errors in a stack's input; the message says what to change."""


class NoLidarError(UsageError):
    """Raised when no lidar of the scene's rig publishes on the expected topic."""


@dataclass(frozen=True)
class Scene:
    """The facts about a scene that a stack with one lidar needs.

    Attributes:
        name: Name of the scene, for reports on /sync/ready.
        start_ns: Stamp of tick 0; earlier ticks are a lead-in without clouds.
        tick_ns: Time between ticks.
        period_ticks: Number of ticks between clouds.
        ego_from_lidar: (4, 4) pose of the lidar.
        base_link_from_ego: (4, 4) pose of the ego frame, to which poses of sensors and grids refer.
        ego_frame: Name of the ego frame.
        grid: Shape of the grid of /ego/bev/labels.
    """

    name: str
    start_ns: int
    tick_ns: int
    period_ticks: int
    ego_from_lidar: Floats
    base_link_from_ego: Floats
    ego_frame: str
    grid: GridShape

    def has_cloud(self, stamp_ns: int) -> bool:
        """Whether the lidar publishes a cloud at a stamp."""
        tick = (stamp_ns - self.start_ns) // self.tick_ns
        return tick >= 0 and tick % self.period_ticks == 0


def read_scene(text: str, points_topic: str) -> Scene:
    """Read a scene for the lidar that publishes on ``points_topic``.

    Args:
        text: Scene specification, JSON.
        points_topic: Topic of the clouds.

    Raises:
        NoLidarError: No lidar of an agent publishes there.
    """
    spec = json.loads(text)
    lidars = {
        f"/{agent['rig']['agent']}/{sensor['name']}/points": (agent, sensor)
        for agent in spec["agents"]
        for sensor in agent["rig"]["sensors"]
        if sensor["type"] == "lidar"
    }
    if points_topic not in lidars:
        raise NoLidarError(f"no lidar of the scene publishes {points_topic}; remap it to one of: {', '.join(lidars)}")
    agent, lidar = lidars[points_topic]
    name, bev, tick_ns = agent["rig"]["agent"], agent["annotation"]["bev"], spec["tick_ns"]
    is_behind = agent["frames"]["base_link"] == "rear_axle"
    base_link_from_ego = np.eye(4)
    base_link_from_ego[0, 3] = -agent["base_link_x_m"]
    period_ns = _NS_PER_S / lidar["rate_hz"] if lidar["rate_hz"] else tick_ns
    return Scene(
        name=f"{spec['map']['name']}-{spec['number']:04d}",
        start_ns=(spec["number"] + 1) * 3600 * _NS_PER_S + int(spec["warm_up_ticks"]) * int(tick_ns),
        tick_ns=tick_ns,
        period_ticks=max(1, round(period_ns / tick_ns)),
        ego_from_lidar=_pose(lidar["pose"]),
        base_link_from_ego=base_link_from_ego,
        ego_frame=f"{name}/{'footprint' if is_behind else 'base_link'}",
        grid=GridShape(bev["rows"], bev["columns"], bev["cell_m"]),
    )


def _pose(pose: dict[str, float]) -> Floats:
    """(4, 4) matrix of a pose in meters and degrees: roll, then pitch, then yaw about fixed axes (REP-103)."""
    matrix = np.eye(4)
    for axis, name in enumerate(("roll_deg", "pitch_deg", "yaw_deg")):
        cosine, sine = np.cos(np.radians(pose[name])), np.sin(np.radians(pose[name]))
        rotation, (i, j) = np.eye(4), ((axis + 1) % 3, (axis + 2) % 3)
        rotation[i, i], rotation[i, j], rotation[j, i], rotation[j, j] = cosine, -sine, sine, cosine
        matrix = rotation @ matrix
    matrix[:3, 3] = pose["x_m"], pose["y_m"], pose["z_m"]
    return matrix
