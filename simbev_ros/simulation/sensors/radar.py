"""Radar model: casts random rays into the scene and returns one cloud of detections per radar. No ROS.

Every scan casts new random rays into the field of view, and each ray that hits something within range gives one
detection, as in CARLA (where rays end on a plane at that range, so that off-axis rays reach further). A detection
describes a surface point by its range and angles, its relative velocity along the ray, and the returned power. With a
``detector``, ``radar_targets`` gathers them into the targets of a product. ``radar_errors`` then adds errors.
"""

from collections.abc import Sequence

import numpy as np

from simbev_ros.config.radar import Radar
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.points import RADAR_POINT_DTYPE, RADAR_TARGET_DTYPE, radar_rcs_dbsm
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.scene import Hits, RayScene
from simbev_ros.simulation.sensors.mount import map_from_sensor, vector
from simbev_ros.simulation.sensors.radar_amplitude import (
    amplitude_db,
    areas_m2,
    from_db,
    load_cross_sections,
    rain_loss_db_per_m,
)
from simbev_ros.simulation.sensors.radar_errors import apply_errors
from simbev_ros.simulation.sensors.radar_ghosts import Scan, trace_ghosts
from simbev_ros.simulation.sensors.radar_rays import random_rays
from simbev_ros.simulation.sensors.radar_targets import Scatterers, find_targets

_DRAWS_PER_RAY = 5
"""Number of normal random numbers per ray that the noise needs."""


class RadarModel:
    """A radar of the sensor rig, as configured; ``scan_radars`` runs one or more of them."""

    def __init__(self, radar: Radar, seed: int, scan_s: float) -> None:
        """Create the model, and that of the second scan.

        Args:
            radar: Configuration of the radar.
            seed: Seed of the scene.
            scan_s: Time from one scan to the next.
        """
        self.radar = radar
        self.scans = (self, *(RadarModel(each, seed, scan_s) for each in radar.scans_of_cycle[1:]))
        self.rays = max(1, round(radar.points_per_second * scan_s))
        solid_angle = np.radians(radar.horizontal_fov_deg) * 2.0 * np.sin(np.radians(radar.vertical_fov_deg) / 2.0)
        self._ray_sr = float(solid_angle / self.rays)
        self._seed = seed
        self._cross_sections = load_cross_sections()

    def directions(self, tick: int) -> Float64Array:
        """(rays, 3) unit vectors, sensor frame, of the random rays of a tick."""
        return random_rays(self.radar, self.rays, self._stream("rays", tick))

    def detections(
        self,
        map_from_radar: Float64Array,
        directions: Float64Array,
        hits: Hits,
        velocity_mps: Float64Array,
        state: WorldState,
        ghosts: Sequence[Scatterers] = (),
    ) -> Table:
        """Detections of one scan: the hits within range, with their velocities, amplitudes and errors.

        Args:
            map_from_radar: (4, 4) pose of the radar, map frame.
            directions: (rays, 3) unit vectors from ``directions``.
            hits: (rays,) hits of these rays.
            velocity_mps: (rays, 3) velocities of the hit points, map axes.
            state: World state now.
            ghosts: Further scatterers that a detector hears, from ``ghosts``.

        Returns:
            (N,) ``RADAR_POINT_DTYPE``, in the order of the rays; with a detector (N,) ``RADAR_TARGET_DTYPE``, nearest
            first.
        """
        radar, sections = self.radar, self._cross_sections
        ray = np.flatnonzero((hits.range_m >= radar.min_range_m) & (hits.range_m <= radar.range_m))
        hits, directions = hits.of(ray), directions[ray]
        directions_map = directions @ map_from_radar[:3, :3].T
        range_m, cos_angle = hits.range_m.astype(np.float64), hits.cos_angle.astype(np.float64)
        speed_mps = np.einsum("ni,ni->n", velocity_mps[ray] - _own_velocity(map_from_radar, state), directions_map)
        place = range_m, speed_mps, *_angles(directions)
        if radar.detector is None:
            section_m2 = sections.at_incidence(hits.material, hits.tag, cos_angle)
            table = _table(RADAR_POINT_DTYPE, self._amplitude_db(section_m2, range_m, state), *place)
        else:
            section_m2 = sections.per_m2(hits.material, cos_angle) * areas_m2(self._ray_sr, range_m, cos_angle)
            seen = Scatterers(from_db(self._amplitude_db(section_m2, range_m, state)), *place)
            heard = Scatterers(*map(np.concatenate, zip(seen, *ghosts, strict=True)))
            found = find_targets(radar, radar.detector, heard, self._stream("speckle", state.tick))
            table = _table(RADAR_TARGET_DTYPE, 10.0 * np.log10(found.power), *found[1:])
            ray = np.arange(len(table))
        table = apply_errors(radar, table, ray, lambda: self._noise(state.tick))
        if not radar.measures_elevation:
            table["elevation"] = 0.0
        _fill_derived(table, radar.reference_range_m)
        return table

    def ghosts(
        self,
        scene: RayScene,
        map_from_radar: Float64Array,
        directions: Float64Array,
        hits: Hits,
        state: WorldState,
        previous: WorldState | None,
    ) -> list[Scatterers]:
        """Scatterers that the radar hears by way of walls; none unless its configuration asks for them.

        Args:
            scene: What the rays were cast into.
            map_from_radar: (4, 4) pose of the radar, map frame.
            directions: (rays, 3) unit vectors from ``directions``.
            hits: (rays,) hits of these rays.
            state: World state now.
            previous: World state one tick ago, or None.
        """
        radar, radar_from_map = self.radar, map_from_radar[:3, :3].T
        if not radar.ghosts:
            return []
        scan = Scan(
            map_from_radar, _own_velocity(map_from_radar, state), directions @ radar_from_map, hits, self._ray_sr
        )
        echoes = trace_ghosts(radar, self._cross_sections, scene, scan, previous if radar.micro_doppler else None)
        power = from_db(self._amplitude_db(echoes.section_m2, echoes.spread_m, state))
        heard = Scatterers(power, echoes.range_m, echoes.speed_mps, *_angles(echoes.directions @ radar_from_map.T))
        within = (echoes.range_m >= radar.min_range_m) & (echoes.range_m <= radar.range_m)
        return [Scatterers(*(column[within] for column in heard))]

    def _amplitude_db(self, section_m2: Float64Array, range_m: Float64Array, state: WorldState) -> Float64Array:
        clear_db = amplitude_db(section_m2, range_m, self.radar.reference_range_m)
        if not self.radar.rain_attenuation:
            return clear_db
        return clear_db - rain_loss_db_per_m(state.weather) * range_m

    def _noise(self, tick: int) -> Float64Array:
        return self._stream("noise", tick).standard_normal((self.rays, _DRAWS_PER_RAY))

    def _stream(self, purpose: str, tick: int) -> np.random.Generator:
        return stream(self._seed, f"radar.{self.radar.name}.{purpose}", tick)


