"""One graph records scenes with different agents, each as if it were made alone."""

import shutil
from pathlib import Path

import pytest
from commands import Simbev

from simbev_ros.config.load import load_scenario
from simbev_ros.dataset import open_dataset
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag
from simbev_ros.scene.drawing.draw_agents import drawn_names

pytestmark = [pytest.mark.graph, pytest.mark.slow]

TEAMS = """
seed: 82
scenes: [{map: Blocks, train: 2}]
time: {warm_up_s: 0.5, duration_s: 0.5}
agents:
  - {name: ego, rig: rig.yaml}
  - {name: car, rig: rig.yaml, count: {integer: [0, 2]}, arrangement: {choice: [cluster, chain]}}
  - {name: rsu, rig: rig.yaml, count: {integer: [0, 1]}, mast: {junction: {}}}
v2x: {rate_hz: 2, latency_s: 0}
weather: {cloudiness: 20, precipitation: 0, sun_altitude_deg: 45, fog_density: 0}
traffic: {vehicles: 8, pedestrians: 5, spawn_radius_m: 150}
annotation: {rate_hz: 2, bev: {rows: 100, columns: 100}}
"""
RIG = """
sensors:
  - {type: lidar, name: lidar, rate_hz: 4, columns: 256, rolling: false}
  - {type: imu, name: imu}
drawn:
  lidar: {preset: {choice: [VLP-16, HDL-32E]}, pose.z_m: {uniform: [1.7, 2.2]}}
"""


def digests(bag: Path) -> dict[str, str]:
    with SceneBag(bag) as opened:
        return topic_digests(opened)


def test_scenes_of_one_graph_have_the_agents_that_are_drawn_for_them(simbev: Simbev, tmp_path: Path) -> None:
    config, out = tmp_path / "teams.yaml", tmp_path / "out"
    config.write_text(TEAMS, encoding="utf-8")
    (tmp_path / "rig.yaml").write_text(RIG, encoding="utf-8")
    code, output = simbev("generate", config, "--out", out).finish(300)
    assert code == 0, output
    scenes, scenario = open_dataset(out, threads=1).scenes, load_scenario(config)
    agents = [("ego", *(name for entry in scenario.agents for name in drawn_names(entry, s.spec.seed))) for s in scenes]
    assert [scene.agents for scene in scenes] == agents and len(set(agents)) > 1
    for scene in scenes:
        assert verify_bag(scene.path) == []
        topics = digests(scene.path)
        named = {name.split("/")[1] for name in topics if name.endswith("/lidar/points")}
        assert named == {*scene.agents}
        assert ("/world/boxes" in topics, "/ego/v2x" in topics) == (len(scene.agents) > 1,) * 2
    last = scenes[-1].path
    first_made = digests(last)
    shutil.rmtree(last)
    code, output = simbev("generate", config, "--out", out, "--replace", "1").finish(300)
    assert code == 0, output
    assert digests(last) == first_made
