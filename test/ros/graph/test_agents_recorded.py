"""Two cars with sensors in one recorded scene: one world, each in the boxes of the other, joint boxes, on any cores."""

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from commands import SCENE, Command, Simbev
from opv2v_reader import AgentFrame, moved, world_from

from simbev_exporters.opv2v.export import export_opv2v
from simbev_exporters.opv2v.frames import FrameSettings
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.scene import Scene
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag
from simbev_ros.simulation.annotation.boxes import joint

pytestmark = [pytest.mark.graph, pytest.mark.slow]

TWO_CARS = """
seed: 11
scenes: [{map: Blocks, train: 1}]
time: {warm_up_s: 1, duration_s: 0.7}
agents:
  - {name: ego, rig: rig.yaml}
  - {name: van, rig: rig.yaml, blueprint: vehicle.van, near: {distance_m: 25}}
v2x: {rate_hz: 10, latency_s: 0.1, pose_sigma_m: 0.5, range_m: 60}
weather: {cloudiness: 20, precipitation: 0, sun_altitude_deg: 45, fog_density: 0}
traffic: {vehicles: 15, pedestrians: 15, spawn_radius_m: 150}
annotation:
  bev: {rows: 100, columns: 100}
"""
RIG = """
sensors:
  - {type: camera, name: cam_front, pose: {x_m: 0.6, z_m: 1.6}, width_px: 96, height_px: 64, rate_hz: 10}
  - {type: lidar, name: lidar, pose: {z_m: 2.8}, channels: 16, columns: 256}
  - {type: radar, name: radar_front, pose: {x_m: 2.4, z_m: 0.6}, points_per_second: 4000}
  - {type: gnss, name: gnss}
  - {type: imu, name: imu}
"""


def record_two_cars(simbev: Simbev, folder: Path, cores: int) -> Path:
    folder.mkdir()
    (folder / "cars.yaml").write_text(TWO_CARS, encoding="utf-8")
    (folder / "rig.yaml").write_text(RIG, encoding="utf-8")
    code, output = simbev("run", folder / "cars.yaml", "--record", folder / "out", cores=cores).finish(300)
    assert code == 0, output
    return folder / "out" / SCENE


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    bag = record_two_cars(Command, tmp_path_factory.mktemp("cars") / "two", cores=2)
    assert verify_bag(bag) == []
    return open_dataset(bag, threads=1).scenes[0]


def test_both_have_the_same_topics(scene: Scene) -> None:
    with SceneBag(scene.path) as bag:
        names = set(topic_digests(bag))
    ours = {name.removeprefix("/ego") for name in names if name.startswith("/ego/")}
    theirs = {name.removeprefix("/van") for name in names if name.startswith("/van/")}
    assert ours | {"/robot_description"} == theirs


def test_each_is_an_actor_of_one_world_and_in_the_others_boxes(scene: Scene) -> None:
    van = scene.of_agent("van")
    for tick in range(0, len(scene), 5):
        actors, ids = scene[tick]["world/actors"], (scene.view.ego_id, van.view.ego_id)
        for agent, own, other in ((scene, *ids), (van, *reversed(ids))):
            boxes, row = agent[tick]["boxes"], actors[actors["id"] == other]
            assert own not in boxes["id"]
            box = boxes[boxes["id"] == other]
            assert len(box) == len(row) == 1
            position = agent[tick].map_from_ego[:3, 3]
            assert position == pytest.approx([actors[actors["id"] == own][name].item() for name in "xyz"], abs=1e-3)
            offset = [row[name].item() - actors[actors["id"] == own][name].item() for name in "xy"]
            assert np.hypot(*offset) == pytest.approx(box["distance"].item(), abs=0.5)


