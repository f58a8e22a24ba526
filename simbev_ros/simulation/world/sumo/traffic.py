"""SUMO in this process: one simulation, advanced tick by tick and read as arrays. Only this package uses libsumo."""

from collections.abc import Container, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.simulation.world.lights import HAZARD_LIGHTS
from simbev_ros.simulation.world.sumo import vehicle_routes
from simbev_ros.simulation.world.sumo.arc_ahead import arc_ahead_m, curvature_per_m
from simbev_ros.simulation.world.sumo.closures import CLOSURE, shorten_closure
from simbev_ros.simulation.world.sumo.given_motion import BRAKES_HARD, NO_CHECKS, GivenMotion
from simbev_ros.simulation.world.sumo.lanes_ahead import LaneProgress, LanesAhead
from simbev_ros.simulation.world.sumo.lanes_beside import leave_lane
from simbev_ros.simulation.world.sumo.libsumo_import import FAILURES, libsumo
from simbev_ros.simulation.world.sumo.names import index_of, vehicle_name
from simbev_ros.simulation.world.sumo.placed_obstacles import PlacedObstacles
from simbev_ros.simulation.world.sumo.routes import Routes
from simbev_ros.simulation.world.sumo.signals import PhaseChange
from simbev_ros.simulation.world.sumo.start import start_sumo
from simbev_ros.simulation.world.sumo.tracks import LaneTracks
from simbev_ros.simulation.world.sumo.walkers import SumoPedestrians

_POSITION_VARIABLES = libsumo.VAR_LANE_ID, libsumo.VAR_LANEPOSITION, libsumo.VAR_LANEPOSITION_LAT
_ON_OR_OFF_ROAD = 2  # mode of moveToXY: on a road or off it
_VEHICLE_VARIABLES = (*_POSITION_VARIABLES, libsumo.VAR_SIGNALS)
_ON_ROUTE = 1  # mode of moveToXY: on the vehicle's route
_EMERGENCY_MPS2 = 8.0
_STANDING_MPS = 0.05


@dataclass(frozen=True, slots=True)
class TrafficSample:
    """SUMO's state at one tick, in the order of ``SumoTraffic.vehicles`` and ``SumoTraffic.walkers``; map frame.

    Attributes:
        front_m: (V, 3) center of each vehicle's front bumper, on the road.
        axle_m: (V, 3) center of each rear axle that ``move_vehicle`` has moved; NaN: it is towed behind the front.
        signals: (V,) int64, SUMO's vehicle signals (bit 0 right blinker, bit 1 left blinker).
        pedestrian_m: (P, 3) each pedestrian, on the surface of its lane.
    """

    front_m: Float64Array
    axle_m: Float64Array
    signals: Int64Array
    pedestrian_m: Float64Array


