"""Whole graphs with real processes: scenes that end early, and scenes that are replayed."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from commands import SCENE, SMALL, Command, Config, Simbev, digests, record, write_small

from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.plan import Plan
from simbev_ros.dataset.staging import staging_of
from simbev_ros.dataset.values import poses_from_odometry
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag

pytestmark = [pytest.mark.graph, pytest.mark.slow]

NOON = "weather: {cloudiness: 20, precipitation: 0, sun_altitude_deg: 45, fog_density: 0}\n"
NIGHT = "weather: {cloudiness: 20, precipitation: 0, sun_altitude_deg: -40, fog_density: 0}\n"
CHANGED_WITH_LIDAR = {
    "/world/scene",
    "/ego/lidar/points",
    "/ego/lidar/semantic_points",
    "/ego/boxes",
}
MOTION = {"/clock", "/world/actors", "/world/signals", "/world/map", "/ego/odom", "/tf"}


def facts(folder: Path) -> dict[str, str]:
    with SceneBag(folder) as bag:
        return bag.custom_data


def write_config(folder: Path, text: str, name: str) -> Path:
    (folder / name).write_text(text.replace("DURATION", "0.5"))
    return folder / name


@pytest.fixture(scope="module")
def first_of_two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first bag of two in a dataset."""
    folder = tmp_path_factory.mktemp("first_of_two")
    config = write_config(folder, SMALL.replace("train: 1", "train: 2"), "a.yaml")
    code, output = Command("run", config, "--record", folder / "dataset").finish()
    assert code == 0, output
    return folder / "dataset" / SCENE


def replay(simbev: Simbev, bag: Path, config: Path, dataset: Path) -> Path:
    code, output = simbev("replay", bag, config, "--out", dataset).finish()
    assert code == 0, output
    return dataset / SCENE


def ending_early(small_config: Config, *without: str) -> Path:
    """A configuration whose scenes end after 8 ticks, because nobody drives the ego."""
    config = small_config(30, "ego: {driver: twist}\n", without=without)
    config.write_text(config.read_text().replace("duration_s: 30", "duration_s: 30, end_after_standing_s: 0.4"))
    return config


def test_a_scene_that_ended_early_is_replayed_to_the_same_bytes_even_from_a_replay(
    simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    config = ending_early(small_config, "camera", "radar")
    bag = record(simbev, config, tmp_path / "out")
    again = replay(simbev, bag, config, tmp_path / "again")
    twice = replay(simbev, again, config, tmp_path / "twice")
    assert digests(again) == digests(twice) == digests(bag)
    assert facts(twice)["ended"] == facts(bag)["ended"] == "ego stood still for 0.4 s at tick 7"


def test_replaying_with_the_same_configuration_repeats_every_byte_and_merges_into_the_dataset(
    first_of_two: Path, simbev: Simbev, tmp_path: Path
) -> None:
    dataset = tmp_path / "dataset"
    shutil.copytree(first_of_two.parents[2], dataset)
    config = write_config(tmp_path, SMALL.replace("channels: 8", "channels: 4"), "other.yaml")
    for label, text in (("again", SMALL), ("rear", config.read_text())):
        code, output = simbev(
            "replay", dataset, write_config(tmp_path, text, f"{label}.yaml"), "--merge", label
        ).finish()
        assert code == 0, output
    for name in ("Blocks-0000", "Blocks-0001"):
        bag = dataset / "scenes/train" / name
        again, rear = (bag.with_name(f"{name}.{label}") for label in ("again", "rear"))
        assert facts(again)["ended"] == facts(bag)["ended"] == "duration"
        assert digests(again) == digests(bag) == digests(first_of_two.with_name(name))
        before, after = digests(bag), digests(rear)
        assert {topic for topic in before if before[topic] != after[topic]} == CHANGED_WITH_LIDAR
        assert not [fault for each in (bag, again, rear) for fault in verify_bag(each)]
    assert len(Plan.load(dataset).scenes) == 2 and not staging_of(dataset).exists()
    first, _ = open_dataset(dataset).scenes
    assert {"lidar/points", "lidar/points@rear", "lidar/points@again"} <= set(first.keys)
    code, output = simbev("replay", dataset, config, "--merge", "rear").finish()
    assert code == 0 and "2 scenes recorded before" in output
    code, output = simbev("replay", dataset / "scenes/train/Blocks-0000", config, "--merge", "rear").finish()
    assert code == 2 and "Blocks-0000.rear: exists already; nothing was overwritten" in output


def test_replay_at_night_with_other_sensors_repeats_all_motion(recorded: Path, simbev: Simbev, tmp_path: Path) -> None:
    config = write_small(tmp_path, without=["radar", "gnss", "imu"])
    config.write_text(config.read_text().replace(NOON, NIGHT).replace("channels: 8", "channels: 4"))
    night = replay(simbev, recorded, config, tmp_path / "night")
    before, after = digests(recorded), digests(night)
    assert {name for name in MOTION - {"/world/actors"} if before[name] != after[name]} == set()
    assert before["/ego/bev/labels"] == after["/ego/bev/labels"]
    for name in ("/world/weather", "/ego/lidar/points", "/ego/cam_front/rgb/image_raw/compressed"):
        assert before[name] != after[name]
    assert (
        before["/ego/cam_front/depth/image_raw/compressedDepth"]
        == (after["/ego/cam_front/depth/image_raw/compressedDepth"])
    )


def test_other_frames_and_noisy_localization_change_no_motion(recorded: Path, simbev: Simbev, tmp_path: Path) -> None:
    """Wheel odometry, GNSS velocity and orientation errors are recorded completely, and /tf composes to the truth."""
    sensors = [
        "{type: lidar, name: lidar, pose: {z_m: 1.8}, channels: 8, columns: 128}",
        "{type: gnss, name: gnss, velocity: {}}",
        "{type: imu, name: imu_fast, rate_hz: 100, orientation: {}}",
        "{type: odometry, name: wheel, rate_hz: 10}",
    ]
    head, _, tail = SMALL.partition("    - {type: camera")
    text = head + "".join(f"    - {each}\n" for each in sensors) + tail[tail.index("weather:") :]
    config = write_config(tmp_path, text + "frames: {odom: true, base_link: rear_axle}\n", "frames.yaml")
    moved = replay(simbev, recorded, config, tmp_path / "frames")
    assert not verify_bag(moved)
    before, after = open_dataset(recorded).scenes[0], open_dataset(moved).scenes[0]
    for frame, other in zip(before, after, strict=True):
        for key in ("lidar/points", "bev/labels", "world/actors"):
            np.testing.assert_array_equal(frame[key], other[key])
        np.testing.assert_allclose(other.map_from_sensor("lidar"), frame.map_from_sensor("lidar"), rtol=0, atol=1e-9)
        tree, (odometry,) = other["tf"], other.messages("odom")
        map_from_base = tree["map", "ego/odom"] @ tree["ego/odom", "ego/base_link"]
        position = odometry.pose.pose.position
        np.testing.assert_allclose(map_from_base[:3, 3], [position.x, position.y, position.z], rtol=0, atol=1e-9)
        if "wheel/odometry" in other:
            wheel = poses_from_odometry(other["wheel/odometry"][-1])
            np.testing.assert_allclose(wheel, tree["ego/odom", "ego/base_link"], rtol=0, atol=1e-9)
