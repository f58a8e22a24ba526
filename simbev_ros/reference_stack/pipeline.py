"""The whole stack without ROS: turns a cloud and the ego's pose into boxes and scores."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.reference_stack.arrays import Bytes, Floats, Integers, Table, rotate, yaw_of
from simbev_ros.reference_stack.box_fit import fit_rectangles
from simbev_ros.reference_stack.classes import load_kinds
from simbev_ros.reference_stack.clusters import find_clusters
from simbev_ros.reference_stack.grid import GridShape, RoadMemory, box_scores
from simbev_ros.reference_stack.ground import RANGE_M, find_ground
from simbev_ros.reference_stack.readings import Resolution, read_rectangles
from simbev_ros.reference_stack.tracker import Tracker, scores

BOX_DTYPE = np.dtype(
    [
        ("x", "<f8"),  # m, map frame: center of the box
        ("y", "<f8"),
        ("z", "<f8"),
        ("length", "<f4"),  # m
        ("width", "<f4"),
        ("height", "<f4"),
        ("yaw", "<f4"),  # rad, about z
        ("vx", "<f4"),  # m/s over ground, map frame
        ("vy", "<f4"),
        ("vz", "<f4"),
        ("score", "<f4"),  # 0 … 1
        ("id", "<i4"),  # of the track; -1: of none
        ("class", "u1"),  # as in /world/legend
    ]
)
"""One row per box: the fields of /prediction/boxes."""

_OWN_HALF_M = np.array([2.8, 1.3])
"""Half length and width around the ego's origin; closer points belong to the ego vehicle or are rain."""
_MIN_SCORE = 0.03


@dataclass(frozen=True)
class Answer:
    """The stack's answer to one cloud.

    Attributes:
        boxes: (N,) boxes, ``BOX_DTYPE``.
        scores: (rows, columns, channels) scores of ``grid.CHANNELS``, 255 = certain.
    """

    boxes: Table
    scores: Bytes


class Pipeline:
    """Answers the clouds of one lidar in the order of their stamps.

    Args:
        ego_from_lidar: (4, 4) pose of the lidar in the ego frame: x forward, z up, origin on the ground.
        shape: Shape of the score grid.
    """

    def __init__(self, ego_from_lidar: Floats, shape: GridShape) -> None:
        self._ego_from_lidar, self._shape = ego_from_lidar, shape
        self._kinds = load_kinds()
        self._tracker = Tracker(self._kinds)
        self._road = RoadMemory(shape)

    def step(self, points_lidar: Floats, ring: Integers, map_from_ego: Floats, stamp_s: float) -> Answer:
        """Answer a cloud.

        Args:
            points_lidar: (N, 3) points in the lidar's frame; points that are not finite are ignored.
            ring: (N,) lidar ring of each point.
            map_from_ego: (4, 4) pose of the ego at the stamp.
            stamp_s: Stamp of the cloud, s.
        """
        finite = np.isfinite(points_lidar).all(axis=1)
        points_lidar, ring = points_lidar[finite], ring[finite]
        ego_from_lidar = self._ego_from_lidar
        points_ego = rotate(ego_from_lidar[:3, :3], points_lidar) + ego_from_lidar[:3, 3]
        is_outside = (np.abs(points_ego[:, :2]) > _OWN_HALF_M).any(axis=1)
        points_ego = points_ego[is_outside & (np.hypot(points_ego[:, 0], points_ego[:, 1]) < RANGE_M)]
        ground = find_ground(points_ego)
        rectangles = fit_rectangles(find_clusters(points_ego, ground.height_m))
        resolution = resolution_of(points_lidar, ring)
        readings = read_rectangles(rectangles, self._kinds, ego_from_lidar[:2, 3], resolution)
        boxes = self._boxes(self._tracker.step(readings.in_map(map_from_ego), stamp_s, yaw_of(map_from_ego)))
        grid = box_scores(boxes, self._kinds, self._shape, map_from_ego)
        grid[..., 0] = self._road.add_ground(ground, map_from_ego)
        return Answer(boxes, grid)

    def _boxes(self, tracks: Table) -> Table:
        score = scores(tracks, self._kinds)
        tracks, score = tracks[score >= _MIN_SCORE], score[score >= _MIN_SCORE]
        boxes = np.zeros(len(tracks), BOX_DTYPE)
        boxes["x"], boxes["y"], boxes["vx"], boxes["vy"] = tracks["state"].T
        boxes["length"], boxes["width"], boxes["height"] = tracks["size_m"].T
        boxes["z"] = tracks["ground_m"] + tracks["size_m"][:, 2] / 2
        boxes["yaw"] = np.angle(np.exp(1j * tracks["yaw"]))
        boxes["score"], boxes["id"] = score, tracks["id"]
        boxes["class"] = self._kinds.class_number[tracks["kind"]]
        return boxes


def resolution_of(points_lidar: Floats, ring: Integers) -> Resolution:
    """Angles between neighboring rays, from a cloud of (N, 3) finite points and (N,) rings."""
    count = np.bincount(ring, minlength=1)
    elevation = np.arctan2(points_lidar[:, 2], np.hypot(points_lidar[:, 0], points_lidar[:, 1]))
    used = count > 0
    ring_elevation = np.bincount(ring, elevation, minlength=1)[used] / count[used]
    ring_rad = float(np.median(np.diff(np.sort(ring_elevation)))) if used.sum() > 1 else 0.0
    return Resolution(ring_rad, 2 * np.pi / max(int(count.max()), 1))
