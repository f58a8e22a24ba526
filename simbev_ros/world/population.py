"""All actors that move or stand on their own: SUMO's traffic, and the vehicles that stand in hazard areas."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from simbev_ros.scene.spec import SceneSpec
from simbev_ros.types import Float64Array
from simbev_ros.world.cast import blueprint_of
from simbev_ros.world.lights import HAZARD_LIGHTS
from simbev_ros.world.sumo.tracks import LaneTracks
from simbev_ros.world.sumo.traffic import SumoTraffic, TrafficSample


class Population(SumoTraffic):
    """SUMO's traffic plus the vehicles that stand in hazard areas, which SUMO does not know; these come last.

    Attributes:
        sumo_vehicle_count: Number of ``vehicles`` that SUMO moves; they come first.
    """

    def __init__(
        self,
        spec: SceneSpec,
        files: Sequence[Path],
        speeds_mps: Mapping[str, float],
        tracks: LaneTracks,
        closed_lanes: Iterable[str] = (),
    ) -> None:
        """Load SUMO's traffic as ``SumoTraffic`` does, and add the scene's standing vehicles."""
        super().__init__(files, spec.tick_ns, spec.seed, speeds_mps, tracks, closed_lanes)
        self.sumo_vehicle_count = len(self.vehicles)
        standing_indices = [index for index, vehicle in enumerate(spec.vehicles) if vehicle.stands_at is not None]
        self.vehicles = (*self.vehicles, *standing_indices)
        stands = [stand for vehicle in spec.vehicles if (stand := vehicle.stands_at) is not None]
        half_m = np.array([blueprint_of(spec.vehicles[index].blueprint).size_m[0] / 2.0 for index in standing_indices])
        yaw_rad = np.array([stand.yaw_rad for stand in stands])
        self._headings = np.column_stack([np.cos(yaw_rad), np.sin(yaw_rad), np.zeros(len(stands))])
        center_m = np.array([(stand.x_m, stand.y_m, stand.z_m) for stand in stands]).reshape(-1, 3)
        self._front_m: Float64Array = center_m + half_m[:, None] * self._headings
        self._flashing = np.array([HAZARD_LIGHTS * stand.hazard_lights for stand in stands], np.int64)

    def sample(self) -> TrafficSample:
        """The current state, as in ``SumoTraffic.sample``."""
        sample = super().sample()
        return replace(
            sample,
            front_m=np.concatenate([sample.front_m, self._front_m]),
            signals=np.concatenate([sample.signals, self._flashing]),
        )

    def directions(self) -> Float64Array:
        """Unit vectors of all headings, as in ``SumoTraffic.directions``."""
        directions = super().directions()
        return np.concatenate(
            [directions[: self.sumo_vehicle_count], self._headings, directions[self.sumo_vehicle_count :]]
        )

    def speed_mps(self, vehicle: int) -> float:
        """A vehicle's speed; 0 for standing vehicles."""
        return super().speed_mps(vehicle) if vehicle < self.sumo_vehicle_count else 0.0

    def direction(self, vehicle: int) -> Float64Array:
        """(2,) unit vector of a vehicle's heading."""
        return (
            super().direction(vehicle)
            if vehicle < self.sumo_vehicle_count
            else self._headings[vehicle - self.sumo_vehicle_count, :2]
        )

    def distance_m(self, vehicle: int, edge: str, position_m: float) -> float:
        """Driving distance as in ``SumoTraffic.distance_m``; infinite for standing vehicles."""
        return super().distance_m(vehicle, edge, position_m) if vehicle < self.sumo_vehicle_count else np.inf

    def hold_crashed(self, body: int, front_m: Float64Array, yaw_rad: float) -> None:
        """Hold an actor as in ``SumoTraffic.hold_crashed``; standing vehicles already stand."""
        if not self.sumo_vehicle_count <= body < len(self.vehicles):
            super().hold_crashed(body, front_m, yaw_rad)
