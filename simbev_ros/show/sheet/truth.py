"""Ground truth around the ego at the time of a picture, from the most recent boxes and labels of a bag.

A stamp and a way to look up samples enter; a ``Truth`` with the ego's pose, boxes and bird's-eye-view labels leaves.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy, rpy_from_rotation
from simbev_ros.foundation.types import AnyArray, Float64Array, Table, UInt16Array

Sample = tuple[int, AnyArray]
"""Stamp (ns) and value of one message."""


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth at the time of one picture.

    Attributes:
        map_from_ego: (4, 4) pose of the ego at that time.
        boxes: (N,) rows of /ego/boxes, map frame; None if there are no recent ones.
        labels: (rows, columns) uint16 bird's-eye-view labels; None if there are no recent ones.
        map_from_grid: (4, 4) pose of the labels' grid: leveled_pose, along the ego's heading at the labels' stamp.
    """

    map_from_ego: Float64Array
    boxes: Table | None
    labels: UInt16Array | None
    map_from_grid: Float64Array


@dataclass(frozen=True, slots=True)
class TruthTopics:
    """The topics of a bag that hold ground truth; None where the bag has no such topic."""

    boxes: str | None = None
    odometry: str | None = None
    labels: str | None = None

    @property
    def names(self) -> list[str]:
        """Names of the topics that the bag has."""
        return [topic for topic in (self.boxes, self.odometry, self.labels) if topic is not None]


def truth_at(stamp_ns: int, topics: TruthTopics, latest: Callable[[str, int], Sample | None]) -> Truth | None:
    """Ground truth at a stamp; None if the ego's pose at exactly that time was not recorded.

    Args:
        stamp_ns: Time of the picture.
        topics: The topics with ground truth.
        latest: Returns the last sample of a topic at or before a stamp, or None if there is no recent one; odometry
            as (4, 4) map_from_ego.
    """

    def find(topic: str | None, before_ns: int) -> Sample | None:
        return latest(topic, before_ns) if topic is not None else None

    def pose_at(exactly_ns: int) -> Float64Array | None:
        sample = find(topics.odometry, exactly_ns)
        return sample[1] if sample is not None and sample[0] == exactly_ns else None

    map_from_ego = pose_at(stamp_ns)
    if map_from_ego is None:
        return None
    boxes, labels = find(topics.boxes, stamp_ns), find(topics.labels, stamp_ns)
    map_from_labels = pose_at(labels[0]) if labels else None
    return Truth(
        map_from_ego,
        None if boxes is None else boxes[1],
        None if labels is None or map_from_labels is None else labels[1],
        leveled_pose(map_from_ego if map_from_labels is None else map_from_labels),
    )


def leveled_pose(map_from_ego: Float64Array) -> Float64Array:
    """(4, 4) pose of the ego without its roll and pitch."""
    yaw_rad = rpy_from_rotation(map_from_ego[:3, :3])[2]
    return matrices_from_xyz_rpy(map_from_ego[:3, 3], np.array([0.0, 0.0, yaw_rad]))
