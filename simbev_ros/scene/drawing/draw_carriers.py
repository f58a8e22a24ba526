"""Draw the vehicles that carry agents: their starts, colors, drivers and routes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from simbev_ros.config.agents import Agent, Ego
from simbev_ros.config.draw import sample
from simbev_ros.config.places import SpawnPose
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.traffic import Traffic
from simbev_ros.foundation.errors import InputError, RoomError
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, load_blueprints
from simbev_ros.scene.drawing.drivers import draw_driver, draw_vehicle
from simbev_ros.scene.drawing.nearness import is_near
from simbev_ros.scene.drawing.route_points import routed_ego
from simbev_ros.scene.drawing.spawn import Where, no_lane, spawn_starts
from simbev_ros.scene.drawing.start_clearance import StartClearance
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.streets.lane_positions import LanePositions
from simbev_ros.scene.streets.streets import streets_of
from simbev_ros.schema.scene.spec import VehicleSpec, WaypointSpec

_LANE_CLEARANCE = 0.99  # of the waypoint spacing: no other vehicle starts closer to an agent on its lane
_MAX_DETOUR = 1.3  # length of the road between two vehicles of a chain, as a multiple of their distance
_FRONT = 1

Chain = list[WaypointSpec]
"""The starts of the last and of the first vehicle of a chain."""


@dataclass(frozen=True)
class CarrierDrawer:
    """Draws vehicles that carry agents, with the arguments of ``draw_agents``.

    Attributes:
        vehicles: The vehicles drawn so far, to which each one is added.
        position_m: (3,) start of each agent drawn so far, map frame, by name.
    """

    scenario: Scenario
    seed: int
    network: RoadNetwork
    starts: StartPositions
    duration_s: float
    vehicles: list[VehicleSpec]
    position_m: dict[str, Float64Array]

    @cached_property
    def _clearance(self) -> StartClearance:
        """The ground where the vehicles stand."""
        return StartClearance(self.network, self.vehicles)

    def draw_ego(self, number: int) -> None:
        """Draw the first agent's vehicle with this one of the starts that follow from the seed."""
        ego, where = routed_ego(self.scenario, self.network)
        self._draw(ego, self.scenario.rig.agent, "ego", where, partial(self._draw_position, number))

    def draw(self, agent: Agent, name: str, where: Where, chain: Chain | None) -> None:
        """Draw the vehicle of another agent, which continues a chain if there is one.

        Raises:
            RoomError: There is no free start where it may be.
        """
        around = partial(self._draw_position_around, agent, chain)
        self._draw(agent, name, f"agents.{name}", where, around)

    def _draw(
        self, agent: Ego, name: str, purpose: str, where: Where, draw_position: Callable[[Blueprint, str, Where], int]
    ) -> None:
        """Draw the vehicle of the agent with random streams ``purpose…``, and add it to those drawn."""
        blueprint, positions = _blueprint_of(agent, where), self.starts.vehicles
        keys, poses = agent.spawn_on(self.network.name)
        if poses:
            start = self._draw_pose(poses, blueprint, purpose, partial(where, *keys))
            start_m, _ = self.network.pose_on_lane(start.lane, start.s_m)
        else:
            position_index = draw_position(blueprint, purpose, where)
            start, start_m = positions.waypoint(position_index), positions.position_m[position_index]
        traffic, rng = self.scenario.traffic, stream(self.seed, f"{purpose}.style")
        driver = draw_driver(traffic, blueprint, self.seed, purpose, opens_doors=False)
        vehicle = draw_vehicle(traffic, blueprint, start, rng, agent.reckless_probability, driver)
        if agent.color is not None:
            vehicle = vehicle.model_copy(update={"color": agent.color})
        if agent.speed_factor is not None:
            speed_factor = sample(agent.speed_factor, stream(self.seed, f"{purpose}.speed_factor"))
            vehicle = vehicle.model_copy(update={"speed_factor": speed_factor})
        keys, places = agent.route_on(self.network.name)
        if places:
            via = self._via(start, places, blueprint, partial(where, *keys))
            vehicle = vehicle.model_copy(update={"via": via})
        self._clearance.occupy(vehicle)
        self.vehicles.append(vehicle)
        self.position_m[name] = start_m

    def _via(
        self, start: WaypointSpec, places: tuple[SpawnPose, ...], blueprint: Blueprint, where: Where
    ) -> tuple[str, ...]:
        """Edges with the places of a route, each of which can be reached from the one before it.

        Raises:
            InputError: A place is off the lanes, or cannot be reached.
        """
        graph = streets_of(self.network).for_blueprint(blueprint)
        edges = [self.network.lanes[start.lane].edge]
        for number, place in enumerate(spawn_starts(places, blueprint, self.network, where)):
            edge = self.network.lanes[place.lane].edge
            if edge != edges[-1] and not graph.shortest_path(edges[-1], edge):
                raise InputError(
                    f"{where(number)}: no road leads there for {blueprint.name} in map {self.network.name}"
                )
            edges.append(edge)
        return tuple(edges[1:])

    def _draw_pose(
        self, poses: tuple[SpawnPose, ...], blueprint: Blueprint, purpose: str, where: Where
    ) -> WaypointSpec:
        """Draw one of the poses of an agent, which are in the field ``where``, at which no other agent stands."""
        starts = spawn_starts(poses, blueprint, self.network, where)
        free = [start for start in starts if self._clearance.is_free(blueprint, start)]
        if not free:
            raise InputError(f"{where()}: agents listed earlier leave no room for {blueprint.name} at any pose")
        return free[int(stream(self.seed, f"{purpose}.spawn").integers(len(free)))]

    def _draw_position(self, number: int, blueprint: Blueprint, purpose: str, where: Where) -> int:
        """Draw a position anywhere on the map, after a number of others."""
        usable = self._usable(blueprint, np.ones(len(self.starts.vehicles), bool))
        if not len(usable):
            raise InputError(f"{where('blueprint')}: {no_lane(blueprint, self.network)}")
        rng = stream(self.seed, f"{purpose}.place")
        return int(usable[[rng.integers(len(usable)) for _ in range(number + 1)][-1]])

    def _draw_position_around(
        self, agent: Agent, chain: Chain | None, blueprint: Blueprint, purpose: str, where: Where
    ) -> int:
        """Draw a position near another agent or an end of the chain, apart from all others."""
        positions, areas = self.starts.vehicles, list(self._areas(agent, chain, blueprint, purpose))
        is_taken = on_lanes_near(positions, self.vehicles, self.scenario.traffic)
        # A permutation of all positions: those that other agents take leave the order of the remaining ones unchanged.
        order = stream(self.seed, f"{purpose}.place").permutation(len(positions))
        for end, in_area, _ in areas:
            usable = self._usable(blueprint, in_area & ~is_taken)
            for position_index in order[np.isin(order, usable)].tolist():
                start = positions.waypoint(position_index)
                if self._clearance.is_free(blueprint, start):
                    if chain is not None:
                        chain[end] = start
                    return int(position_index)
        field = where() if agent.near is None else where("near")
        raise RoomError(f"{field}: no free start {areas[-1][2]} for {blueprint.name} in map {self.network.name}")

    def _areas(
        self, agent: Agent, chain: Chain | None, blueprint: Blueprint, purpose: str
    ) -> Iterator[tuple[int, BoolArray, str]]:
        """For each end of a chain, in random order, its index, (N,) positions where the agent may start, and words.

        Without a chain, the positions around the agent that it is near.
        """
        positions, near = self.starts.vehicles, agent.starts_near
        rules = self.scenario.traffic.spawn_radius_m, self.seed, purpose
        if chain is None or near is None:
            yield 0, *is_near(positions.position_m, near, self.position_m, *rules)
            return
        first = int(stream(self.seed, f"{purpose}.end").integers(2))
        for end in (first, 1 - first):
            last_m, _ = self.network.pose_on_lane(chain[end].lane, chain[end].s_m)
            distance = near.model_copy(update={"agent": None})
            in_area, area = is_near(positions.position_m, distance, {"either end of the chain": last_m}, *rules)
            yield end, in_area & self._on_road(blueprint, chain[end], last_m, ahead=end == _FRONT), area

    def _on_road(self, blueprint: Blueprint, last: WaypointSpec, last_m: Float64Array, *, ahead: bool) -> BoolArray:
        """(N,) whether the road leads to each position, or from it, without detours."""
        positions, streets = self.starts.vehicles, streets_of(self.network)
        edge_m = streets.for_blueprint(blueprint).distances_m(self.network.lanes[last.lane].edge, ahead=ahead)
        along_m = edge_m[streets.edge[positions.row]] + (1.0 if ahead else -1.0) * (positions.s_m - last.s_m)
        distance_m = np.linalg.norm(positions.position_m - last_m, axis=1)
        return np.asarray((along_m >= 0.0) & (along_m <= _MAX_DETOUR * distance_m))

    def _usable(self, blueprint: Blueprint, is_allowed: BoolArray) -> Int64Array:
        """Indices of allowed positions, (N,), with enough road ahead, if possible without turns that are too tight."""
        usable = self.starts.usable(self.duration_s)[blueprint.name] & is_allowed
        if not usable.any():
            usable = self.starts.usable_on_tight_turns(blueprint, self.duration_s) & is_allowed
        return np.flatnonzero(usable)


def on_lanes_near(positions: LanePositions, agents: Sequence[VehicleSpec], traffic: Traffic) -> BoolArray:
    """(N,) whether positions are so near the start of an agent, and on its lane, that no other vehicle starts there."""
    clearance_m = _LANE_CLEARANCE * traffic.waypoint_spacing_m
    return np.any([positions.on_lane_near(agent.start, clearance_m) for agent in agents], axis=0)


def _blueprint_of(agent: Ego, where: Where) -> Blueprint:
    by_name = {blueprint.name: blueprint for blueprint in load_blueprints() if blueprint.kind == "vehicle"}
    if agent.blueprint not in by_name:
        raise InputError(f"{where('blueprint')}: no vehicle {agent.blueprint!r}; allowed: {', '.join(by_name)}")
    return by_name[agent.blueprint]