def scan_radars(
    models: Sequence[RadarModel], scene: RayScene, state: WorldState, previous: WorldState | None
) -> list[Table]:
    """Scan with all radars at once, casting their rays in one batch.

    Args:
        models: Radars of the rig.
        scene: Ray scene, already updated with ``state``.
        state: World state now.
        previous: World state one tick ago; if None, wheels and limbs move with their bodies.

    Returns:
        Per radar, (N,) ``RADAR_POINT_DTYPE`` detections or ``RADAR_TARGET_DTYPE`` targets.
    """
    if not models:
        return []
    scans = [scan for model in models for scan in model.scans]
    poses = [map_from_sensor(scan.radar.pose, state) for scan in scans]
    counts = [scan.rays for scan in scans]
    directions = [scan.directions(state.tick) for scan in scans]
    origins_m = np.repeat([pose[:3, 3] for pose in poses], counts, axis=0)
    directions_map = np.concatenate([each @ pose[:3, :3].T for each, pose in zip(directions, poses, strict=True)])
    hits = scene.cast(origins_m, directions_map)
    points_m = origins_m + directions_map * np.where(np.isfinite(hits.range_m), hits.range_m, 0.0)[:, None]
    velocity_mps = scene.velocities(hits, points_m)
    micro_doppler_rays = np.flatnonzero(np.repeat([scan.radar.micro_doppler for scan in scans], counts))
    if previous is not None and len(micro_doppler_rays):
        velocity_mps[micro_doppler_rays] = scene.velocities(
            hits.of(micro_doppler_rays), points_m[micro_doppler_rays], previous
        )
    rays_of_scan = np.split(np.arange(len(directions_map)), np.cumsum(counts)[:-1])
    clouds = (
        scan.detections(
            pose,
            each,
            hits.of(rays),
            velocity_mps[rays],
            state,
            scan.ghosts(scene, pose, each, hits.of(rays), state, previous),
        )
        for scan, pose, each, rays in zip(scans, poses, directions, rays_of_scan, strict=True)
    )
    return [np.concatenate([next(clouds) for _ in model.scans]) for model in models]


def _own_velocity(map_from_radar: Float64Array, state: WorldState) -> Float64Array:
    """(3,) velocity of the radar, m/s, map axes, including the ego's rotation about its origin."""
    arm_m = map_from_radar[:3, 3] - vector(state.ego, "x y z")
    return vector(state.ego, "vx vy vz") + np.cross(vector(state.ego, "wx wy wz"), arm_m)


def _angles(directions: Float64Array) -> tuple[Float64Array, Float64Array]:
    """(N,) azimuths and (N,) elevations, rad, of (N, 3) unit vectors in the sensor frame."""
    return np.arctan2(directions[:, 1], directions[:, 0]), np.arcsin(np.clip(directions[:, 2], -1.0, 1.0))


def _table(
    dtype: np.dtype[np.void],
    power_db: Float64Array,
    range_m: Float64Array,
    speed_mps: Float64Array,
    azimuth_rad: Float64Array,
    elevation_rad: Float64Array,
) -> Table:
    """Detections without the columns that follow from others."""
    table = np.zeros(len(range_m), dtype)
    table["range"], table["azimuth"], table["elevation"] = range_m, azimuth_rad, elevation_rad
    table["doppler_velocity"], table["amplitude"] = speed_mps, power_db
    return table


def _fill_derived(table: Table, reference_range_m: float) -> None:
    """Fill in the columns that follow from measured values: positions, and the cross-sections of targets."""
    range_m, azimuth_rad, elevation_rad = (table[name].astype(np.float64) for name in ("range", "azimuth", "elevation"))
    level_m = range_m * np.cos(elevation_rad)
    table["x"], table["y"] = level_m * np.cos(azimuth_rad), level_m * np.sin(azimuth_rad)
    table["z"] = range_m * np.sin(elevation_rad)
    if "rcs" in (table.dtype.names or ()):
        table["rcs"] = radar_rcs_dbsm(table, reference_range_m)
