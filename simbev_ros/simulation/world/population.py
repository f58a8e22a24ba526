"""All actors that move or stand on their own: SUMO's traffic, and the vehicles that stand in hazard areas."""

from dataclasses import replace

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.lights import HAZARD_LIGHTS
from simbev_ros.simulation.world.sumo.traffic import SumoTraffic, TrafficSample


class Population:
    """SUMO's traffic plus the vehicles that stand in hazard areas, which SUMO does not know; these come last.

    Attributes:
        sumo: SUMO's traffic. Its vehicles have the same indices here as there.
        vehicles: Indices in the specification of all vehicles: SUMO's, then those that stand.
        pedestrians: Indices in the specification of the pedestrians; all are SUMO's.
        sumo_vehicle_count: Number of ``vehicles`` that SUMO moves.
    """

    def __init__(self, spec: SceneSpec, sumo: SumoTraffic) -> None:
        """Add the scene's standing vehicles to SUMO's traffic."""
        self.sumo = sumo
        self.sumo_vehicle_count = len(sumo.vehicles)
        standing_indices = [index for index, vehicle in enumerate(spec.vehicles) if vehicle.stands_at is not None]
        self.vehicles: tuple[int, ...] = (*sumo.vehicles, *standing_indices)
        self.pedestrians = sumo.walkers.indices
        stands = [stand for vehicle in spec.vehicles if (stand := vehicle.stands_at) is not None]
        standing = [spec.vehicles[index] for index in standing_indices]
        half_m = np.array([blueprint_named(vehicle.blueprint).size_m[0] / 2.0 for vehicle in standing])
        yaw_rad = np.array([stand.yaw_rad for stand in stands])
        self._headings = np.column_stack([np.cos(yaw_rad), np.sin(yaw_rad), np.zeros(len(stands))])
        center_m = np.array([(stand.x_m, stand.y_m, stand.z_m) for stand in stands]).reshape(-1, 3)
        self._front_m: Float64Array = center_m + half_m[:, None] * self._headings
        self._flashing = np.array([HAZARD_LIGHTS * stand.hazard_lights for stand in stands], np.int64)

    def sample(self) -> TrafficSample:
        """The current state of all actors.

        Raises:
            SimulationError: An actor has left SUMO's simulation.
        """
        sample = self.sumo.sample()
        return replace(
            sample,
            front_m=np.concatenate([sample.front_m, self._front_m]),
            axle_m=np.concatenate([sample.axle_m, np.full_like(self._front_m, np.nan)]),
            signals=np.concatenate([sample.signals, self._flashing]),
        )

    def directions(self) -> Float64Array:
        """(V + P, 3) unit vectors of the headings of vehicles, then pedestrians; SUMO's must be on its net."""
        directions = self.sumo.directions()
        return np.concatenate(
            [directions[: self.sumo_vehicle_count], self._headings, directions[self.sumo_vehicle_count :]]
        )

    def speed_mps(self, vehicle: int) -> float:
        """A vehicle's speed; 0 for standing vehicles."""
        return self.sumo.speed_mps(vehicle) if vehicle < self.sumo_vehicle_count else 0.0

    def direction(self, vehicle: int) -> Float64Array:
        """(2,) unit vector of a vehicle's heading."""
        if vehicle < self.sumo_vehicle_count:
            return self.sumo.direction(vehicle)
        return self._headings[vehicle - self.sumo_vehicle_count, :2]

    def distance_m(self, vehicle: int, edge: str, position_m: float) -> float:
        """Driving distance as in ``SumoTraffic.distance_m``; infinite for standing vehicles."""
        return self.sumo.distance_m(vehicle, edge, position_m) if vehicle < self.sumo_vehicle_count else np.inf

    def hold_crashed(self, body: int, front_m: Float64Array, yaw_rad: float) -> None:
        """Hold an actor as in ``SumoTraffic.hold_crashed``; standing vehicles already stand."""
        if body < self.sumo_vehicle_count:
            self.sumo.hold_crashed(body, front_m, yaw_rad)
        elif body >= len(self.vehicles):
            self.sumo.hold_crashed(body - len(self.vehicles) + self.sumo_vehicle_count, front_m, yaw_rad)

    def clear_crashed(self, body: int) -> None:
        """Take an actor off the roads as in ``SumoTraffic.clear_crashed``; SUMO does not know standing vehicles."""
        if body < self.sumo_vehicle_count:
            self.sumo.clear_crashed(body)
        elif body >= len(self.vehicles):
            self.sumo.clear_crashed(body - len(self.vehicles) + self.sumo_vehicle_count)
