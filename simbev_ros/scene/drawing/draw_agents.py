"""Draw the agents of a scene: the vehicles that carry them, their starts, colors and drivers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from simbev_ros.config.agents import Agent, Ego
from simbev_ros.config.draw import sample
from simbev_ros.config.scenario import Scenario, Traffic
from simbev_ros.errors import InputError
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.random import stream
from simbev_ros.scene.agent_spec import AgentSpec
from simbev_ros.scene.blueprints import Blueprint, blueprint_named, load_blueprints
from simbev_ros.scene.drawing.drivers import draw_driver, draw_vehicle
from simbev_ros.scene.drawing.spawn import Where, no_lane, spawn_starts
from simbev_ros.scene.drawing.start_clearance import StartClearance
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.frames import base_link_x_m
from simbev_ros.scene.spec import VehicleSpec, WaypointSpec
from simbev_ros.scene.streets.lane_positions import LanePositions
from simbev_ros.types import BoolArray, Float64Array, Int64Array

_LANE_CLEARANCE = 0.99  # of the waypoint spacing: no other vehicle starts closer to an agent on its lane


class DrawnAgents(NamedTuple):
    """The A agents of a scene, the first one first.

    Attributes:
        vehicles: The vehicles that carry them.
        start_m: (A, 3) float64, their starts, map frame.
        further: Specifications of the agents beside the first one.
    """

    vehicles: tuple[VehicleSpec, ...]
    start_m: Float64Array
    further: tuple[AgentSpec, ...]


class _Carrier(NamedTuple):
    """A vehicle that carries an agent, and its (3,) start, map frame."""

    vehicle: VehicleSpec
    start_m: Float64Array


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
    drawer = _CarrierDrawer(scenario, seed, network, starts, duration_s, clearance)
    carriers = {scenario.rig.agent: drawer.draw(scenario.ego, "ego", partial(scenario.where, "ego"), {})}
    further = list[AgentSpec]()
    for index, agent in enumerate(scenario.agents):
        count = 1 if agent.count is None else round(sample(agent.count, stream(seed, f"agents.{agent.name}.count")))
        for name in agent.names(count):
            carriers[name] = drawer.draw(agent, f"agents.{name}", partial(scenario.where, "agents", index), carriers)
            further.append(_specification(scenario, agent, name, len(further) + 1))
    vehicles, start_m = zip(*carriers.values(), strict=True)
    return DrawnAgents(vehicles, np.array(start_m), tuple(further))


def _specification(scenario: Scenario, agent: Agent, name: str, vehicle_index: int) -> AgentSpec:
    frames = scenario.frames if agent.frames is None else agent.frames
    return AgentSpec(
        rig=agent.rig.model_copy(update={"agent": name}),
        frames=frames,
        base_link_x_m=base_link_x_m(frames, blueprint_named(agent.blueprint)),
        annotation=scenario.annotation if agent.annotation is None else agent.annotation,
        vehicle=vehicle_index,
        driver=agent.driver,
    )


@dataclass(frozen=True, slots=True)
class _CarrierDrawer:
    """Draws vehicles that carry agents, with the arguments of ``draw_agents``."""

    scenario: Scenario
    seed: int
    network: RoadNetwork
    starts: StartPositions
    duration_s: float
    clearance: StartClearance

    def draw(self, agent: Ego, purpose: str, where: Where, others: Mapping[str, _Carrier]) -> _Carrier:
        """Draw the vehicle of the agent whose random streams begin with ``purpose``, given those drawn before it."""
        blueprint, positions = _blueprint_of(agent, where), self.starts.vehicles
        if agent.spawn:
            start = self._draw_pose(agent, blueprint, purpose, where)
            start_m, _ = self.network.pose_on_lane(start.lane, start.s_m)
        else:
            position_index = (
                self._draw_position_around(agent, blueprint, purpose, where, others)
                if isinstance(agent, Agent)
                else self._draw_position(blueprint, purpose, where)
            )
            start, start_m = positions.waypoint(position_index), positions.position_m[position_index]
        traffic, rng = self.scenario.traffic, stream(self.seed, f"{purpose}.style")
        driver = draw_driver(traffic, blueprint, self.seed, purpose, opens_doors=False)
        vehicle = draw_vehicle(traffic, blueprint, start, rng, agent.reckless_probability, driver)
        self.clearance.occupy(vehicle)
        return _Carrier(vehicle, start_m)

    def _draw_pose(self, agent: Ego, blueprint: Blueprint, purpose: str, where: Where) -> WaypointSpec:
        """Draw one of the poses of an agent at which no other agent stands."""
        starts = spawn_starts(agent.spawn, blueprint, self.network, where)
        free = [start for start in starts if self.clearance.is_free(blueprint, start)]
        if not free:
            raise InputError(f"{where('spawn')}: agents listed earlier leave no room for {blueprint.name} at any pose")
        return free[int(stream(self.seed, f"{purpose}.spawn").integers(len(free)))]

    def _draw_position(self, blueprint: Blueprint, purpose: str, where: Where) -> int:
        """Draw a position anywhere on the map."""
        usable = self._usable(blueprint, np.ones(len(self.starts.vehicles), bool))
        if not len(usable):
            raise InputError(f"{where('blueprint')}: {no_lane(blueprint, self.network)}")
        return int(usable[stream(self.seed, f"{purpose}.place").integers(len(usable))])

    def _draw_position_around(
        self, agent: Agent, blueprint: Blueprint, purpose: str, where: Where, others: Mapping[str, _Carrier]
    ) -> int:
        """Draw a position near another agent, apart from all others."""
        positions = self.starts.vehicles
        in_area, area = self._area(agent, purpose, others)
        is_taken = on_lanes_near(positions, [other.vehicle for other in others.values()], self.scenario.traffic)
        usable = self._usable(blueprint, in_area & ~is_taken)
        # A permutation of all positions: those that other agents take leave the order of the remaining ones unchanged.
        order = stream(self.seed, f"{purpose}.place").permutation(len(positions))
        for position_index in order[np.isin(order, usable)].tolist():
            if self.clearance.is_free(blueprint, positions.waypoint(position_index)):
                return int(position_index)
        field = where() if agent.near is None else where("near")
        raise InputError(f"{field}: no free start {area} for {blueprint.name} in map {self.network.name}")

    def _area(self, agent: Agent, purpose: str, others: Mapping[str, _Carrier]) -> tuple[BoolArray, str]:
        """(N,) whether an agent may start at the positions, and words for the area in which it may."""
        positions, first = self.starts.vehicles, self.scenario.rig.agent
        if agent.near is None:
            radius_m = self.scenario.traffic.spawn_radius_m
            is_inside = positions.within_radius(others[first].start_m, radius_m)
            return is_inside, f"within {radius_m:g} m (traffic.spawn_radius_m) of {first}"
        other = agent.near.agent or first
        wanted_m = sample(agent.near.distance_m, stream(self.seed, f"{purpose}.distance"))
        low_m, high_m = wanted_m - agent.near.tolerance_m, wanted_m + agent.near.tolerance_m
        distance_m = np.linalg.norm(positions.position_m[:, :2] - others[other].start_m[:2], axis=1)
        return (low_m <= distance_m) & (distance_m <= high_m), f"{max(low_m, 0.0):.4g} to {high_m:.4g} m from {other}"

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
