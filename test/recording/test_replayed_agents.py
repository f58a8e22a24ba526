"""Agents of a replay: recorded ones keep their vehicles, masts stand where they stood, new ones need a vehicle."""

from pathlib import Path

import pytest

from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes, start_positions
from simbev_ros.schema.scene.agent_spec import AgentSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.replay.replayed_agents import replayed_agents

HEAD = """
seed: 5
scenes: [{map: Blocks, train: 1}]
traffic: {vehicles: 10, pedestrians: 5, spawn_radius_m: 150}
agents:
  - {name: ego, rig: {sensors: []}}
"""
CAR = "  - {name: car, rig: {sensors: []}, blueprint: vehicle.van, driver: twist}\n"
MASTS = "  - {name: rsu, rig: {sensors: [{type: imu, name: imu}]}, count: 2, mast: {junction: {}, height_m: 5}}\n"


def scenario(folder: Path, *agents: str) -> Scenario:
    file = folder / "agents.yaml"
    file.write_text(HEAD + "".join(agents), encoding="utf-8")
    return load_scenario(str(file))


def drawn(chosen: Scenario) -> SceneSpec:
    planned = next(planned_scenes(chosen))
    return draw_scene(chosen, planned, load_network(planned.map))


def replayed(spec: SceneSpec, chosen: Scenario) -> tuple[AgentSpec, ...]:
    network = load_network(spec.map)
    return replayed_agents(spec, chosen, network, start_positions(chosen, network))


def test_the_same_configuration_gives_the_same_agents(tmp_path: Path) -> None:
    chosen = scenario(tmp_path, CAR, MASTS)
    spec = drawn(chosen)
    assert [agent.name for agent in spec.agents] == ["ego", "car", "rsu_1", "rsu_2"]
    assert replayed(spec, chosen) == spec.agents


def test_an_agent_that_is_left_out_is_a_vehicle_like_others(tmp_path: Path) -> None:
    spec = drawn(scenario(tmp_path, CAR, MASTS))
    assert replayed(spec, scenario(tmp_path)) == spec.agents[:1]
    assert replayed(spec, scenario(tmp_path, MASTS)) == (spec.agents[0], *spec.agents[2:])


def test_new_agents_ride_in_recorded_vehicles_or_stand_on_masts(tmp_path: Path) -> None:
    spec = drawn(scenario(tmp_path))
    bus = "  - {name: bus, rig: {sensors: []}, carrier: 4}\n"
    ego, car, *masts = replayed(spec, scenario(tmp_path, bus, MASTS))
    assert ego == spec.agents[0]
    assert (car.rig.agent, car.vehicle, car.driver, car.station) == ("bus", 3, "traffic", None)
    assert [mast.rig.agent for mast in masts] == ["rsu_1", "rsu_2"]
    assert all(mast.station is not None and mast.rig.sensors[0].pose.z_m == 5 for mast in masts)


@pytest.mark.parametrize(
    ("agents", "message"),
    [
        (
            "  - {name: bus, rig: {sensors: []}}\n",
            r"agents.yaml:7: agents\[1\].carrier: is missing; recorded scene Blocks-0000 has no vehicle with an agent "
            r"'bus' \(it has car\), so name the one that is to carry it: 2 to \d+",
        ),
        (
            "  - {name: bus, rig: {sensors: []}, carrier: 1}\n",
            r"agents.yaml:7: agents\[1\].carrier: scene Blocks-0000 has no vehicle 1 besides the first agent's; ",
        ),
        (
            "  - {name: bus, rig: {sensors: []}, carrier: 9999}\n",
            r"agents\[1\].carrier: scene Blocks-0000 has no vehicle 9999 besides the first agent's; allowed: 2 to \d+",
        ),
        (
            CAR + "  - {name: bus, rig: {sensors: []}, carrier: 2}\n",
            r"agents.yaml:8: agents\[2\]: vehicle 2 carries car; it can carry one agent",
        ),
    ],
)
def test_an_agent_without_a_vehicle_of_its_own_is_refused(tmp_path: Path, agents: str, message: str) -> None:
    spec = drawn(scenario(tmp_path, CAR))
    with pytest.raises(InputError, match=message):
        replayed(spec, scenario(tmp_path, agents))


def test_a_carrier_is_for_replays(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"agents.yaml:7: agents\[1\].carrier: is for replays alone"):
        drawn(scenario(tmp_path, "  - {name: bus, rig: {sensors: []}, carrier: 4}\n"))
    with pytest.raises(InputError, match=r"agents.yaml:7: agents\[1\].carrier: count and carrier are set"):
        scenario(tmp_path, "  - {name: bus, rig: {sensors: []}, carrier: 4, count: 2}\n")
    with pytest.raises(InputError, match=r"agents\[1\].carrier: leave it out; an agent with a mast is a roadside unit"):
        scenario(tmp_path, "  - {name: rsu, rig: {sensors: []}, carrier: 4, mast: {junction: {}}}\n")