def test_points_of_an_opv2v_export_are_in_the_boxes_of_all_agents(scene: Scene, tmp_path: Path) -> None:
    settings = FrameSettings()
    export_opv2v(open_dataset(scene.path, threads=1), tmp_path, settings)
    agents = {agent.view.ego_id: agent for agent in (scene, scene.of_agent("van"))}
    counted = off = 0
    for tick in range(0, len(scene), 2):
        frames = {number: AgentFrame(tmp_path / "train" / scene.name / str(number), tick) for number in agents}
        for own, other in permutations(agents):
            frame, boxes = frames[own], agents[own][tick]["boxes"]
            points = moved(frame.world_from_lidar, frame.cloud()[0])
            for number, box in frame.meta["vehicles"].items():
                inside = np.abs(frame.in_box(number, points)) <= np.array(box["extent"])
                known = boxes["lidar_points"][boxes["id"] == number].item()
                counted, off = counted + known, off + abs(np.count_nonzero(inside.all(axis=1)) - known)
            half_m = np.array(frame.meta["vehicles"][other]["extent"])
            seen = moved(np.linalg.inv(world_from(frames[other].meta["true_ego_pos"])), points)
            on_other = np.abs(seen - [0, 0, half_m[2]]) <= half_m + 0.05
            known = boxes["lidar_points"][boxes["id"] == other].item()
            assert np.count_nonzero(on_other.all(axis=1)) >= 0.9 * known > 0, "points on the other are at its own pose"
    assert counted > 100 and off < 0.02 * counted, "points at the faces of boxes may be on either side"


def test_the_joint_boxes_say_of_each_object_what_the_tables_of_all_agents_say(scene: Scene) -> None:
    agents = {name: scene.of_agent(name) for name in scene.agents}
    shared = [name for name in joint.SHARED_DTYPE.names or () if name != "id"]
    for tick in range(len(scene)):
        rows_of = {name: {row["id"]: row for row in agent[tick]["boxes"]} for name, agent in agents.items()}
        together = scene[tick]["world/boxes"]
        assert together["id"].tolist() == sorted(set().union(*rows_of.values()))
        for row in together:
            listing = {name: rows[row["id"]] for name, rows in rows_of.items() if row["id"] in rows}
            seeing = [name for name, box in listing.items() if box["valid"] or box["visibility"] > 0]
            assert row["lidar_points"] == sum(box["lidar_points"] for box in listing.values())
            assert (row["seen"], row["seen_by"]) == (bool(seeing), sum(1 << [*agents].index(name) for name in seeing))
            assert all(row[shared] == box[shared] for box in listing.values())
            distances_m = [listing[name]["distance"] if name in listing else np.inf for name in agents]
            assert [row[f"{name}.distance"] for name in agents] == distances_m
    assert {*scene.of_agent("van")[0]["world/boxes"]["seen_by"].tolist()} >= {0, 1, 2}


def test_each_receives_what_the_other_sent_two_ticks_before(scene: Scene) -> None:
    van = scene.of_agent("van")
    for agent, other in ((scene, van), (van, scene)):
        assert [f"v2x/{other.agent}" in frame for frame in other] == [True, False] * (len(scene) // 2)
        for tick in range(len(scene)):
            arrived = agent[tick]["v2x"]
            if tick < 2 or tick % 2:
                assert len(arrived) == 0
                continue
            sent, boxes = other[tick - 2], other[tick - 2]["boxes"]
            assert arrived.tobytes() == sent[f"v2x/{other.agent}"].tobytes()
            seen = boxes[boxes["valid"].astype(bool) | (boxes["visibility"] > 0)]
            assert arrived["id"].tolist() == [0, *seen["id"]]
            error_m = np.array([arrived[name][0] for name in "xy"]) - sent.map_from_ego[:2, 3]
            assert 0 < np.linalg.norm(error_m) < 2.5
            for name, offset_m in zip("xy", error_m, strict=True):
                np.testing.assert_allclose(arrived[name][1:] - seen[name], offset_m, atol=2e-3)
        newest = [{name: frame.tick for name, frame in agent[tick].received.items()} for tick in (1, 2, 3, 12)]
        assert newest == [{}, {other.agent: 0}, {other.agent: 0}, {other.agent: 10}]


def test_the_number_of_cores_changes_nothing(scene: Scene, simbev: Simbev, tmp_path: Path) -> None:
    many = record_two_cars(simbev, tmp_path / "many", cores=16)
    with SceneBag(scene.path) as few_bag, SceneBag(many) as many_bag:
        assert topic_digests(few_bag) == topic_digests(many_bag)
