"""Replays of scenes with several agents: the same bytes again, another rig for one of them, and new agents."""

from pathlib import Path

import numpy as np
import pytest
from commands import SCENE, Simbev

from simbev_ros.dataset import open_dataset
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag

pytestmark = [pytest.mark.graph, pytest.mark.slow]

HEAD = """
seed: 11
scenes: [{map: Blocks, train: 1}]
time: {warm_up_s: 1, duration_s: 0.5}
weather: {cloudiness: 20, precipitation: 0, sun_altitude_deg: 45, fog_density: 0}
traffic: {vehicles: 15, pedestrians: 5, spawn_radius_m: 150}
annotation: {bev: {rows: 100, columns: 100}}
agents:
"""
LIDAR = "{sensors: [{type: lidar, name: lidar, pose: {z_m: 2.8}, channels: 16, columns: CHOSEN}]}"
EGO = f"  - {{name: ego, rig: {LIDAR}}}\n".replace("CHOSEN", "256")
VAN = f"  - {{name: van, rig: {LIDAR}, blueprint: vehicle.van, near: {{distance_m: 25}}}}\n"
UNIT = f"  - {{name: rsu, rig: {LIDAR}, mast: {{junction: {{}}, height_m: 4}}}}\n".replace("CHOSEN", "256")
V2X = "v2x: {latency_s: 0.05}\n"


def digests(bag: Path) -> dict[str, str]:
    assert verify_bag(bag) == []
    with SceneBag(bag) as opened:
        return dict(topic_digests(opened))


def write(folder: Path, name: str, *agents: str, columns: int = 256) -> Path:
    (folder / name).write_text(HEAD + "".join(agents).replace("CHOSEN", str(columns)), encoding="utf-8")
    return folder / name


def run(simbev: Simbev, *words: object) -> None:
    code, output = simbev(*words).finish(300)
    assert code == 0, output


def test_a_replay_repeats_every_byte_and_changes_the_rig_of_one_agent(simbev: Simbev, tmp_path: Path) -> None:
    config = write(tmp_path, "all.yaml", EGO, VAN, UNIT, V2X)
    run(simbev, "run", config, "--record", tmp_path / "first")
    bag = tmp_path / "first" / SCENE
    run(simbev, "replay", bag, config, "--out", tmp_path / "again")
    before = digests(bag)
    assert digests(tmp_path / "again" / SCENE) == before
    run(simbev, "replay", bag, write(tmp_path, "fine.yaml", EGO, VAN, UNIT, V2X, columns=512), "--merge", "fine")
    merged = open_dataset(tmp_path / "first", threads=1).scenes[0].of_agent("van")[5]
    assert len(merged["lidar/points@fine"]) > 1.5 * len(merged["lidar/points"])
    after = digests(bag.with_name(f"{bag.name}.fine"))
    assert after.keys() == before.keys()
    assert all(
        after[name] == before[name] for name in before if name.startswith(("/ego/lidar", "/rsu/lidar", "/world/a"))
    )


def test_a_scene_with_one_agent_is_replayed_with_more(simbev: Simbev, tmp_path: Path) -> None:
    run(simbev, "run", write(tmp_path, "one.yaml", EGO), "--record", tmp_path / "one")
    scene = open_dataset(tmp_path / "one", threads=1).scenes[0]
    boxes = scene[0]["boxes"]
    cars = boxes[(boxes["id"] > 1) & (boxes["id"] <= len(scene.spec.vehicles)) & (boxes["length"] > 3)]
    carrier = int(cars["id"][np.argmin(cars["distance"])])
    rider = f"  - {{name: rider, rig: {LIDAR}, carrier: {carrier}}}\n"
    config = write(tmp_path, "more.yaml", EGO, rider, UNIT, V2X)
    run(simbev, "replay", tmp_path / "one" / SCENE, config, "--out", tmp_path / "more")
    more, alone = digests(tmp_path / "more" / SCENE), digests(tmp_path / "one" / SCENE)
    of_ego = [name for name in alone if name.startswith(("/ego/", "/world/actors", "/world/signals"))]
    assert len(of_ego) > 5 and all(more[name] == alone[name] for name in of_ego)
    agents = open_dataset(tmp_path / "more", threads=1).scenes[0]
    assert agents.agents == ("ego", "rider", "rsu")
    frame = agents.of_agent("rider")[5]
    assert carrier not in frame["boxes"]["id"] and 1 in frame["boxes"]["id"]
    assert carrier in agents[5]["world/boxes"]["id"]
