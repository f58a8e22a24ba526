"""Everybody with a place of their own: SUMO's traffic, and the vehicles that stand in hazard areas."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from simbev_ros.scene.spec import SceneSpec
from simbev_ros.types import Float64Array
from simbev_ros.world.cast import blueprint_of
from simbev_ros.world.lights import HAZARD_LIGHTS
from simbev_ros.world.sumo.tracks import Tracks
from simbev_ros.world.sumo.traffic import Traffic, TrafficSample


class Population(Traffic):
    """Traffic whose last vehicles stand where the specification says; SUMO does not know them.

    Attributes:
        moving: How many of ``vehicles`` are SUMO's; they come first.
    """

    def __init__(
        self,
        spec: SceneSpec,
        files: Sequence[Path],
        speeds_mps: Mapping[str, float],
        tracks: Tracks,
        closed_lanes: Iterable[str] = (),
    ) -> None:
        """As ``Traffic``, for a scene."""
        super().__init__(files, spec.tick_ns, spec.seed, speeds_mps, tracks, closed_lanes)
        self.moving = len(self.vehicles)
        standing = [index for index, vehicle in enumerate(spec.vehicles) if vehicle.stands_at is not None]
        self.vehicles = (*self.vehicles, *standing)
        stands = [stand for vehicle in spec.vehicles if (stand := vehicle.stands_at) is not None]
        half_m = np.array([blueprint_of(spec.vehicles[index].blueprint).size_m[0] / 2.0 for index in standing])
        yaw_rad = np.array([stand.yaw_rad for stand in stands])
        self._ahead = np.column_stack([np.cos(yaw_rad), np.sin(yaw_rad), np.zeros(len(stands))])
        middle_m = np.array([(stand.x_m, stand.y_m, stand.z_m) for stand in stands]).reshape(-1, 3)
        self._front_m: Float64Array = middle_m + half_m[:, None] * self._ahead
        self._flashing = np.array([HAZARD_LIGHTS * stand.hazard_lights for stand in stands], np.int64)

    def sample(self) -> TrafficSample:
        """As ``Traffic.sample``."""
        sample = super().sample()
        return replace(
            sample,
            front_m=np.concatenate([sample.front_m, self._front_m]),
            signals=np.concatenate([sample.signals, self._flashing]),
        )

    def directions(self) -> Float64Array:
        """As ``Traffic.directions``."""
        directions = super().directions()
        return np.concatenate([directions[: self.moving], self._ahead, directions[self.moving :]])

    def speed_mps(self, vehicle: int) -> float:
        """As ``Traffic.speed_mps``."""
        return super().speed_mps(vehicle) if vehicle < self.moving else 0.0

    def direction(self, vehicle: int) -> Float64Array:
        """As ``Traffic.direction``."""
        return super().direction(vehicle) if vehicle < self.moving else self._ahead[vehicle - self.moving, :2]

    def distance_m(self, vehicle: int, edge: str, position_m: float) -> float:
        """As ``Traffic.distance_m``."""
        return super().distance_m(vehicle, edge, position_m) if vehicle < self.moving else np.inf

    def crash(self, body: int, front_m: Float64Array, yaw_rad: float) -> None:
        """As ``Traffic.crash``; who stands anyway is not moved."""
        if not self.moving <= body < len(self.vehicles):
            super().crash(body, front_m, yaw_rad)
