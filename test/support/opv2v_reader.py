"""Reads an agent's files in OPV2V's layout as its readers do, from CARLA's formulas and without code of the exporter.

Transforms are between CARLA's left-handed frames: x forward, y to the right, z up.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from simbev_ros.foundation.types import Float64Array, UInt8Array

CORNER_SIGNS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)


class AgentFrame:
    """One agent's files of one frame.

    Attributes:
        meta: Content of the YAML file.
    """

    def __init__(self, folder: Path, tick: int) -> None:
        self._stem = folder / f"{tick:06d}"
        self.meta: dict[str, Any] = yaml.safe_load(self._stem.with_suffix(".yaml").read_text())

    @property
    def world_from_lidar(self) -> Float64Array:
        """(4, 4) pose of the lidar."""
        return world_from(self.meta["lidar_pose"])

    def cloud(self) -> tuple[Float64Array, Float64Array]:
        """(N, 3) points in the lidar's frame, and their (N,) intensities from 0 to 1, read by Open3D."""
        import open3d

        cloud = open3d.io.read_point_cloud(str(self._stem.with_suffix(".pcd")))
        return np.asarray(cloud.points), np.asarray(cloud.colors).reshape(-1, 3)[:, 0]

    def image(self, number: int) -> UInt8Array:
        """(H, W, 3) RGB image of a camera."""
        image = cv2.imread(f"{self._stem}_camera{number}.png", cv2.IMREAD_UNCHANGED)
        assert image is not None
        return np.asarray(image[..., ::-1], np.uint8)

    def corners_in_lidar(self, vehicle: int) -> Float64Array:
        """(8, 3) corners of a vehicle's box in the lidar's frame, in the order of ``CORNER_SIGNS``."""
        lidar_from_box = np.linalg.inv(self.world_from_lidar) @ self._world_from_box(vehicle)
        return moved(lidar_from_box, CORNER_SIGNS * self.meta["vehicles"][vehicle]["extent"])

    def in_box(self, vehicle: int, points_world: Float64Array) -> Float64Array:
        """(N, 3) points in the frame of a vehicle's box, whose origin is its center."""
        return moved(np.linalg.inv(self._world_from_box(vehicle)), points_world)

    def _world_from_box(self, vehicle: int) -> Float64Array:
        box: Mapping[str, Any] = self.meta["vehicles"][vehicle]
        return world_from([*(np.array(box["location"]) + box["center"]), *box["angle"]])


def world_from(pose: Sequence[float]) -> Float64Array:
    """(4, 4) transform of CARLA for x, y, z, roll, yaw, pitch; meters and degrees."""
    x, y, z, *angles_deg = pose
    roll, yaw, pitch = map(math.radians, angles_deg)
    cr, sr, cy, sy, cp, sp = (f(each) for each in (roll, yaw, pitch) for f in (math.cos, math.sin))
    return np.array(
        [
            [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr, x],
            [sy * cp, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr, y],
            [sp, -cp * sr, cp * cr, z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def moved(target_from_source: Float64Array, points: Float64Array) -> Float64Array:
    """(N, 3) points in the target frame."""
    return points @ target_from_source[:3, :3].T + target_from_source[:3, 3]
