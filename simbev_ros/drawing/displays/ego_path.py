"""The path of an agent up to now, as nav_msgs/Path."""

from collections import deque
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from simbev_ros.drawing.displays.messages import MAP_FRAME, PATH, build, pose, serialize, stamped
from simbev_ros.foundation.types import Float64Array

_MIN_STEP_M = 0.5
_MAX_POSES = 2000


class PathPose(NamedTuple):
    """A pose of the agent with its stamp: x, y, z, m, and a quaternion x, y, z, w, both in the map frame."""

    stamp_ns: int
    position_m: list[float]
    xyzw: list[float]

    @classmethod
    def of_odometry(cls, odometry: Any, stamp_ns: int) -> "PathPose":
        """The pose in a nav_msgs/Odometry, of rclpy's or any other class."""
        position, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
        return cls(stamp_ns, [position.x, position.y, position.z], [turn.x, turn.y, turn.z, turn.w])


class EgoPath:
    """Collects poses of the agent at least half a meter apart; the oldest of more than 2,000 are dropped."""

    def __init__(self) -> None:
        self._poses: deque[PathPose] = deque(maxlen=_MAX_POSES)

    def add(self, added: PathPose) -> None:
        """Append a pose if the agent has moved."""
        if not self._poses or _distance_m(self._poses[-1], added) >= _MIN_STEP_M:
            self._poses.append(added)

    def until(self, now: PathPose) -> list[PathPose]:
        """The poses up to ``now``; those with later stamps are left out."""
        return [*(each for each in self._poses if each.stamp_ns < now.stamp_ns), now]


def path_message(poses: Iterable[PathPose]) -> bytes:
    """Path along poses, stamped as the last one."""
    steps = [
        build(
            "geometry_msgs/msg/PoseStamped",
            header=stamped(each.stamp_ns, MAP_FRAME),
            pose=pose(each.position_m, each.xyzw),
        )
        for each in poses
    ]
    return serialize(build(PATH, header=steps[-1].header, poses=steps))


def _distance_m(first: PathPose, second: PathPose) -> float:
    difference: Float64Array = np.subtract(first.position_m, second.position_m)
    return float(np.linalg.norm(difference))
