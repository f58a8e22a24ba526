"""Rotating lidar model: casts the rays of one turn into the scene and returns a point cloud and a semantic one. No ROS.

``lidar_pattern`` defines the ray directions, ``lidar_echo`` the strength of echoes, ``lidar_weather`` the effects of
rain and fog. By default all rays of a turn are cast at the time stamp, from the pose at the time stamp, as in CARLA:
the cloud is already motion-compensated, and ``time`` must not be used to do so again. A rolling scan casts each column
at its own ``time``, with the sensor and all actors at their poses of that time; its points are in the sensor frame of
that time, as those of a real lidar.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.config.lidar import Lidar
from simbev_ros.random import stream
from simbev_ros.raycast.scene import Hits, RayScene
from simbev_ros.scene.interpolation import ActorHistory
from simbev_ros.scene.state import WorldState, map_from_actors
from simbev_ros.sensors.lidar_echo import echo_strength, intensity, is_lost_at_low_intensity
from simbev_ros.sensors.lidar_pattern import ScanPattern
from simbev_ros.sensors.lidar_weather import LidarWeather
from simbev_ros.sensors.mount import map_from_sensor
from simbev_ros.types import Float32Array, Float64Array, Int64Array, Table

POINT_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, sensor frame
        ("y", "<f4"),
        ("z", "<f4"),
        ("intensity", "<f4"),  # 0..1
        ("ring", "<u2"),  # channel, 0 is the lowest unless configured otherwise
        ("time", "<f4"),  # s from the stamp, ≤ 0
    ]
)
"""Row of the table of returns, packed as Velodyne's XYZIRT: offsets 0 4 8 12 16 18, 22 bytes."""

SEMANTIC_POINT_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, sensor frame
        ("y", "<f4"),
        ("z", "<f4"),
        ("cos_angle", "<f4"),  # cosine of the angle between ray and surface normal, 0 grazing, 1 perpendicular
        ("object_id", "<u4"),  # id of the actor, 0 on static surfaces
        ("tag", "<u4"),  # semantic tag
        ("time", "<f4"),  # s from the stamp, ≤ 0
    ]
)
"""Row of the table of returns of the semantic lidar, without noise, loss or weather; 28 bytes."""


@dataclass(frozen=True, slots=True)
class LidarScan:
    """Point clouds of one turn, rows in firing order; a cloud that the lidar does not publish is None.

    Attributes:
        points: (M,) ``POINT_DTYPE``.
        semantic_points: (N,) ``SEMANTIC_POINT_DTYPE``.
    """

    points: Table | None
    semantic_points: Table | None


@dataclass(frozen=True, slots=True)
class _Rays:
    """(N,) rays in the map frame; if all are cast at the time stamp, ``origins_m`` is (1, 3) and ``lag_s`` None."""

    origins_m: Float64Array
    directions: Float32Array
    lag_s: Float64Array | None


@dataclass(frozen=True, slots=True)
class _Echoes:
    """(M,) echoes: ray indices, ascending, ranges, and strengths as defined in ``lidar_echo``."""

    ray: Int64Array
    range_m: Float32Array
    strength: Float32Array