class SumoTraffic:
    """A running SUMO simulation. libsumo holds one per process: close it before creating another one.

    Attributes:
        vehicles: Indices in the specification of the vehicles that SUMO could insert, ascending.
        walkers: The pedestrians.
        progress: Where the vehicles are on their routes at the latest sample.
        given: Motion that is given to some vehicles, which their drivers do not decide.
        obstacles: What commands place on the roads.
    """

    _running = False

    def __init__(
        self,
        files: Sequence[Path],
        step_ns: int,
        seed: int,
        speeds_mps: Mapping[str, float],
        tracks: LaneTracks,
        closed_lanes: Iterable[str] = (),
        left_hand: bool = False,
    ) -> None:
        """Load a network and its traffic, and insert all vehicles and pedestrians at time 0.

        Args:
            files: Network file, route file (everything departs at 0), additional file (the signal programs).
            step_ns: Length of a step on SUMO's clock, of ``sumo_step_ns``.
            seed: Seed of SUMO's own random numbers.
            speeds_mps: Lane id → speed limit that replaces the network's.
            tracks: All lanes that a vehicle may get onto.
            closed_lanes: Ids of lanes that are closed to all traffic, whatever the network permits.
            left_hand: Traffic keeps to the left; SUMO then counts lateral positions to the right.

        Raises:
            SimulationError: Another simulation is running in this process, or SUMO rejects its input.
        """
        if SumoTraffic._running:
            raise SimulationError("a simulation is running in this process already; close it first")
        self._tracks = tracks
        self._left_sign = -1.0 if left_hand else 1.0
        self._step_s = step_ns / NS_PER_S
        self._open = SumoTraffic._running = True
        self._has_pending_move = False  # whether SUMO will move an actor at the next step
        try:
            start_sumo(files, self._step_s, seed, speeds_mps, closed_lanes)
        except FAILURES as error:
            self.close()
            raise SimulationError(f"SUMO could not start: {error}") from error
        closures = [name for name in libsumo.vehicle.getIDList() if name.startswith(CLOSURE)]
        self._closures = {name: libsumo.vehicle.getLength(name) for name in closures}
        driven = (name for name in libsumo.vehicle.getIDList() if not name.startswith(CLOSURE))
        self.vehicles: tuple[int, ...] = tuple(sorted(map(index_of, driven)))
        self.walkers = SumoPedestrians()
        self._crashed: dict[str, dict[int, Any]] = {}
        self._driven: dict[str, tuple[dict[int, Any], Float64Array, Float64Array]] = {}
        self._curvature_per_m: dict[str, float] = {}
        self._limits_mps: list[dict[str, float]] = [{} for _ in self.vehicles]
        self.obstacles = PlacedObstacles()
        self._cleared: set[str] = set()  # wrecks that have left the simulation
        self._vehicle_names = [vehicle_name(index) for index in self.vehicles]
        self.given = GivenMotion(self._vehicle_names, self._left_sign)
        self._lanes_ahead = LanesAhead(self._vehicle_names, tracks)
        self.progress = LaneProgress((), np.zeros(0), ())
        for name in self._vehicle_names:
            libsumo.vehicle.subscribe(name, _VEHICLE_VARIABLES)
            libsumo.vehicle.setSpeedMode(name, BRAKES_HARD)

    def directions(self) -> Float64Array:
        """(V + P, 3) unit vectors of the headings of vehicles, then pedestrians, map frame; all must be on the net."""
        angles_deg = [
            *[(libsumo.vehicle.getAngle(name), libsumo.vehicle.getSlope(name)) for name in self._vehicle_names],
            *[(angle_deg, 0.0) for angle_deg in self.walkers.angles_deg()],
        ]
        # SUMO's angle turns clockwise from north.
        angle, slope = np.radians(np.array(angles_deg, np.float64).reshape(-1, 2)).T
        return np.stack([np.sin(angle) * np.cos(slope), np.cos(angle) * np.cos(slope), np.sin(slope)], axis=1)

    def sample(self) -> TrafficSample:
        """The current state.

        Raises:
            SimulationError: An actor has left the simulation.
        """
        driven = {name: row for name, (row, *_) in self._driven.items()}
        vehicles = {**libsumo.vehicle.getAllSubscriptionResults(), **self._crashed, **driven}
        try:
            rows = [vehicles[name] for name in self._vehicle_names]
            lanes, position_m, left_m = ([row[variable] for row in rows] for variable in _POSITION_VARIABLES)
            lane_position = lanes, np.array(position_m, np.float64), self._left_sign * np.array(left_m, np.float64)
            self._lanes_ahead.observe(*lane_position)
            self.progress = LaneProgress(lanes, lane_position[1], self._lanes_ahead.next_edges)
            front_m = self._tracks.positions_m(*lane_position)
            axle_m = np.full_like(front_m, np.nan)
            for name, (_, *driven_m) in self._driven.items():
                vehicle = self._vehicle_names.index(name)
                front_m[vehicle], axle_m[vehicle] = driven_m
            signals = np.array([row[libsumo.VAR_SIGNALS] for row in rows], np.int64)
            for vehicle, blinkers in self.given.blinkers.items():
                signals[vehicle] = signals[vehicle] & ~HAZARD_LIGHTS | blinkers
            return TrafficSample(front_m, axle_m, signals, self.walkers.points_m())
        except KeyError as error:
            raise SimulationError(f"SUMO has lost {error} at {libsumo.simulation.getTime():.3f} s") from error

    def ahead_m(self, vehicle: Int64Array, distance_m: Float64Array, left_m: Float64Array) -> Float64Array:
        """(N, K, 3) positions of the fronts of (N,) of the latest vehicles after (N, K) distances along their routes.

        They lie (N, K) further to the left of their lanes' center lines than now.
        """
        positions_m = self._lanes_ahead.ahead_m(vehicle, distance_m, left_m)
        for name, (_, front_m, axle_m) in self._driven.items():  # no route: its driver decides
            chosen = vehicle == self._vehicle_names.index(name)
            positions_m[chosen] = arc_ahead_m(front_m, axle_m, self._curvature_per_m[name], distance_m[chosen])
        return positions_m

    def hold_crashed(self, body: int, front_m: Float64Array, yaw_rad: float) -> None:
        """Hold an actor that has collided where it is, for good.

        Args:
            body: Index among the vehicles, then pedestrians.
            front_m: (3,) where its front shall stand, map frame; only vehicles, which are ahead of the published
                tables, are moved there.
            yaw_rad: The vehicle's heading.
        """
        if body >= len(self.vehicles):
            self.walkers.hold(body - len(self.vehicles))
            return
        name = self._vehicle_names[body]
        self._crashed[name] = dict(libsumo.vehicle.getSubscriptionResults(name))
        self.given.leave(name)
        libsumo.vehicle.setSpeedMode(name, NO_CHECKS)
        libsumo.vehicle.setLaneChangeMode(name, 0)
        libsumo.vehicle.setSpeed(name, 0.0)
        x_m, y_m = front_m[:2].tolist()
        libsumo.vehicle.moveToXY(name, "", -1, x_m, y_m, 90.0 - np.degrees(yaw_rad), keepRoute=_ON_ROUTE)
        self._has_pending_move = True

    def clear_crashed(self, body: int) -> None:
        """Take an actor, such as one that is held after a collision, off the roads for good, so that it blocks nobody.

        Args:
            body: Index among the vehicles, then pedestrians.
        """
        if body >= len(self.vehicles):
            self.walkers.remove(body - len(self.vehicles))
            return
        name = self._vehicle_names[body]
        self._crashed.setdefault(name, dict(libsumo.vehicle.getSubscriptionResults(name)))
        self.given.leave(name)
        self._cleared.add(name)
        self._lanes_ahead.remove(body)
        libsumo.vehicle.unsubscribe(name)
        libsumo.vehicle.remove(name)

    def move_vehicle(self, vehicle: int, front_m: Float64Array, axle_m: Float64Array) -> None:
        """Move a vehicle to a pose at the next step, on a road or off it, unless it has crashed.

        Args:
            vehicle: Its index in ``vehicles``; from now on only this method moves it.
            front_m: (3,) center of its front bumper, map frame.
            axle_m: (3,) center of its rear axle.

        Raises:
            SimulationError: SUMO failed.
        """
        name = self._vehicle_names[vehicle]
        if name in self._crashed:
            return
        row, before_m, axle_before_m = self._driven.get(name, ({}, front_m, axle_m))
        self._curvature_per_m[name] = curvature_per_m(before_m, axle_before_m, front_m, axle_m)
        self._driven[name] = row or dict(libsumo.vehicle.getSubscriptionResults(name)), front_m, axle_m
        ahead_m = (front_m - axle_m)[:2]
        try:
            if (front_m - before_m)[:2] @ ahead_m < 0.0:  # SUMO drops the sign: to vehicles behind, it would drive away
                libsumo.vehicle.setPreviousSpeed(name, 0.0)
            (x_m, y_m), angle_deg = front_m[:2].tolist(), np.degrees(np.arctan2(*ahead_m))
            libsumo.vehicle.moveToXY(name, "", -1, x_m, y_m, angle_deg, keepRoute=_ON_OR_OFF_ROAD)
            self._has_pending_move = True
        except FAILURES as error:
            raise SimulationError(f"SUMO failed: {error}") from error

    def step_sumo(self) -> None:
        """Advance by one tick.

        Raises:
            SimulationError: SUMO failed.
        """
        try:
            libsumo.simulationStep()
            self._has_pending_move = False
        except FAILURES as error:
            raise SimulationError(f"SUMO failed: {error}") from error

    def limit_speed(self, vehicle: int, reason: str, speed_mps: float | None) -> None:
        """Limit the speed of a vehicle (its index in ``vehicles``) at the next step, for a reason; None lifts it.

        The lowest limit of all reasons applies. A limit of 0 lasts until it is lifted; others must be set at every
        step.
        """
        limits_mps, name = self._limits_mps[vehicle], self._vehicle_names[vehicle]
        limits_mps.pop(reason, None)
        if speed_mps is not None:
            limits_mps[reason] = speed_mps
        if name not in self._crashed and name not in self._driven and name not in self.given.moved:
            min_limit_mps = min(limits_mps.values(), default=np.inf)
            speed_mps = libsumo.vehicle.getSpeed(name)
            # SUMO takes a given speed as the desired one even if its driver would be slower.
            braking_limit_mps = max(min_limit_mps, speed_mps - _EMERGENCY_MPS2 * self._step_s)
            libsumo.vehicle.setSpeed(name, braking_limit_mps if min_limit_mps <= speed_mps else -1.0)

    def leave_lane(self, vehicle: int) -> bool:
        """Let a vehicle change lanes within some seconds; returns whether its edge has another lane for it."""
        name = self._vehicle_names[vehicle]
        if name in self._crashed or name in self._driven or name in self.given.moved:
            return False
        return leave_lane(name)

    def ignore_at_junctions(self, vehicle: int, others: Iterable[int]) -> None:
        """Let a vehicle pass junctions regardless of these others (indices in ``vehicles``), and of no one else."""
        names = " ".join(self._vehicle_names[other] for other in others)
        if (name := self._vehicle_names[vehicle]) not in self._cleared:
            libsumo.vehicle.setParameter(name, "junctionModel.ignoreIDs", names)

    def shorten_closures(self) -> None:
        """Shorten closures a little where a vehicle waits close behind them, halfway onto the next lane.

        For SUMO, a vehicle closer than its minimum gap is beside the obstacle, which then blocks it forever.
        """
        for name, full_length_m in self._closures.items():
            shorten_closure(name, full_length_m)

    def speed_mps(self, vehicle: int) -> float:
        """A vehicle's speed."""
        name = self._vehicle_names[vehicle]
        return 0.0 if name in self._cleared else float(libsumo.vehicle.getSpeed(name))

    def direction(self, vehicle: int) -> Float64Array:
        """(2,) unit vector of a vehicle's heading; of a removed wreck, that of the map's y axis."""
        if self._vehicle_names[vehicle] in self._cleared:
            return np.array([0.0, 1.0])
        angle_rad = np.radians(libsumo.vehicle.getAngle(self._vehicle_names[vehicle]))
        return np.array([np.sin(angle_rad), np.cos(angle_rad)])

    def distance_m(self, vehicle: int, edge: str, position_m: float) -> float:
        """Driving distance of a vehicle to SUMO's position on an edge; infinite if its route does not lead there."""
        if (name := self._vehicle_names[vehicle]) in self._cleared:
            return np.inf
        distance_m = libsumo.vehicle.getDrivingDistance(name, edge, position_m)
        return np.inf if distance_m == libsumo.INVALID_DOUBLE_VALUE else float(distance_m)

    def take_phase(self, change: PhaseChange) -> None:
        """Let a traffic light take a phase; one outside the simulated part of the map has no effect."""
        if change.program in libsumo.trafficlight.getIDList():
            libsumo.trafficlight.setPhase(change.program, change.phase)
            libsumo.trafficlight.setPhaseDuration(change.program, change.ticks * self._step_s)

    def wants_to_move(self, vehicle: int) -> bool:
        """Whether a stopped vehicle would drive."""
        if self._vehicle_names[vehicle] in self._cleared:
            return False
        return bool(libsumo.vehicle.getSpeedWithoutTraCI(self._vehicle_names[vehicle]) > _STANDING_MPS)

    def will_stand(self, vehicle: int, for_s: float) -> bool:
        """Whether a vehicle at rest will stay for this duration: in a queue, or at a red light that lasts as long."""
        name = self._vehicle_names[vehicle]
        return name not in self._cleared and vehicle_routes.will_stand(name, for_s)

    def adapt_driver(self, vehicle: int, speed_factor: float, headway_s: float) -> None:
        """Set a driver's desired speed, relative to the limit, and headway."""
        if (name := self._vehicle_names[vehicle]) not in self._cleared:
            libsumo.vehicle.setSpeedFactor(name, speed_factor)
            libsumo.vehicle.setTau(name, headway_s)

    def keep_on_routes(self, routes: Routes, step: int, outside: Container[int], *, detours: bool) -> None:
        """Extend the routes that end soon, except those of vehicles driven from outside (indices in the specification).

        With ``detours``, vehicles that wait in a wrong lane for long get a route that this lane leads to.
        """
        for vehicle, name in zip(self.vehicles, self._vehicle_names, strict=True):
            if name in self._crashed or vehicle in outside:
                continue
            if edge := vehicle_routes.ending_edge(name):
                vehicle_routes.extend_route(name, *routes.draw_extension(vehicle, edge, step))
            if detours and vehicle_routes.stands_in_wrong_lane(name):
                detour = routes.draw_detour(vehicle, libsumo.vehicle.getLaneID(name), step)
                if len(detour.edges) > 1:
                    vehicle_routes.replace_route(name, *detour)

    def close(self) -> None:
        """End the simulation; further calls have no effect."""
        if self._open:
            # Otherwise libsumo would move an actor of the same name in the next simulation.
            if self._has_pending_move or self.obstacles.placed:
                with suppress(*FAILURES):
                    libsumo.simulationStep()
            libsumo.close()
            self._open = SumoTraffic._running = False
