"""The agents of a replay: the ego, recorded ones again, and new ones on recorded vehicles or masts."""

from functools import partial

from simbev_ros.config.agents import Agent, EgoDriverKind
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.drawing.draw_agents import agent_on_mast, agent_on_vehicle, drawn_names, ego_spec
from simbev_ros.scene.drawing.draw_stations import StationDrawer
from simbev_ros.scene.drawing.spawn import Where
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.schema.scene.agent_spec import AgentSpec, StationSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID


def replayed_agents(
    spec: SceneSpec, scenario: Scenario, network: RoadNetwork, starts: StartPositions
) -> tuple[AgentSpec, ...]:
    """Specifications of the agents of a replay.

    The ego rides in its recorded vehicle, any other agent in its ``carrier``, or else in the vehicle that carried the
    agent of its name. Masts are drawn again. A recorded agent that the configuration lacks is a vehicle like others.

    Args:
        spec: The recorded scene.
        scenario: The configuration.
        network: Roads of the scene's map.
        starts: Positions on them, and places for masts.

    Raises:
        InputError: An agent has no vehicle in the recorded scene, or one that another agent has; or a mast cannot be
            drawn.
    """
    drivers: dict[int | None, EgoDriverKind] = {each.vehicle: each.driver for each in spec.agents}
    agents = [ego_spec(scenario, spec.seed, spec.vehicles[0], drivers[0])]
    if not scenario.agents:
        return tuple(agents)
    starts_m = {scenario.rig.agent: _start_m(spec, network, 0)}
    masts = StationDrawer(spec.seed, network, starts, scenario.traffic.spawn_radius_m, starts_m, [])
    for number, agent in enumerate(scenario.agents):
        where, siblings = partial(scenario.where, "agents", number), list[StationSpec]()
        for name in drawn_names(agent, spec.seed):
            if agent.mast is None:
                index = _vehicle_index(spec, agent, name, where)
                if rival := next((each.name for each in agents if each.vehicle == index), None):
                    raise InputError(f"{where()}: vehicle {EGO_ID + index} carries {rival}; it can carry one agent")
                driver = drivers.get(index, "traffic")
                agents.append(agent_on_vehicle(scenario, spec.seed, agent, name, spec.vehicles[index], index, driver))
                starts_m[name] = _start_m(spec, network, index)
            else:
                siblings.append(masts.draw(agent.mast, name, partial(where, "mast"), siblings))
                agents.append(agent_on_mast(scenario, spec.seed, agent, agent.mast, name, siblings[-1]))
    return tuple(agents)


def _vehicle_index(spec: SceneSpec, agent: Agent, name: str, where: Where) -> int:
    """Index in the scene of the vehicle that carries an agent."""
    last = EGO_ID + len(spec.vehicles) - 1
    if agent.carrier is not None:
        if not EGO_ID < agent.carrier <= last:
            raise InputError(
                f"{where('carrier')}: scene {spec.name} has no vehicle {agent.carrier} besides the first agent's; "
                f"allowed: {EGO_ID + 1} to {last}"
            )
        return agent.carrier - EGO_ID
    recorded = {each.name: each.vehicle for each in spec.agents[1:] if each.vehicle is not None}
    if name not in recorded:
        raise InputError(
            f"{where('carrier')}: is missing; recorded scene {spec.name} has no vehicle with an agent {name!r} "
            f"(it has {', '.join(recorded) or 'only the first one'}), so name the one that is to carry it: "
            f"{EGO_ID + 1} to {last}"
        )
    return recorded[name]


def _start_m(spec: SceneSpec, network: RoadNetwork, index: int) -> Float64Array:
    """(3,) start of a vehicle, map frame."""
    start = spec.vehicles[index].start
    return network.pose_on_lane(start.lane, start.s_m)[0]
