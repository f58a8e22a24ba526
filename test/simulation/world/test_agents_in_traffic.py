"""Several agents in one scene: outside nodes drive some of their vehicles, traffic the others."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from scene_edits import ego
from several_agents import car, roadside_unit, with_agents
from world_scenes import TICK_S, blocks, run, scene

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.foundation.types import Table
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.schema.scene.spec import SceneSpec, VehicleSpec, WaypointSpec
from simbev_ros.schema.scene.state import EGO_ID, Event
from simbev_ros.simulation.world.simulation import Simulation
from simbev_ros.simulation.world.sumo import vehicle_routes

Commands = Mapping[int, tuple[float, float]]
"""Desired speed, m/s, and yaw rate, rad/s, of vehicles by their indices in the specification."""


def on_longest_lane(vehicle: VehicleSpec, s_m: float) -> VehicleSpec:
    """The vehicle as a sedan at a distance from the start of the longest driving lane."""
    lanes = [lane for lane in blocks().lanes.values() if lane.kind is LaneKind.DRIVING and not lane.junction]
    start = WaypointSpec(lane=max(lanes, key=lambda lane: lane.length_m).id, s_m=s_m)
    return vehicle.model_copy(update={"start": start, "blueprint": "vehicle.sedan"})


def in_a_row(*agents: dict[str, Any], ego_driver: str = "twist") -> SceneSpec:
    """Three sedans on one lane, the first one 20 m behind the second and 60 m behind the third; nobody else."""
    spec = scene(vehicles=3, pedestrians=0, ticks=160, agents=[ego(driver=ego_driver)])
    vehicles = tuple(map(on_longest_lane, spec.vehicles, (20.0, 40.0, 80.0)))
    return with_agents(spec.model_copy(update={"vehicles": vehicles}), *agents)


def drive(spec: SceneSpec, commands: Commands | Callable[[int], Commands]) -> tuple[Table, list[Event]]:
    """(T, N) actors of the recorded ticks of a scene with the same commands, or those of the tick, and all events."""
    rows, events = [], []
    with Simulation(spec, blocks()) as simulation:
        for _ in range(spec.warm_up_ticks):
            simulation.step()
        for tick in range(spec.ticks):
            for vehicle, command in (commands(tick) if callable(commands) else commands).items():
                simulation.drive_vehicle(vehicle, *command)
            state = simulation.step()
            rows.append(state.actors)
            events += state.events
    return np.stack(rows), events


@pytest.mark.slow
def test_agents_in_traffic_drive_like_vehicles_without_a_rig() -> None:
    spec = scene(vehicles=12, pedestrians=4, ticks=80)
    expected = [state.actors.tobytes() for state in run(spec)]
    carried = with_agents(spec, car("car", 2), car("bus", 9), roadside_unit())
    assert [state.actors.tobytes() for state in run(carried)] == expected


def test_each_agent_follows_its_own_commands() -> None:
    spec = in_a_row(car("car", 2, driver="twist"))
    actors, events = drive(spec, {0: (3.0, 0.0), 2: (6.0, 0.3)})
    first, second = actors[100:, 0], actors[100:, 2]
    assert np.hypot(first["vx"], first["vy"]).mean() == pytest.approx(3.0, abs=0.1)
    assert np.hypot(second["vx"], second["vy"]).mean() == pytest.approx(6.0, abs=0.2)
    assert first["wz"] == pytest.approx(0.0, abs=0.01)
    assert second["wz"].mean() == pytest.approx(0.3, abs=0.02)
    for rows in (first, second):
        moved_m = np.hypot(np.diff(rows["x"]), np.diff(rows["y"]))
        assert moved_m == pytest.approx(np.hypot(rows["vx"], rows["vy"])[1:] * TICK_S, abs=0.02)
    assert not events


@pytest.mark.parametrize("moving", [pytest.param(0, marks=pytest.mark.slow), 2])
def test_an_agent_without_commands_stands_while_another_one_drives(moving: int) -> None:
    spec = in_a_row(car("car", 2, driver="twist"), roadside_unit())
    actors, _ = drive(spec, {moving: (2.0, 0.0)})
    moved_m = np.hypot(*(actors[-1][name] - actors[0][name] for name in ("x", "y")))
    assert moved_m[moving] > 10.0
    assert moved_m[2 - moving] == 0.0


def test_commands_to_vehicles_in_traffic_are_ignored() -> None:
    spec = in_a_row(car("driven", 2, driver="twist"), car("other", 1), ego_driver="traffic")
    expected, _ = drive(spec, {2: (5.0, 0.0)})
    actors, _ = drive(spec, {2: (5.0, 0.0), 0: (0.0, 1.0), 1: (20.0, -1.0), 99: (5.0, 5.0)})
    assert actors.tobytes() == expected.tobytes()


@pytest.mark.slow
def test_the_same_commands_give_the_same_bytes_whatever_the_order_of_the_agents() -> None:
    agents = car("a", 1, driver="twist"), car("b", 2, driver="twist")
    commands = {0: (4.0, 0.0), 1: (5.0, 0.1), 2: (6.0, -0.2)}
    expected, _ = drive(in_a_row(*agents), commands)
    found, _ = drive(in_a_row(*agents[::-1]), dict(reversed(commands.items())))
    assert found.tobytes() == expected.tobytes()


def test_a_crash_of_two_agents_is_one_event() -> None:
    spec = in_a_row(car("car", 1, driver="twist"))
    actors, events = drive(spec, {0: (8.0, 0.0), 1: (0.0, 0.0)})
    (event,) = events
    assert (event.type, event.ids) == ("collision", (EGO_ID, EGO_ID + 1))
    assert event.relative_speed_mps == pytest.approx(8.0, abs=1.0)
    last = actors[-1][:2]
    assert np.hypot(last["vx"], last["vy"]) == pytest.approx(0.0, abs=0.01)


def test_traffic_stops_behind_a_standing_agent() -> None:
    spec = in_a_row(car("car", 2, driver="twist"), ego_driver="traffic")
    actors, events = drive(spec, {})
    standing, queue = actors[-1][2], actors[-1][1]
    gap_m = np.hypot(standing["x"] - queue["x"], standing["y"] - queue["y"]) - standing["length"]
    assert np.hypot(queue["vx"], queue["vy"]) < 0.1 and 0.5 < gap_m < 8.0
    assert not events


def test_vehicles_driven_from_outside_get_no_routes(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = with_agents(scene(vehicles=6, pedestrians=0), car("car", 3, driver="twist"))
    edges = {f"v{index}": blocks().lanes[each.start.lane].edge for index, each in enumerate(spec.vehicles)}
    routed: dict[str, list[str]] = {"extend_route": [], "replace_route": []}
    monkeypatch.setattr(vehicle_routes, "ending_edge", edges.__getitem__)
    monkeypatch.setattr(vehicle_routes, "stands_in_wrong_lane", lambda _: True)
    for name, names in routed.items():
        monkeypatch.setattr(vehicle_routes, name, lambda name, *_, names=names: names.append(name))
    with Simulation(spec, blocks()) as simulation:
        outside = simulation._outside_drivers
        simulation._sumo.keep_on_routes(simulation._routes, 0, outside, detours=True)
    assert routed["extend_route"] == routed["replace_route"] == ["v0", "v1", "v2", "v4", "v5"]


def test_an_agent_without_room_is_named() -> None:
    spec = scene(vehicles=3, pedestrians=0)
    crowded = spec.model_copy(update={"vehicles": (*spec.vehicles, spec.vehicles[2])})
    place = rf"lane {spec.vehicles[2].start.lane}, {spec.vehicles[2].start.s_m:.1f} m"
    with pytest.raises(SimulationError, match=rf"^Blocks-0000: agent car does not fit at its start, {place}$"):
        Simulation(with_agents(crowded, car("bus", 1), roadside_unit(), car("car", 3)), blocks())
