"""Radars: world state and rays in, one cloud of detections per radar out. No ROS.

Every scan sends new random rays into the field of view, and each that hits something within range is one detection, as
in CARLA (whose rays end on a plane at that range, so that those off the axis see farther). A detection is a point of a
surface: its range and angles, how fast it moves along the ray relative to the radar, and how much of the power it
returns. What is measured of that, with all errors, is the work of ``radar_errors``.
"""

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from simbev_ros.config.radar import Radar
from simbev_ros.random import stream
from simbev_ros.raycast.scene import Hits, RayScene
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.mount import map_from_sensor, vector
from simbev_ros.sensors.radar_amplitude import amplitude_db, load_cross_sections, rain_loss_db_per_m
from simbev_ros.sensors.radar_errors import with_errors
from simbev_ros.sensors.radar_rays import random_rays
from simbev_ros.types import Float64Array, Int64Array, Table

RADAR_POINT_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, sensor frame, by the measured range and angles
        ("y", "<f4"),
        ("z", "<f4"),
        ("range", "<f4"),  # m
        ("azimuth", "<f4"),  # rad, 0 ahead, left positive (REP-103)
        ("elevation", "<f4"),  # rad above the sensor's x-y plane
        ("doppler_velocity", "<f4"),  # m/s along the ray, relative to the radar: positive recedes, negative approaches
        ("amplitude", "<f4"),  # dB of what 1 m² returns from the radar's reference range
    ]
)
"""One row per detection, 32 bytes. From ``range`` on names, units and signs are those of radar_msgs/RadarReturn; that
positive speeds recede is said by its authors (github.com/ros-perception/radar_msgs/issues/11), and is so in CARLA."""

_DRAWS = 5  # per ray, for the noise


class RadarModel:
    """A radar of the rig."""

    def __init__(self, radar: Radar, seed: int, scan_s: float) -> None:
        """For a radar with its configuration, the scene's seed and the time from one scan to the next."""
        self.radar = radar
        self.rays = max(1, round(radar.points_per_second * scan_s))
        self._seed = seed
        self._cross_sections = load_cross_sections()

    def directions(self, tick: int) -> Float64Array:
        """(rays, 3) unit vectors of a tick's rays, sensor frame."""
        return random_rays(self.radar, self.rays, self._stream("rays", tick))

    def detections(
        self,
        map_from_radar: Float64Array,
        directions: Float64Array,
        hits: Hits,
        velocity_mps: Float64Array,
        state: WorldState,
    ) -> Table:
        """What is measured where rays hit something within range.

        Args:
            map_from_radar: (4, 4) where the radar is.
            directions: (rays, 3) as given by ``directions``.
            hits: What these rays hit.
            velocity_mps: (rays, 3) of the points that they hit, map axes.
            state: The world now.

        Returns:
            (N,) ``RADAR_POINT_DTYPE``, in the order of the rays.
        """
        radar = self.radar
        ray = np.flatnonzero((hits.range_m >= radar.min_range_m) & (hits.range_m <= radar.range_m))
        hits, directions = _taken(hits, ray), directions[ray]
        along = directions @ map_from_radar[:3, :3].T
        range_m = hits.range_m.astype(np.float64)
        table = np.zeros(len(ray), RADAR_POINT_DTYPE)
        table["range"] = range_m
        table["azimuth"] = np.arctan2(directions[:, 1], directions[:, 0])
        table["elevation"] = np.arcsin(np.clip(directions[:, 2], -1.0, 1.0))
        table["doppler_velocity"] = np.einsum(
            "ni,ni->n", velocity_mps[ray] - _own_velocity(map_from_radar, state), along
        )
        table["amplitude"] = self._amplitude_db(hits, range_m, state)
        table = with_errors(radar, table, ray, lambda: self._noise(state.tick))
        _fill_xyz(table)
        return table

    def _amplitude_db(self, hits: Hits, range_m: Float64Array, state: WorldState) -> Float64Array:
        cross_section_m2 = self._cross_sections.at(hits.material, hits.tag, hits.cos_angle.astype(np.float64))
        clear_db = amplitude_db(cross_section_m2, range_m, self.radar.reference_range_m)
        if not self.radar.rain_attenuation:
            return clear_db
        return clear_db - rain_loss_db_per_m(state.weather) * range_m

    def _noise(self, tick: int) -> Float64Array:
        return self._stream("noise", tick).standard_normal((self.rays, _DRAWS))

    def _stream(self, what: str, tick: int) -> np.random.Generator:
        return stream(self._seed, f"radar.{self.radar.name}.{what}", tick)


def scan_radars(
    models: Sequence[RadarModel], scene: RayScene, state: WorldState, previous: WorldState | None
) -> list[Table]:
    """The detections of each radar, from one cast of all their rays.

    Args:
        models: The radars.
        scene: Updated with ``state``.
        state: The world now.
        previous: The world one tick ago; None: wheels and limbs move with the bodies.

    Returns:
        Per radar (N,) ``RADAR_POINT_DTYPE``.
    """
    if not models:
        return []
    poses = [map_from_sensor(model.radar.pose, state) for model in models]
    counts = [model.rays for model in models]
    directions = [model.directions(state.tick) for model in models]
    origins_m = np.repeat([pose[:3, 3] for pose in poses], counts, axis=0)
    along = np.concatenate([each @ pose[:3, :3].T for each, pose in zip(directions, poses, strict=True)])
    hits = scene.cast(origins_m, along)
    points_m = origins_m + along * np.where(np.isfinite(hits.range_m), hits.range_m, 0.0)[:, None]
    velocity_mps = scene.velocities(hits, points_m)
    with_parts = np.flatnonzero(np.repeat([model.radar.micro_doppler for model in models], counts))
    if previous is not None and len(with_parts):
        velocity_mps[with_parts] = scene.velocities(_taken(hits, with_parts), points_m[with_parts], previous)
    mine = np.split(np.arange(len(along)), np.cumsum(counts)[:-1])
    return [
        model.detections(pose, each, _taken(hits, rays), velocity_mps[rays], state)
        for model, pose, each, rays in zip(models, poses, directions, mine, strict=True)
    ]


def _taken(hits: Hits, ray: Int64Array) -> Hits:
    return Hits(*(getattr(hits, field.name)[ray] for field in fields(hits)))


def _own_velocity(map_from_radar: Float64Array, state: WorldState) -> Float64Array:
    """(3,) m/s, map axes, of a sensor on the ego, with the lever arm to the ego's origin."""
    arm_m = map_from_radar[:3, 3] - vector(state.ego, "x y z")
    velocity_mps: Float64Array = vector(state.ego, "vx vy vz") + np.cross(vector(state.ego, "wx wy wz"), arm_m)
    return velocity_mps


def _fill_xyz(table: Table) -> None:
    range_m, azimuth_rad, elevation_rad = (table[name].astype(np.float64) for name in ("range", "azimuth", "elevation"))
    level_m = range_m * np.cos(elevation_rad)
    table["x"], table["y"] = level_m * np.cos(azimuth_rad), level_m * np.sin(azimuth_rad)
    table["z"] = range_m * np.sin(elevation_rad)
