"""Rotating lidar model: casts the rays of one turn into the scene and returns a point cloud and a semantic one. No ROS.

``lidar_pattern`` defines the ray directions, ``lidar_echo`` the strength of echoes, ``lidar_weather`` the effects of
rain and fog; products also have ``lidar_beam`` and ``lidar_receiver``. By default all rays of a turn are cast at the
time stamp, from the pose at the time stamp, as in CARLA: the cloud is already motion-compensated, and ``time`` is 0. A
rolling scan casts each column at its own ``time``, with the sensor and all actors at their poses of that time; its
points are in the sensor frame of that time, as those of a real lidar.

Threads can share a turn in blocks of columns. Every ray has its own random numbers, whether it returns or not, so that
the clouds do not depend on blocks and threads.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.threads import start
from simbev_ros.foundation.types import Float32Array, Int64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.scene.interpolation import ActorHistory
from simbev_ros.schema.points import POINT_DTYPE, SEMANTIC_POINT_DTYPE
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.raycast.scene import Hits, RayScene
from simbev_ros.simulation.sensors.lidar_beam import Echoes, Rays, edge_echoes, surface_echoes
from simbev_ros.simulation.sensors.lidar_echo import echo_strength, intensity, is_lost_at_low_intensity
from simbev_ros.simulation.sensors.lidar_pattern import ScanPattern
from simbev_ros.simulation.sensors.lidar_receiver import LidarReceiver
from simbev_ros.simulation.sensors.lidar_weather import AirEchoes, LidarWeather
from simbev_ros.simulation.sensors.mount import map_from_sensor


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
class LidarScanInProgress:
    """A turn that threads scan.

    Attributes:
        blocks: Its blocks of columns, in firing order.
    """

    blocks: Sequence[Future[LidarScan]]

    def result(self) -> LidarScan:
        """Wait for the whole turn."""
        return _joined([block.result() for block in self.blocks])


@dataclass(frozen=True, slots=True)
class _Draws:
    """Random numbers of (N,) rays; None: not needed."""

    drop_off: Float32Array
    range_noise: Float32Array
    intensity_drop_off: Float32Array | None
    weather: Float32Array | None
    air_echoes: AirEchoes | None
    beam: Float32Array | None
    detection: Float32Array | None


_MIN_RAYS_PER_BLOCK = 1 << 16
"""With smaller blocks, threads wait longer for Python's global lock than they compute."""


