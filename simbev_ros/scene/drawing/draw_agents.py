"""Draw the agents of a scene: the vehicles that carry them, their starts, colors and drivers, and the masts."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from simbev_ros.config.agents import Agent, Ego, EgoDriverKind
from simbev_ros.config.base import Model, first_problem
from simbev_ros.config.draw import sample
from simbev_ros.config.places import Mast, SpawnPose
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.sensor import Pose
from simbev_ros.config.traffic import Traffic
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, blueprint_named, load_blueprints
from simbev_ros.scene.drawing.draw_stations import StationDrawer
from simbev_ros.scene.drawing.drivers import draw_driver, draw_vehicle
from simbev_ros.scene.drawing.nearness import is_near
from simbev_ros.scene.drawing.spawn import Where, no_lane, spawn_starts
from simbev_ros.scene.drawing.start_clearance import StartClearance
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.frames import base_link_x_m
from simbev_ros.scene.streets.lane_positions import LanePositions
from simbev_ros.scene.streets.street_graph import streets_of
from simbev_ros.schema.scene.agent_spec import AgentSpec, StationSpec
from simbev_ros.schema.scene.spec import VehicleSpec, WaypointSpec

_LANE_CLEARANCE = 0.99  # of the waypoint spacing: no other vehicle starts closer to an agent on its lane


class DrawnAgents(NamedTuple):
    """The A agents of a scene, the ego first.

    Attributes:
        vehicles: The V vehicles that carry them.
        start_m: (V, 3) float64, the starts of the vehicles, map frame.
        position_m: (A, 3) float64, the starts of all agents, which for roadside units are the feet of their masts.
        specs: Specifications of the agents.
    """

    vehicles: tuple[VehicleSpec, ...]
    start_m: Float64Array
    position_m: Float64Array
    specs: tuple[AgentSpec, ...]


def draw_agents(
    scenario: Scenario,
    seed: int,
    network: RoadNetwork,
    starts: StartPositions,
    duration_s: float,
    clearance: StartClearance,
) -> DrawnAgents:
    """Draw the ego and the other agents. An agent's draws depend on its name, not on its position in the list.

    Args:
        scenario: The configuration.
        seed: Seed of the scene.
        network: Roads of the scene's map.
        starts: Positions on them where actors can start.
        duration_s: Duration of the scene with its warm-up.
        clearance: The ground where vehicles stand already; the agents' vehicles are added.

    Raises:
        InputError: An agent's blueprint is unknown or has no lane to drive on, one of its poses is off the lanes, or
            there is no free start for it.
    """
    drawn = _Drawn({}, [], [], [])
    carriers = _CarrierDrawer(scenario, seed, network, starts, duration_s, clearance, drawn)
    masts = StationDrawer(seed, network, starts, scenario.traffic.spawn_radius_m, drawn.position_m, drawn.stations)
    carriers.draw(scenario.ego, scenario.rig.agent, "ego", partial(scenario.where, "ego"))
    drawn.specs.append(ego_spec(scenario, seed, drawn.vehicles[0], scenario.ego.driver))
    for index, agent in enumerate(scenario.agents):
        where, siblings = partial(scenario.where, "agents", index), list[StationSpec]()
        if agent.carrier is not None:
            raise InputError(f"{where('carrier')}: is for replays alone, which have recorded vehicles; leave it out")
        for name in drawn_names(agent, seed):
            if agent.mast is None:
                carriers.draw(agent, name, f"agents.{name}", where)
                vehicle, number = drawn.vehicles[-1], len(drawn.vehicles) - 1
                drawn.specs.append(agent_on_vehicle(scenario, seed, agent, name, vehicle, number, agent.driver))
            else:
                siblings.append(masts.draw(agent.mast, name, partial(where, "mast"), siblings))
                drawn.specs.append(agent_on_mast(scenario, seed, agent, agent.mast, name, siblings[-1]))
    return drawn.agents()


def drawn_names(agent: Agent, seed: int) -> tuple[str, ...]:
    """Names of the agents of an entry in the scene with this seed; if the entry has a count, their number is random."""
    return agent.names(
        1 if agent.count is None else round(sample(agent.count, stream(seed, f"agents.{agent.name}.count")))
    )


def ego_spec(scenario: Scenario, seed: int, vehicle: VehicleSpec, driver: EgoDriverKind) -> AgentSpec:
    """Specification of the ego, which rides in the scene's first vehicle."""
    return AgentSpec(
        rig=_drawn_rig(scenario.rig, scenario.rig.agent, seed),
        frames=scenario.frames.of_rig(scenario.rig),
        base_link_x_m=base_link_x_m(scenario.frames, blueprint_named(vehicle.blueprint)),
        annotation=scenario.annotation,
        vehicle=0,
        driver=driver,
    )


def agent_on_vehicle(
    scenario: Scenario,
    seed: int,
    agent: Agent,
    name: str,
    vehicle: VehicleSpec,
    index: int,
    driver: EgoDriverKind,
) -> AgentSpec:
    """Specification of an agent that rides in a vehicle, which has this index in the scene."""
    frames = scenario.frames if agent.frames is None else agent.frames
    return AgentSpec(
        rig=_drawn_rig(agent.rig, name, seed),
        frames=frames.of_rig(agent.rig),
        base_link_x_m=base_link_x_m(frames, blueprint_named(vehicle.blueprint)),
        annotation=scenario.annotation if agent.annotation is None else agent.annotation,
        vehicle=index,
        driver=driver,
    )


