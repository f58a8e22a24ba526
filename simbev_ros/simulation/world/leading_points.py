"""The points that bodies follow: SUMO's positions without jumps, adjusted for everything that SUMO does not know.

Vehicles are towed behind their fronts, move aside in narrow places and back off. Pedestrians leave SUMO's network, walk
around obstacles and keep off vehicles. Careful drivers then predict where all these points lead and brake for
conflicts. Everything happens at SUMO's moment, ahead of the published tables.
"""

from dataclasses import replace

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.driving.backing_off import MAX_BACK_M
from simbev_ros.simulation.world.driving.careful_drivers import CarefulDrivers
from simbev_ros.simulation.world.driving.outside_drivers import driven_from_outside
from simbev_ros.simulation.world.kinematics.collisions import Collisions
from simbev_ros.simulation.world.kinematics.followers import PursuingPoints, SteadyPoints, TowedPoints
from simbev_ros.simulation.world.kinematics.ground import GroundSurface
from simbev_ros.simulation.world.kinematics.motion import Bodies
from simbev_ros.simulation.world.pedestrians.excursions import Excursions
from simbev_ros.simulation.world.pedestrians.furniture_avoidance import FurnitureAvoidance
from simbev_ros.simulation.world.pedestrians.vehicle_avoidance import VehicleAvoidance
from simbev_ros.simulation.world.population import Population
from simbev_ros.simulation.world.sumo.traffic import TrafficSample

_MAX_CHANGE_MPS2 = 20.0  # a larger change, before averaging, is a jump of SUMO's between lanes that do not meet
_PEDESTRIAN_MPS2 = 4.0
_PATIENCE_S = 15.0  # of drivers on map files, with narrow streets, junctions and dead ends that our towns do not have
_CATCH_UP_FACTOR = 1.3  # maximum speed while catching up with a sideways jump of SUMO's, divided by the usual maximum
_STEP_BACK_MPS = 1.0  # on top of that speed, for a pedestrian whom a vehicle would touch


