"""Wrecks that are cleared: they leave the tables and the roads, and traffic behind them drives on."""

import numpy as np
from scene_edits import ego
from several_agents import car, with_agents
from test_agents_in_traffic import on_longest_lane
from world_scenes import TICK_S, blocks, scene

from simbev_ros.schema.scene.state import EGO_ID, WorldState
from simbev_ros.simulation.world.simulation import Simulation

CLEARED_S = 10.0


def crash(cleared_s: float | None) -> list[WorldState]:
    """Recorded states: an agent hits the car ahead of it, and the ego drives up behind the two in traffic."""
    spec = scene(vehicles=3, pedestrians=0, ticks=700, agents=[ego()], wrecks_cleared_s=cleared_s)
    vehicles = tuple(map(on_longest_lane, spec.vehicles, (20.0, 110.0, 90.0)))
    rammer = vehicles[2].model_copy(update={"reckless": True, "ignores": ("vehicles",)})
    spec = spec.model_copy(update={"vehicles": (*vehicles[:2], rammer)})
    spec = with_agents(spec, car("standing", 1, driver="twist"))
    states = []
    with Simulation(spec, blocks()) as simulation:
        for step in range(spec.warm_up_ticks + spec.ticks):
            if 20 <= step < 120:
                simulation.drive_vehicle(1, -5.0, 0.0)
            states.append(simulation.step())
    return states


def test_a_wreck_leaves_the_scene_and_the_vehicles_behind_it_drive_on() -> None:
    states = crash(CLEARED_S)
    (at,) = [tick for tick, state in enumerate(states) if state.events]
    assert states[at].events[0].ids == (EGO_ID + 1, EGO_ID + 2)
    present = np.array([EGO_ID + 2 in state.actors["id"] for state in states])
    gone = int(np.argmin(present))
    assert (gone - at) * TICK_S == np.clip((gone - at) * TICK_S, CLEARED_S, CLEARED_S + 0.2)
    assert not present[gone:].any()
    # The other one carries an agent, and stays where it is.
    rows = [state.actors[state.actors["id"] == EGO_ID + 1][0] for state in states[gone - 5 :]]
    assert len({(row["x"], row["y"], row["z"]) for row in rows}) == 1
    ego_m = np.array([[state.ego["x"], state.ego["y"]] for state in states])
    assert np.hypot(*(ego_m[gone] - ego_m[gone - 20])) < 0.5 and np.hypot(*(ego_m[-1] - ego_m[gone])) > 3.0
    for state in states:
        assert np.all(np.abs(state.actors["z"]) < 5.0) and np.all(np.abs(state.actors["vz"]) < 1.0)


def test_without_the_rule_wrecks_stay() -> None:
    states = crash(None)
    assert len({len(state.actors) for state in states}) == 1
