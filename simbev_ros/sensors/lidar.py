"""Rotating lidar and semantic lidar: world state and rays in, two clouds out. No ROS.

A turn starts behind the sensor (-x) and runs clockwise seen from above: behind, left, ahead, right. Column c of C looks
at azimuth π - 2π (c + ½) / C and is fired (c + 1 - C) / C of a turn after the stamp, i.e. the last column at the stamp.
Ring 0 is the lowest. All rays are cast at the stamp and from the pose at the stamp, as in CARLA: the cloud is already
compensated for the motion during the turn, and ``time`` must not be used to do so again.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.assets.materials import load_materials
from simbev_ros.config.lidar import Lidar
from simbev_ros.random import stream
from simbev_ros.raycast.scene import Hits, RayScene
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.mount import map_from_sensor
from simbev_ros.types import Float32Array, Int64Array, Table, UInt16Array

POINT_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, sensor frame
        ("y", "<f4"),
        ("z", "<f4"),
        ("intensity", "<f4"),  # 0..1
        ("ring", "<u2"),  # 0 is the lowest
        ("time", "<f4"),  # s from the stamp, ≤ 0
    ]
)
"""One row per return, packed as Velodyne's XYZIRT: offsets 0 4 8 12 16 18, 22 bytes."""

SEMANTIC_POINT_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, sensor frame
        ("y", "<f4"),
        ("z", "<f4"),
        ("cos_angle", "<f4"),  # between the ray and the surface's normal, 0 grazing, 1 perpendicular
        ("object_id", "<u4"),  # id of the actor, 0 on static surfaces
        ("tag", "<u4"),  # semantic tag
    ]
)
"""One row per return of the semantic lidar, without noise and without loss; 24 bytes."""

_ATTENUATION_PER_M = 0.004
"""Loss of intensity in air; CARLA's default ``atmosphere_attenuation_rate``."""


@dataclass(frozen=True, slots=True)
class LidarScan:
    """One turn; rows in firing order, rings upward within a column.

    Attributes:
        points: (M,) ``POINT_DTYPE``.
        semantic_points: (N,) ``SEMANTIC_POINT_DTYPE``.
    """

    points: Table
    semantic_points: Table


class LidarModel:
    """A lidar of the rig."""

    def __init__(self, lidar: Lidar, seed: int, turn_s: float) -> None:
        """Prepares the rays.

        Args:
            lidar: Its configuration.
            seed: The scene's seed.
            turn_s: Duration of a turn, from one cloud to the next.
        """
        self._lidar = lidar
        self._seed = seed
        self.directions: Float32Array = _directions(lidar)
        """(columns · channels, 3) unit vectors in the sensor frame, in firing order."""
        columns, channels = np.arange(lidar.columns), np.arange(lidar.channels)
        self._ring: UInt16Array = np.tile(channels, lidar.columns).astype(np.uint16)
        self._time_s = np.repeat((columns + 1 - lidar.columns) / lidar.columns * turn_s, lidar.channels)
        self._reflectance = load_materials().lidar_reflectance

    def scan(self, scene: RayScene, state: WorldState) -> LidarScan:
        """The clouds of one tick; ``scene`` has been updated with the same state."""
        pose = map_from_sensor(self._lidar.pose, state)
        hits = scene.cast(pose[None, :3, 3], self.directions @ pose[:3, :3].T.astype(np.float32))
        returned = np.flatnonzero(hits.range_m <= self._lidar.range_m)
        cos_angle = self._cos_angle(hits, returned, pose[:3, :3].astype(np.float32))
        return LidarScan(
            self._points(hits, returned, cos_angle, state.tick), self._semantic_points(hits, returned, cos_angle)
        )

    def _cos_angle(self, hits: Hits, returned: Int64Array, map_from_sensor: Float32Array) -> Float32Array:
        """(M,) cosine between the returned rays and the normals of what they hit."""
        normal_sensor = hits.normal[returned] @ map_from_sensor
        cosine: Float32Array = -np.einsum("ni,ni->n", normal_sensor, self.directions[returned])
        return np.clip(cosine, 0.0, 1.0)

    def _semantic_points(self, hits: Hits, returned: Int64Array, cos_angle: Float32Array) -> Table:
        cloud = np.empty(len(returned), SEMANTIC_POINT_DTYPE)
        _fill_xyz(cloud, self.directions[returned] * hits.range_m[returned, None])
        cloud["cos_angle"] = cos_angle
        cloud["object_id"] = hits.object_id[returned]
        cloud["tag"] = hits.tag[returned]
        return cloud

    def _points(self, hits: Hits, returned: Int64Array, cos_angle: Float32Array, tick: int) -> Table:
        """Returns that are not lost. Every ray has its own draw, whether it returns or not."""
        lidar, count = self._lidar, len(self.directions)
        name = f"lidar.{lidar.name}"
        lottery = stream(self._seed, f"{name}.drop_off", tick).random(count, np.float32)
        noise_m = stream(self._seed, f"{name}.range_noise", tick).standard_normal(count, np.float32)
        kept = lottery[returned] >= lidar.drop_off
        ray = returned[kept]
        range_m = hits.range_m[ray]
        cloud = np.empty(len(ray), POINT_DTYPE)
        noisy_m = np.maximum(range_m + noise_m[ray] * np.float32(lidar.range_noise_sigma_m), 0.0)
        _fill_xyz(cloud, self.directions[ray] * noisy_m[:, None])
        attenuation = np.exp(-_ATTENUATION_PER_M * range_m)
        cloud["intensity"] = self._reflectance[hits.material[ray]] * cos_angle[kept] * attenuation
        cloud["ring"] = self._ring[ray]
        cloud["time"] = self._time_s[ray]
        return cloud


def _directions(lidar: Lidar) -> Float32Array:
    elevation = np.radians(np.linspace(lidar.lower_fov_deg, lidar.upper_fov_deg, lidar.channels))
    azimuth = np.pi - 2.0 * np.pi * (np.arange(lidar.columns) + 0.5) / lidar.columns
    azimuth, elevation = (angle.ravel() for angle in np.meshgrid(azimuth, elevation, indexing="ij"))
    level = np.cos(elevation)
    xyz = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=1)
    return xyz.astype(np.float32)


def _fill_xyz(cloud: Table, points: Float32Array) -> None:
    cloud["x"], cloud["y"], cloud["z"] = points.T
