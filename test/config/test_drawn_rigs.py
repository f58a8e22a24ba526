"""Rigs that are drawn for each scene: what can be drawn, what is drawn, and what is refused."""

import pytest

from simbev_ros.config.load import parse_scenario
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.agent_spec import AgentSpec

CONFIG = """
scenes: [{map: Blocks, train: 24}]
traffic: {vehicles: 0, pedestrians: 0}
rig:
  sensors:
    - {type: lidar, name: lidar, rate_hz: 10, pose: {x_m: 0.5}}
    - {type: camera, name: cam_left, pose: {y_m: 0.4}}
    - {type: camera, name: cam_right, pose: {y_m: -0.4}}
  drawn:
"""
DRAWN = """
    lidar: {preset: {choice: [VLP-16, HDL-32E]}, pose.z_m: {uniform: [1.4, 2.3]}}
    cam_*: {pose.z_m: {uniform: [1.2, 2.0]}, exposure.compensation_ev: {choice: [-1, 0, 1]}}
    cam_left: {pose.pitch_deg: {normal: [0, 1], min: -2, max: 2}}
"""


def scenario(drawn: str) -> Scenario:
    return parse_scenario(f"{CONFIG}{drawn}", "drawn.yaml")


@pytest.fixture(scope="module")
def agents() -> list[AgentSpec]:
    config = scenario(DRAWN)
    return [draw_scene(config, each, load_network(each.map)).agents[0] for each in planned_scenes(config)]


def test_each_scene_has_values_of_its_own(agents: list[AgentSpec]):
    lidars = [agent.rig.sensors[0] for agent in agents]
    by_preset = {lidar.preset: (lidar.channels, lidar.lower_fov_deg) for lidar in lidars}
    assert by_preset == {"VLP-16": (16, -15.0), "HDL-32E": (32, -30.67)}
    heights_m = [lidar.pose.z_m for lidar in lidars]
    assert len(set(heights_m)) == len(lidars)
    assert 1.4 <= min(heights_m) < 1.6
    assert 2.1 < max(heights_m) <= 2.3
    assert {lidar.pose.x_m for lidar in lidars} == {0.5}
    assert {lidar.rate_hz for lidar in lidars} == {10.0}


def test_sensors_of_a_pattern_share_each_draw(agents: list[AgentSpec]):
    pairs = [agent.rig.sensors[1:] for agent in agents]
    assert all(left.pose.z_m == right.pose.z_m for left, right in pairs)
    assert {left.exposure.compensation_ev for left, _ in pairs} == {-1.0, 0.0, 1.0}
    assert all(right.pose.pitch_deg == 0.0 and abs(left.pose.pitch_deg) <= 2.0 for left, right in pairs)
    assert len({left.pose.pitch_deg for left, _ in pairs}) > len(pairs) / 2
    assert {(left.pose.y_m, right.pose.y_m) for left, right in pairs} == {(0.4, -0.4)}


def test_the_rig_of_a_scene_is_fixed_and_depends_on_seed_and_agent_alone(agents: list[AgentSpec]):
    config = scenario(DRAWN)
    again = parse_scenario(config.as_yaml(), "again.yaml")
    assert again == config
    planned = list(planned_scenes(again))[7]
    assert draw_scene(again, planned, load_network(planned.map)).agents[0] == agents[7]
    assert not any(agent.rig.drawn for agent in agents)
    assert "drawn" not in agents[0].model_dump_json()


@pytest.mark.parametrize(
    ("drawn", "problem"),
    [
        ("lidr: {preset: {choice: [VLP-16]}}", "drawn.lidr: matches no sensor; names are lidar, cam_left, cam_right"),
        (
            "lidar: {preset: {choice: [VLP-17]}}",
            "drawn.lidar.preset: draws 'VLP-17' .*allowed: VLP-16",
        ),
        ("lidar: {rate_hz: {choice: [10, 20]}}", "drawn.lidar.rate_hz: decides which topics there are"),
        ("lidar: {pose.z_m: {uniform: [1, 300]}}", "drawn.lidar.pose.z_m: draws 300.0 for sensor lidar: .*200"),
        ("lidar: {pose.z_m: {uniform: [1, 30]}}", r"sensors\[0\].pose.z_m: is 30, but at most 20 is allowed"),
        ("lidar: {pose.q_m: {uniform: [1, 3]}}", "drawn.lidar.pose.q_m: draws 1.0 for sensor lidar: .*not permitted"),
        ("lidar: {pose.pitch_deg: {normal: [0, 1]}}", "drawn.lidar.pose.pitch_deg: draws -inf"),
        ("cam_left: {preset: {choice: [x]}}", "drawn.cam_left.preset: sensor cam_left needs a rate_hz of its own"),
        ("lidar: {channels: 3}", "drawn.lidar.channels: .*not 3"),
        ("lidar: {range_m: {choice: []}}", "drawn.lidar.range_m.choice: must have at least 1 items"),
    ],
)
def test_what_no_sensor_can_have_is_refused(drawn: str, problem: str):
    with pytest.raises(InputError, match=problem):
        scenario(f"    {drawn}")


def test_a_fixed_preset_is_not_drawn_too():
    with pytest.raises(InputError, match=r"drawn.lidar.preset: sensor lidar has a fixed one, too"):
        parse_scenario(f"{CONFIG}{DRAWN}".replace("name: lidar,", "name: lidar, preset: VLP-16,"), "drawn.yaml")


def test_values_that_contradict_each_other_in_a_scene_are_named():
    many = ("1024", "16384")  # one of them alone is allowed, and so are the first and the last ones together
    config = scenario(
        f"    lidar: {{channels: {{choice: ['16', '{many[0]}', '20']}}}}\n"
        f"    lid*: {{columns: {{choice: ['512', '{many[1]}', '600']}}}}"
    )
    with pytest.raises(
        InputError, match=r"rig.drawn of agent ego: cannot be drawn together: .*rays per turn are too many"
    ):
        for planned in planned_scenes(config):
            draw_scene(config, planned, load_network(planned.map))


@pytest.mark.parametrize(("carrier", "highest_m"), [("", 30), ("mast: {height_m: 150, poses: [{x_m: 0, y_m: 0}]}", 60)])
def test_sensors_of_other_agents_are_not_drawn_too_high(carrier: str, highest_m: float):
    agents = f"""
agents:
  - name: other
    rig:
      sensors: [{{type: lidar, name: lidar}}]
      drawn: {{lidar: {{pose.z_m: {{uniform: [1, {highest_m}]}}}}}}
    {carrier}
"""
    with pytest.raises(
        InputError, match="at most 20" if not carrier else "with it, sensor lidar is 210 m above the foot"
    ):
        scenario(DRAWN + agents)