class LidarModel:
    """A lidar of the sensor rig, as configured."""

    def __init__(self, lidar: Lidar, seed: int, turn_s: float, max_blocks: int = 1) -> None:
        """Precompute the ray pattern.

        Args:
            lidar: Configuration of the lidar.
            seed: Seed of the scene.
            turn_s: Duration of a turn, from one cloud to the next.
            max_blocks: Number of blocks into which a turn is divided, if it has enough rays; as many as threads.
        """
        self._lidar = lidar
        self._seed = seed
        self._receiver = LidarReceiver(lidar, lidar.receiver) if lidar.receiver else None
        self._loses = lidar.drop_off > 0.0 or (lidar.receiver is not None and lidar.receiver.gain_step_db is not None)
        self._turn_s = turn_s
        self._aim(0.0)
        self._stretch = lidar.beam_divergence_mrad * 1e-3 / lidar.receiver.pulse_m if lidar.receiver else 0.0
        turns = lidar.rosette.turns_hz * turn_s if lidar.rosette else 1.0
        spacing_rad = turns * np.radians(lidar.horizontal_fov_deg) / lidar.columns
        self._beam_reach = lidar.beam_divergence_mrad * 1e-3 / 2.0 / spacing_rad
        blocks = min(max(len(self._time_s) // _MIN_RAYS_PER_BLOCK, 1), lidar.columns)
        # A receiver compares columns, though not across borders, so these must not depend on cores.
        if lidar.receiver is None:
            blocks = min(blocks, max_blocks)
        borders = (np.linspace(0, lidar.columns, blocks + 1).astype(int) * lidar.channels).tolist()
        self._borders = borders[1:-1]
        # Receivers call NumPy so often that twice as long blocks pay, unless their gain follows from column to column.
        step = 1 if lidar.receiver is None or lidar.receiver.gain_step_db else 2
        self._blocks = [slice(start, stop) for start, stop in pairwise([*borders[:-1:step], borders[-1]])]

    def _aim(self, end_s: float) -> None:
        """Compute the rays of the turn that ends at a time."""
        self.pattern = ScanPattern.from_lidar(self._lidar, self._turn_s, end_s)
        self._xyz = np.ascontiguousarray(self.pattern.directions.T)
        time_s = self.pattern.time_s.astype(np.float32)
        self._time_s = time_s if self._lidar.rolling else np.zeros_like(time_s)

    def scan(self, scene: RayScene, state: WorldState, earlier: Sequence[WorldState] = ()) -> LidarScan:
        """Scan one turn that ends at a tick.

        Args:
            scene: Ray scene, already updated with the same states.
            state: World state at the time stamp.
            earlier: World states at the preceding ticks of the turn; only a rolling scan needs them.
        """
        return _joined([scan_block() for scan_block in self._scan_blocks(scene, state, earlier, None)])

    def start_scan(
        self, scene: RayScene, state: WorldState, earlier: Sequence[WorldState], threads: ThreadPoolExecutor
    ) -> LidarScanInProgress:
        """Let threads scan one turn, as ``scan`` does; the scene must not be updated before they are done."""
        return LidarScanInProgress(list(map(threads.submit, self._scan_blocks(scene, state, earlier, threads))))

    def _scan_blocks(
        self,
        scene: RayScene,
        state: WorldState,
        earlier: Sequence[WorldState],
        threads: ThreadPoolExecutor | None,
    ) -> list[Callable[[], LidarScan]]:
        """Functions that scan the blocks of a turn, which threads may call at the same time."""
        lidar, count = self._lidar, len(self._time_s)
        if lidar.rosette is not None:
            self._aim(state.stamp_ns / NS_PER_S)
        rays_of = self._rolling_rays(state, earlier) if lidar.rolling else self._rays(state)
        height_m = float(rays_of(slice(count - lidar.channels, count)).origins_m[-1, 2])
        air = LidarWeather(lidar, state.weather, height_m)
        draws_of = self._draw(air, state.tick, threads) if lidar.points else None
        wetness = state.weather.wetness / 100.0

        def scan_block(block: slice) -> LidarScan:
            rays = rays_of(block)
            hits = scene.cast(rays.origins_m, rays.directions, rays.lag_s)
            returned = np.flatnonzero((hits.range_m >= lidar.min_range_m) & (hits.range_m <= lidar.range_m))
            if draws_of is None:
                points = None
            elif self._receiver is None:
                points = self._points(hits, returned, rays, air, draws_of(block), block)
            else:
                points = self._received(self._receiver, scene, hits, rays, air, draws_of(block), block, wetness)
            return LidarScan(
                points,
                self._semantic_points(hits, returned, block) if lidar.semantic_points else None,
            )

        return [partial(scan_block, block) for block in self._blocks]

    def _rays(self, state: WorldState) -> Callable[[slice], Rays]:
        """The function that returns some of the turn's rays."""
        pose = map_from_sensor(self._lidar.pose, state)
        rotation = pose[:3, :3].astype(np.float32)

        def rays_of(block: slice) -> Rays:
            return Rays(pose[None, :3, 3], _turned(self._xyz[:, block], rotation), None)

        return rays_of

    def _rolling_rays(self, state: WorldState, earlier: Sequence[WorldState]) -> Callable[[slice], Rays]:
        """The function that returns the rays of some whole columns."""
        pattern, channels = self.pattern, self._lidar.channels
        egos = ActorHistory.of_ego(state, earlier).at(
            np.zeros(len(pattern.column_time_s), np.int64), -pattern.column_time_s
        )
        poses_of_columns = map_from_actors(egos) @ self._lidar.pose.ego_from_sensor

        def rays_of(block: slice) -> Rays:
            poses = poses_of_columns[block.start // channels : block.stop // channels]
            columns = self._xyz[:, block].reshape(3, len(poses), channels)
            directions = _turned(columns, poses[:, :3, :3].astype(np.float32))
            origins_m = np.repeat(poses[:, :3, 3], channels, axis=0)
            return Rays(origins_m, directions, -pattern.time_s[block])

        return rays_of

    def _draw(self, air: LidarWeather, tick: int, threads: ThreadPoolExecutor | None) -> Callable[[slice], _Draws]:
        """Start to draw the random numbers of all rays; the function that returns those of some rays."""
        lidar, count = self._lidar, len(self._time_s)

        def rng_of(name: str) -> np.random.Generator:
            return stream(self._seed, f"lidar.{lidar.name}.{name}", tick)

        def draw_weather() -> tuple[Float32Array, AirEchoes]:
            rng = rng_of("weather")
            return rng.random(count, np.float32), air.air_echoes(count, rng)

        def draw_beam() -> Float32Array:
            uniform = rng_of("beam").random((count, 3), np.float32)
            for border in self._borders:
                uniform[border - lidar.channels : border, 2] = np.nan
            return uniform

        range_noise = start(threads, lambda: rng_of("range_noise").standard_normal(count, np.float32))
        drop_off = start(
            threads, lambda: rng_of("drop_off").random(count, np.float32) if self._loses else np.ones(count, np.float32)
        )
        has_dropped = lidar.drop_off_at_zero_intensity > 0.0
        dropped = start(
            threads, lambda: rng_of("intensity_drop_off").random(count, np.float32) if has_dropped else None
        )
        weather = start(threads, lambda: None if air.is_clear else draw_weather())
        receives = self._receiver is not None
        beam = start(threads, lambda: draw_beam() if receives else None)
        detection = start(threads, lambda: rng_of("detection").standard_normal(count, np.float32) if receives else None)

        def draws_of(block: slice) -> _Draws:
            intensity_drop_off, of_weather, of_beam, of_detection = dropped(), weather(), beam(), detection()
            return _Draws(
                drop_off=drop_off()[block],
                range_noise=range_noise()[block],
                intensity_drop_off=None if intensity_drop_off is None else intensity_drop_off[block],
                weather=None if of_weather is None else of_weather[0][block],
                air_echoes=None if of_weather is None else of_weather[1].of(block),
                beam=None if of_beam is None else of_beam[block],
                detection=None if of_detection is None else of_detection[block],
            )

        return draws_of

    def _semantic_points(self, hits: Hits, returned: Int64Array, block: slice) -> Table:
        cloud = np.empty(len(returned), SEMANTIC_POINT_DTYPE)
        self._write_positions(cloud, returned, hits.range_m.take(returned), block)
        cloud["cos_angle"] = hits.cos_angle.take(returned)
        cloud["object_id"] = hits.object_id.take(returned)
        cloud["tag"] = hits.tag.take(returned)
        return cloud

    def _points(
        self, hits: Hits, returned: Int64Array, rays: Rays, air: LidarWeather, draws: _Draws, block: slice
    ) -> Table:
        """Returns of a block of rays that are not lost."""
        lidar = self._lidar
        strength = echo_strength(hits.material[returned], hits.cos_angle[returned])
        echoes = Echoes(returned, hits.range_m[returned], strength)
        if draws.weather is not None and draws.air_echoes is not None:
            echoes = self._apply_weather(air, echoes, hits, rays, draws.weather, draws.air_echoes)
        kept = draws.drop_off[echoes.ray] >= lidar.drop_off
        intensities = intensity(lidar, echoes.strength, echoes.range_m)
        if draws.intensity_drop_off is not None:
            kept &= ~is_lost_at_low_intensity(lidar, intensities, draws.intensity_drop_off[echoes.ray])
        ray = echoes.ray[kept]
        noise_m = draws.range_noise[ray] * np.float32(lidar.range_noise_sigma_m)
        return self._cloud(ray, np.maximum(echoes.range_m[kept] + noise_m, 0.0), intensities[kept], block)

    def _received(
        self,
        receiver: LidarReceiver,
        scene: RayScene,
        hits: Hits,
        rays: Rays,
        air: LidarWeather,
        draws: _Draws,
        block: slice,
        wetness: float,
    ) -> Table:
        """Returns of a block of rays, by the power of their echoes."""
        assert draws.beam is not None
        assert draws.detection is not None
        first, others = surface_echoes(
            rays, hits, draws.beam[:, :2], scene, wetness, self._stretch, self._lidar.returns == "strongest"
        )
        first, cut = edge_echoes(first, self._lidar.channels, self._beam_reach, draws.beam[:, 2])
        others = Echoes.joined([cut, others])
        if draws.air_echoes is not None:
            first, others = (
                each.times(air.two_way_transmission(each.range_m, rays.directions[each.ray, 2]))
                for each in (first, others)
            )
            ahead = np.flatnonzero(draws.air_echoes.range_m < hits.range_m)
            in_air = Echoes(ahead, draws.air_echoes.range_m[ahead], draws.air_echoes.strength[ahead])
            others = Echoes.joined([others, in_air])
        detected, ratio = receiver.detect(first, others, draws.detection)
        if self._loses:
            kept = draws.drop_off.take(detected.ray) >= self._lidar.drop_off
            kept &= receiver.keeps(detected, ratio, 1.0 - draws.drop_off)
            detected, ratio = detected.of(kept), ratio[kept]
        range_m = receiver.measured_m(detected, ratio, draws.range_noise.take(detected.ray))
        return self._cloud(detected.ray, range_m, receiver.intensity(detected), block)

    def _cloud(self, ray: Int64Array, range_m: Float32Array, intensities: Float32Array, block: slice) -> Table:
        """The points of returns of a block of rays."""
        cloud = np.empty(len(ray), POINT_DTYPE)
        self._write_positions(cloud, ray, range_m, block)
        cloud["intensity"] = intensities
        cloud["ring"] = self.pattern.ring[block].take(ray)
        return cloud

    def _apply_weather(
        self,
        air: LidarWeather,
        echoes: Echoes,
        hits: Hits,
        rays: Rays,
        uniform: Float32Array,
        echoes_of_air: AirEchoes,
    ) -> Echoes:
        """The strongest echo of each ray in rain or fog: the weakened echo of the target, or that of the air."""
        transmission = air.two_way_transmission(echoes.range_m, rays.directions[echoes.ray, 2])
        is_detected = air.are_detected(echoes.strength, transmission, echoes.range_m, uniform[echoes.ray])
        strength, range_m = np.zeros(len(uniform), np.float32), hits.range_m.copy()
        strength[echoes.ray] = np.where(is_detected, echoes.strength * transmission, 0.0)
        ahead = (echoes_of_air.range_m < range_m) & (echoes_of_air.range_m >= self._lidar.min_range_m)
        # Received power falls with the square of the range. Targets beyond the lidar's range were never received.
        near = np.flatnonzero(ahead)
        power = strength[near] / np.square(range_m[near])
        wins = near[echoes_of_air.strength[near] / np.square(echoes_of_air.range_m[near]) > power]
        strength[wins], range_m[wins] = echoes_of_air.strength[wins], echoes_of_air.range_m[wins]
        ray = np.flatnonzero(strength > 0.0)
        return Echoes(ray, range_m[ray], strength[ray])

    def _write_positions(self, cloud: Table, ray: Int64Array, range_m: Float32Array, block: slice) -> None:
        """Write positions and times of points into the cloud of a block of rays."""
        for name, directions in zip("xyz", self._xyz[:, block], strict=True):
            cloud[name] = directions.take(ray) * range_m
        cloud["time"] = self._time_s[block].take(ray)


def _turned(xyz: Float32Array, rotation: Float32Array) -> Float32Array:
    """(N, 3) directions from (3, N) ones and a (3, 3) rotation, or from (3, C, N / C) ones and (C, 3, 3) rotations."""
    directions = np.empty((*xyz.shape[1:], 3), np.float32)
    x, y, z = xyz
    for axis in range(3):
        by_x, by_y, by_z = np.moveaxis(rotation[..., axis, :, None], -2, 0)
        directions[..., axis] = x * by_x + y * by_y + z * by_z
    return directions.reshape(-1, 3)


def _joined(scans: Sequence[LidarScan]) -> LidarScan:
    """The scan of a turn from those of its blocks."""
    return LidarScan(_rows([scan.points for scan in scans]), _rows([scan.semantic_points for scan in scans]))


def _rows(tables: Sequence[Table | None]) -> Table | None:
    """The rows of all tables; None if there is none."""
    present = [table for table in tables if table is not None]
    if len(present) < 2:
        return present[0] if present else None
    rows: Table = np.concatenate([table.view(np.uint8) for table in present]).view(present[0].dtype)
    return rows  # joined as bytes, because NumPy copies rows of several columns value by value