class LidarModel:
    """A lidar of the sensor rig, as configured."""

    def __init__(self, lidar: Lidar, seed: int, turn_s: float) -> None:
        """Precompute the ray pattern.

        Args:
            lidar: Configuration of the lidar.
            seed: Seed of the scene.
            turn_s: Duration of a turn, from one cloud to the next.
        """
        self._lidar = lidar
        self._seed = seed
        self.pattern = ScanPattern.from_lidar(lidar, turn_s)
        self._time_s = self.pattern.time_s.astype(np.float32)

    def scan(self, scene: RayScene, state: WorldState, earlier: Sequence[WorldState] = ()) -> LidarScan:
        """Scan one turn that ends at a tick.

        Args:
            scene: Ray scene, already updated with the same states.
            state: World state at the time stamp.
            earlier: World states at the preceding ticks of the turn; only a rolling scan needs them.
        """
        lidar = self._lidar
        rays = self._rolling_rays(state, earlier) if lidar.rolling else self._rays(state)
        hits = scene.cast(rays.origins_m, rays.directions, rays.lag_s)
        returned = np.flatnonzero((hits.range_m >= lidar.min_range_m) & (hits.range_m <= lidar.range_m))
        return LidarScan(
            self._points(hits, returned, rays, state) if lidar.points else None,
            self._semantic_points(hits, returned) if lidar.semantic_points else None,
        )

    def _rays(self, state: WorldState) -> _Rays:
        pose = map_from_sensor(self._lidar.pose, state)
        directions = np.einsum("ni,ji->nj", self.pattern.directions, pose[:3, :3].astype(np.float32))
        return _Rays(pose[None, :3, 3], directions, None)

    def _rolling_rays(self, state: WorldState, earlier: Sequence[WorldState]) -> _Rays:
        pattern, channels = self.pattern, self._lidar.channels
        ego = ActorHistory.of(state, earlier).only(state.actors["id"] == state.ego_id)
        egos = ego.at(np.zeros(len(pattern.column_time_s), np.int64), -pattern.column_time_s)
        poses = map_from_actors(egos) @ self._lidar.pose.ego_from_sensor
        columns = pattern.directions.reshape(len(poses), channels, 3)
        directions = np.einsum("cri,cji->crj", columns, poses[:, :3, :3].astype(np.float32))
        origins_m = np.repeat(poses[:, :3, 3], channels, axis=0)
        return _Rays(origins_m, directions.reshape(-1, 3), -pattern.time_s)

    def _semantic_points(self, hits: Hits, returned: Int64Array) -> Table:
        cloud = np.empty(len(returned), SEMANTIC_POINT_DTYPE)
        self._write_positions(cloud, returned, hits.range_m[returned])
        cloud["cos_angle"] = hits.cos_angle[returned]
        cloud["object_id"] = hits.object_id[returned]
        cloud["tag"] = hits.tag[returned]
        return cloud

    def _points(self, hits: Hits, returned: Int64Array, rays: _Rays, state: WorldState) -> Table:
        """Returns that are not lost. Every ray has its own random numbers, whether it returns or not."""
        lidar, count = self._lidar, len(self._time_s)
        strength = echo_strength(hits.material[returned], hits.cos_angle[returned])
        echoes = _Echoes(returned, hits.range_m[returned], strength)
        air = LidarWeather(lidar, state.weather, float(rays.origins_m[-1, 2]))
        if not air.is_clear:
            echoes = self._apply_weather(air, echoes, hits, rays, state.tick)
        drop_off_rng, noise_rng = self._stream("drop_off", state.tick), self._stream("range_noise", state.tick)
        kept = drop_off_rng.random(count, np.float32)[echoes.ray] >= lidar.drop_off
        intensities = intensity(lidar, echoes.strength, echoes.range_m)
        if lidar.drop_off_at_zero_intensity > 0.0:
            uniform = self._stream("intensity_drop_off", state.tick).random(count, np.float32)
            kept &= ~is_lost_at_low_intensity(lidar, intensities, uniform[echoes.ray])
        ray = echoes.ray[kept]
        noise_m = noise_rng.standard_normal(count, np.float32)[ray] * np.float32(lidar.range_noise_sigma_m)
        cloud = np.empty(len(ray), POINT_DTYPE)
        self._write_positions(cloud, ray, np.maximum(echoes.range_m[kept] + noise_m, 0.0))
        cloud["intensity"] = intensities[kept]
        cloud["ring"] = self.pattern.ring[ray]
        return cloud

    def _apply_weather(self, air: LidarWeather, echoes: _Echoes, hits: Hits, rays: _Rays, tick: int) -> _Echoes:
        """The strongest echo of each ray in rain or fog: the weakened echo of the target, or that of the air."""
        rng, count = self._stream("weather", tick), len(self._time_s)
        uniform = rng.random(count, np.float32)
        transmission = air.two_way_transmission(echoes.range_m, rays.directions[echoes.ray, 2])
        is_detected = air.are_detected(echoes.strength, transmission, echoes.range_m, uniform[echoes.ray])
        strength, range_m = np.zeros(count, np.float32), hits.range_m.copy()
        strength[echoes.ray] = np.where(is_detected, echoes.strength * transmission, 0.0)
        echoes_of_air = air.air_echoes(count, rng)
        ahead = (echoes_of_air.range_m < range_m) & (echoes_of_air.range_m >= self._lidar.min_range_m)
        # Received power falls with the square of the range. Targets beyond the lidar's range were never received.
        near = np.flatnonzero(ahead)
        power = strength[near] / np.square(range_m[near])
        wins = near[echoes_of_air.strength[near] / np.square(echoes_of_air.range_m[near]) > power]
        strength[wins], range_m[wins] = echoes_of_air.strength[wins], echoes_of_air.range_m[wins]
        ray = np.flatnonzero(strength > 0.0)
        return _Echoes(ray, range_m[ray], strength[ray])

    def _stream(self, name: str, tick: int) -> np.random.Generator:
        return stream(self._seed, f"lidar.{self._lidar.name}.{name}", tick)

    def _write_positions(self, cloud: Table, ray: Int64Array, range_m: Float32Array) -> None:
        """Write positions and times of points into a cloud."""
        cloud["x"], cloud["y"], cloud["z"] = (self.pattern.directions[ray] * range_m[:, None]).T
        cloud["time"] = self._time_s[ray]