class LeadingPoints:
    """The leading points of a scene: V vehicles first, then P pedestrians.

    Attributes:
        now: (V + P, 4) latest points, map frame, and the height of each body above its point.
        axle_m: (V + P, 3) rear axles of the vehicles that are driven from outside; NaN: the axle is towed.
    """

    def __init__(
        self,
        spec: SceneSpec,
        population: Population,
        bodies: Bodies,
        excursions: Excursions,
        ground: GroundSurface,
        obstacles: Table,
        sample: TrafficSample,
        directions: Float64Array,
    ) -> None:
        """Start at rest.

        Args:
            spec: The scene.
            population: Vehicles and pedestrians.
            bodies: The bodies that follow the points.
            excursions: Pedestrians off SUMO's network.
            ground: The ground under all actors.
            obstacles: (K,) ``OBSTACLE_DTYPE``, which pedestrians walk around.
            sample: Where all actors start.
            directions: (V + P, 3) unit vectors of their headings.
        """
        tick_s = spec.tick_ns / NS_PER_S
        vehicles = len(sample.front_m)
        max_speed_mps = np.array([spec.pedestrians[index].max_speed_mps for index in population.pedestrians])
        self._tick_s = tick_s
        self._sumo_vehicles = slice(population.sumo_vehicle_count)
        self._excursions, self._ground, self._furniture_avoidance = excursions, ground, FurnitureAvoidance(obstacles)
        self._steady_fronts = SteadyPoints(sample.front_m, _MAX_CHANGE_MPS2 * tick_s**2)
        behind_m = (bodies.boxes.size_m[:vehicles, 0] / 2.0 - bodies.lead_m[:vehicles])[:, None]
        driven = driven_from_outside(spec)
        self._steered = np.flatnonzero([index in driven for index in population.vehicles])
        self._trail_m = bodies.trail_m[self._steered, None]
        self.axle_m: Float64Array = np.full((len(directions), 3), np.nan)
        to_front_m = behind_m[self._steered] + self._trail_m
        self.axle_m[self._steered] = sample.front_m[self._steered] - to_front_m * directions[self._steered]
        self._towed_points = TowedPoints(sample.front_m, directions[:vehicles], behind_m[:, 0], MAX_BACK_M)
        self._vehicle_avoidance = VehicleAvoidance(
            bodies, sample.front_m - behind_m * directions[:vehicles], directions[:vehicles], max_speed_mps
        )
        self._careful_drivers = CarefulDrivers(
            bodies,
            _heeds(spec, population),
            sample.front_m[self._sumo_vehicles],
            population.sumo,
            tick_s,
            *((_PATIENCE_S, ground.is_paved) if spec.map.path else ()),
        )
        start_m = self._furniture_avoidance.move_aside(sample.pedestrian_m)
        self._pursuing_points = PursuingPoints(
            start_m, _CATCH_UP_FACTOR * max_speed_mps * tick_s, _PEDESTRIAN_MPS2 * tick_s**2
        )
        self._max_evasion_m = (_CATCH_UP_FACTOR * max_speed_mps + _STEP_BACK_MPS) * tick_s
        self._wrecks = np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0)
        self.now: Float64Array = self._update_points(sample)

    def advance_points(self, sample: TrafficSample, crashed: BoolArray) -> None:
        """Take SUMO's next sample. ``crashed`` (V + T + P,) marks actors that have collided and no longer move."""
        vehicles = len(sample.front_m)
        pedestrian_m = self._excursions.advance_walkers(sample, crashed[len(crashed) - len(sample.pedestrian_m) :])
        self.now = self._update_points(replace(sample, pedestrian_m=pedestrian_m))
        self._careful_drivers.look_and_brake(
            self._front_m[self._sumo_vehicles],
            self.now[self._sumo_vehicles, :3],
            self._vehicle_avoidance.rear_m[self._sumo_vehicles],
            np.concatenate([self._vehicle_avoidance.center_m, self.now[vehicles:, :3]]),
            self._vehicle_avoidance.ahead,
            self._vehicle_avoidance.is_reversing[self._sumo_vehicles],
            crashed,
            self.now[vehicles:, 3] != 0.0,
        )

    def rest_crashed(self, collisions: Collisions) -> None:
        """Keep crashed bodies where they come to rest, not where their points are."""
        vehicles = len(self._vehicle_avoidance.center_m)
        wrecks = np.flatnonzero(collisions.crashed[:vehicles])
        self._max_evasion_m[collisions.crashed[vehicles : vehicles + len(self._max_evasion_m)]] = 0.0
        self._wrecks = wrecks, collisions.rest_m[wrecks], collisions.yaw_rad[wrecks]

    def _update_points(self, sample: TrafficSample) -> Float64Array:
        """(V + P, 4) points of the next tick.

        Pedestrians on sidewalks stand at curb height, those on plazas on the paving, all others on the carriageway.
        """
        front_m, back_m = self._steady_fronts.follow(sample.front_m).copy(), np.zeros(len(sample.front_m))
        front_m[self._sumo_vehicles] += self._careful_drivers.offset_m
        back_m[self._sumo_vehicles] = self._careful_drivers.back_m
        self._front_m, point_m = self._towed_points.follow(front_m, back_m)
        self._steer(sample, point_m)
        desired_m = self._furniture_avoidance.move_aside(sample.pedestrian_m)
        axle_m = self.axle_m[: len(point_m)]
        may_reverse = ~np.isnan(axle_m[:, 0]) | (back_m > 0.0)
        heedless = self._excursions.heedless[:, None]
        desired_m = np.where(
            heedless,
            desired_m,
            self._vehicle_avoidance.avoid_paths(
                point_m, axle_m, may_reverse, self._pursuing_points.position_m, desired_m, self._tick_s
            ),
        )
        self._vehicle_avoidance.rest_crashed(*self._wrecks)
        pedestrian_m = self._vehicle_avoidance.avoid_bodies(
            self._pursuing_points.pursue(desired_m), self._max_evasion_m
        )
        self._pursuing_points.position_m = pedestrian_m
        points = np.zeros((len(point_m) + len(pedestrian_m), 4))
        points[:, :3] = np.concatenate([point_m, pedestrian_m])
        points[len(point_m) :, 3] = self._raised_m(pedestrian_m)
        return points

    def _steer(self, sample: TrafficSample, point_m: Float64Array) -> None:
        """Take fronts, rear axles and (V, 3) leading points of vehicles driven from outside as their drivers have them.

        The path of a leader tells where a vehicle is that it tows, but not one that it pushes in reverse.
        """
        steered = self._steered
        is_moved = steered[~np.isnan(sample.axle_m[steered, 0])]  # others have never had a driver's tick
        self._front_m[is_moved], self.axle_m[is_moved] = sample.front_m[is_moved], sample.axle_m[is_moved]
        to_front_m = self._front_m[steered] - self.axle_m[steered]
        forward = to_front_m / np.linalg.norm(to_front_m, axis=1, keepdims=True)
        point_m[steered] = self.axle_m[steered] + self._trail_m * forward

    def _raised_m(self, pedestrian_m: Float64Array) -> Float64Array:
        """(P,) height above the carriageway's plane of pedestrians at (P, 3) positions."""
        raised_m = self._ground.raised_m(pedestrian_m)
        paving_m = self._excursions.paving_m(pedestrian_m)
        paved = np.flatnonzero((raised_m == 0.0) & np.isfinite(paving_m))
        raised_m[paved] = paving_m[paved] - self._ground.heights_m(pedestrian_m[paved])
        return raised_m


def _heeds(spec: SceneSpec, population: Population) -> BoolArray:
    """(V, 2) whether each driver brakes for vehicles and for pedestrians; those outside are not controlled here."""
    driven = driven_from_outside(spec)
    return np.array(
        [
            [index not in driven and each not in spec.vehicles[index].ignored for each in ("vehicles", "pedestrians")]
            for index in population.vehicles
        ]
    )