def agent_on_mast(
    scenario: Scenario, seed: int, agent: Agent, mast: Mast, name: str, station: StationSpec
) -> AgentSpec:
    """Specification of a roadside unit; its mast raises the sensors of its rig."""
    return AgentSpec(
        rig=_raised(_drawn_rig(agent.rig, name, seed), mast.height_m),
        annotation=scenario.annotation if agent.annotation is None else agent.annotation,
        station=station,
    )


def _drawn_rig(rig: Rig, name: str, seed: int) -> Rig:
    """The rig of an agent in the scene with this seed."""
    rig = rig.model_copy(update={"agent": name})
    if not rig.drawn:
        return rig
    values = {
        pattern: {field: drawn.sample(stream(seed, f"rig.{name}.{pattern}.{field}")) for field, drawn in fields.items()}
        for pattern, fields in rig.drawn.items()
    }
    try:
        return rig.with_values(values)
    except ValueError as error:
        raise InputError(f"rig.drawn of agent {name}: cannot be drawn together: {first_problem(error)}") from None


def _raised(rig: Rig, height_m: float) -> Rig:
    """Copy of a rig with all sensors higher."""
    sensors = []
    for sensor in rig.sensors:
        pose = Pose(**_fields(sensor.pose) | {"z_m": sensor.pose.z_m + height_m})
        sensors.append(type(sensor)(**_fields(sensor) | {"pose": pose}))
    return rig.model_copy(update={"sensors": tuple(sensors)})


def _fields(model: Model) -> dict[str, Any]:
    """Values of a model's fields without what it has cached, which ``dict`` and ``model_copy`` keep."""
    return {name: getattr(model, name) for name in type(model).model_fields}


@dataclass(frozen=True, slots=True)
class _Drawn:
    """The agents drawn so far.

    Attributes:
        position_m: (3,) start of each agent, map frame, by name.
        vehicles: Vehicles that carry agents.
        stations: Roadside units.
        specs: Specifications of the agents.
    """

    position_m: dict[str, Float64Array]
    vehicles: list[VehicleSpec]
    stations: list[StationSpec]
    specs: list[AgentSpec]

    def agents(self) -> DrawnAgents:
        """All agents, when they are drawn."""
        position_m = np.array(list(self.position_m.values()))
        on_road = [agent.station is None for agent in self.specs]
        return DrawnAgents(tuple(self.vehicles), position_m[on_road], position_m, tuple(self.specs))


@dataclass(frozen=True, slots=True)
class _CarrierDrawer:
    """Draws vehicles that carry agents, with the arguments of ``draw_agents``."""

    scenario: Scenario
    seed: int
    network: RoadNetwork
    starts: StartPositions
    duration_s: float
    clearance: StartClearance
    drawn: _Drawn

    def draw(self, agent: Ego, name: str, purpose: str, where: Where) -> None:
        """Draw the vehicle of the agent with random streams ``purpose…``, and add it to those drawn."""
        blueprint, positions = _blueprint_of(agent, where), self.starts.vehicles
        keys, poses = agent.spawn_on(self.network.name)
        if poses:
            start = self._draw_pose(poses, blueprint, purpose, partial(where, *keys))
            start_m, _ = self.network.pose_on_lane(start.lane, start.s_m)
        else:
            position_index = (
                self._draw_position_around(agent, blueprint, purpose, where)
                if isinstance(agent, Agent)
                else self._draw_position(blueprint, purpose, where)
            )
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
        self.clearance.occupy(vehicle)
        self.drawn.vehicles.append(vehicle)
        self.drawn.position_m[name] = start_m

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
        free = [start for start in starts if self.clearance.is_free(blueprint, start)]
        if not free:
            raise InputError(f"{where()}: agents listed earlier leave no room for {blueprint.name} at any pose")
        return free[int(stream(self.seed, f"{purpose}.spawn").integers(len(free)))]

    def _draw_position(self, blueprint: Blueprint, purpose: str, where: Where) -> int:
        """Draw a position anywhere on the map."""
        usable = self._usable(blueprint, np.ones(len(self.starts.vehicles), bool))
        if not len(usable):
            raise InputError(f"{where('blueprint')}: {no_lane(blueprint, self.network)}")
        return int(usable[stream(self.seed, f"{purpose}.place").integers(len(usable))])

    def _draw_position_around(self, agent: Agent, blueprint: Blueprint, purpose: str, where: Where) -> int:
        """Draw a position near another agent, apart from all others."""
        positions, traffic = self.starts.vehicles, self.scenario.traffic
        in_area, area = is_near(
            positions.position_m, agent.near, self.drawn.position_m, traffic.spawn_radius_m, self.seed, purpose
        )
        is_taken = on_lanes_near(positions, self.drawn.vehicles, traffic)
        usable = self._usable(blueprint, in_area & ~is_taken)
        # A permutation of all positions: those that other agents take leave the order of the remaining ones unchanged.
        order = stream(self.seed, f"{purpose}.place").permutation(len(positions))
        for position_index in order[np.isin(order, usable)].tolist():
            if self.clearance.is_free(blueprint, positions.waypoint(position_index)):
                return int(position_index)
        field = where() if agent.near is None else where("near")
        raise InputError(f"{field}: no free start {area} for {blueprint.name} in map {self.network.name}")

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
