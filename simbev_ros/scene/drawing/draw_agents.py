"""Draw the agents of a scene: the vehicles that carry them, their starts, colors and drivers, and the masts."""

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from simbev_ros.config.agents import Agent, EgoDriverKind
from simbev_ros.config.base import Model, first_problem
from simbev_ros.config.draw import sample
from simbev_ros.config.places import Arrangement, Arrangements, Mast
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.errors import InputError, RoomError
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.drawing.draw_carriers import CarrierDrawer, Chain
from simbev_ros.scene.drawing.draw_stations import StationDrawer
from simbev_ros.scene.drawing.route_points import routed_ego
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.frames import base_link_x_m
from simbev_ros.schema.scene.agent_spec import AgentSpec, StationSpec
from simbev_ros.schema.scene.spec import VehicleSpec

_MAX_EGO_STARTS = 100


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
    scenario: Scenario, seed: int, network: RoadNetwork, starts: StartPositions, duration_s: float
) -> DrawnAgents:
    """Draw the ego and the other agents. An agent's draws depend on its name, not on its position in the list.

    Where the others find no room around the ego, it starts elsewhere, unless the configuration says where.

    Args:
        scenario: The configuration.
        seed: Seed of the scene.
        network: Roads of the scene's map.
        starts: Positions on them where actors can start.
        duration_s: Duration of the scene with its warm-up.

    Raises:
        InputError: An agent's blueprint is unknown or has no lane to drive on, one of its poses is off the lanes, or
            there is no free start for it.
    """
    refused: RoomError | None = None
    ego_starts = 1 if routed_ego(scenario, network)[0].spawn_on(network.name)[1] else _MAX_EGO_STARTS
    for ego_start in range(ego_starts):
        try:
            return _draw_around(scenario, seed, network, starts, duration_s, ego_start)
        except RoomError as error:
            refused = refused or error
    others = f", nor around {ego_starts - 1} other starts of {scenario.rig.agent}" if ego_starts > 1 else ""
    raise InputError(f"{refused}{others}")


def _draw_around(
    scenario: Scenario, seed: int, network: RoadNetwork, starts: StartPositions, duration_s: float, ego_start: int
) -> DrawnAgents:
    """Draw the agents for one of the ego's starts, which are numbered in the order in which they are drawn.

    Raises:
        RoomError: There is no free start for an agent.
    """
    drawn = _Drawn({}, [], [], [])
    carriers = CarrierDrawer(scenario, seed, network, starts, duration_s, drawn.vehicles, drawn.position_m)
    masts = StationDrawer(seed, network, starts, scenario.traffic.spawn_radius_m, drawn.position_m, drawn.stations)
    carriers.draw_ego(ego_start)
    drawn.specs.append(ego_spec(scenario, seed, drawn.vehicles[0], scenario.ego.driver))
    for index, agent in enumerate(scenario.agents):
        where, siblings = partial(scenario.where, "agents", index), list[StationSpec]()
        if agent.carrier is not None:
            raise InputError(f"{where('carrier')}: is for replays alone, which have recorded vehicles; leave it out")
        chain = drawn.chain_of(agent) if drawn_arrangement(agent, seed) == "chain" else None
        for name in drawn_names(agent, seed):
            if agent.mast is None:
                carriers.draw(agent, name, where, chain)
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


def drawn_arrangement(agent: Agent, seed: int) -> Arrangement | None:
    """How the agents of an entry stand in the scene with this seed."""
    if isinstance(agent.arrangement, Arrangements):
        return agent.arrangement.sample(stream(seed, f"agents.{agent.name}.arrangement"))
    return agent.arrangement


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

    def chain_of(self, agent: Agent) -> Chain:
        """The chain that the agents of an entry continue: it begins with the agent that they are near."""
        name = agent.starts_near.agent if agent.starts_near is not None else None
        index = 0 if name is None else next(spec.vehicle for spec in self.specs if spec.name == name)
        assert index is not None, "the configuration allows vehicles alone"
        return [self.vehicles[index].start] * 2

    def agents(self) -> DrawnAgents:
        """All agents, when they are drawn."""
        position_m = np.array(list(self.position_m.values()))
        on_road = [agent.station is None for agent in self.specs]
        return DrawnAgents(tuple(self.vehicles), position_m[on_road], position_m, tuple(self.specs))
