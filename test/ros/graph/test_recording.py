"""The recorder writes the configured topics and ends in order when the disk is full."""

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
from commands import SCENE, Config, Simbev, digests, record
from rosgraph_msgs.msg import Clock
from subscriber import Caller, clock_ns, keep, outside_node

from simbev_ros.recording.layout import mcap_files
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag
from simbev_ros.ros.msgs.topics import REPLAY_TOPICS

pytestmark = [pytest.mark.graph, pytest.mark.slow]


FEW = """
recording:
  topics: {include: [/tf, "*/rgb/*"], exclude: ["*/camera_info"]}
  zstd_level: null
  chunk_kib: 64
  split_mib: 1
"""
GREEDY = """
recording: {chunk_kib: 256, sync_mib: 1, min_free_mib: 1, zstd_level: null}
"""


def test_a_bag_of_few_topics_is_enough_to_reproduce_all_others(
    recorded: Path, simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    bag = record(simbev, small_config(more=FEW), tmp_path / "few")
    few, everything = digests(bag), digests(recorded)
    assert few.keys() == {"/tf", "/ego/cam_front/rgb/image_raw/compressed", *REPLAY_TOPICS}
    assert {name for name in few if few[name] != everything[name]} == set()
    assert len(mcap_files(bag)) > 1 and verify_bag(bag) == []
    code, output = simbev("replay", bag, small_config(name="all.yaml"), "--out", tmp_path / "all").finish()
    assert code == 0, output
    assert digests(tmp_path / "all" / SCENE) == everything


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Mount point of a disk of 3 MiB."""
    mount_point = tmp_path / "disk"
    mount_point.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", mount_point], capture_output=True).returncode:
        pytest.skip("no disk can be mounted here")
    yield mount_point
    subprocess.run(["umount", mount_point], check=True)


def test_a_full_disk_ends_the_recording_with_one_message(
    simbev: Simbev, small_config: Config, small_disk: Path
) -> None:
    config = small_config(120, GREEDY, without=["camera", "lidar", "radar"])
    code, output = simbev("run", config, "--record", small_disk / "a").finish()
    assert code == 1 and "Traceback" not in output, output
    assert output.count("error: ") == 1 and "error: node recorder: " in output and "the disk is nearly full" in output
    assert f"; what was recorded stays readable in {small_disk / 'a'}" in " ".join(output.split())
    with SceneBag(small_disk / "a" / f"{SCENE}.partial") as bag:
        assert bag.custom_data["complete"] == "false" and len(list(bag.messages(["/world/actors"]))) > 3


def test_a_limit_of_the_size_of_files_ends_the_recording_with_one_message(
    simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    config, dataset = small_config(120, GREEDY, without=["camera", "lidar", "radar"]), tmp_path / "a"
    command = simbev("run", config, "--record", dataset)
    command.wait_for(lambda: any(file.stat().st_size > 100_000 for file in (dataset / f"{SCENE}.partial").glob("*")))
    psutil.Process(command.nodes()["recorder"]).rlimit(psutil.RLIMIT_FSIZE, (3_000_000, 3_000_000))
    code, output = command.finish()
    assert code == 1 and "Traceback" not in output and output.count("error: ") == 1, output
    words = " ".join(output.split())
    assert "error: node recorder: " in words and "the file is larger than files may be here" in words
    assert f"; what was recorded stays readable in {dataset}" in words
    assert "ulimit -f allows 2.86 MiB for a file" in words
    with SceneBag(dataset / f"{SCENE}.partial") as bag:
        assert len(list(bag.messages(["/world/actors"]))) > 3


def test_the_same_command_records_a_scene_again_after_a_kill(
    simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    config, dataset = small_config(2, "recording: {chunk_kib: 64}", without=["camera"]), tmp_path / "out"
    command = simbev("run", config, "--record", dataset)
    command.wait_for(lambda: any(file.stat().st_size > 100_000 for file in (dataset / f"{SCENE}.partial").glob("*")))
    os.killpg(command.process.pid, signal.SIGKILL)
    command.process.wait()
    code, output = simbev("run", config, "--record", dataset).finish()
    assert code == 0 and "an interrupted run left a part of it; it is recorded again" in output, output
    assert [path.name for path in (dataset / "scenes/train").iterdir()] == ["Blocks-0000"]
    assert verify_bag(dataset / SCENE) == []


def test_time_is_repeated_while_a_recorded_world_is_paused_and_the_bag_holds_it_once(
    simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    config = small_config(2, without=["camera", "radar"])
    command = simbev("run", config, "--record", tmp_path / "out")
    with outside_node("tools") as (node, spin_until):
        caller = Caller(node, spin_until)
        assert caller.pause(paused=True).success
        clocks: list[Clock] = []
        node.create_subscription(Clock, "/clock", keep(clocks), 1000)
        spin_until(lambda: len(clocks) > 4)
        assert len({clock_ns(each) for each in clocks}) == 1
        for _ in range(12):
            assert caller.trigger("/world/step").success
        stepped_ns = clock_ns(clocks[0]) + 12 * 50_000_000
        spin_until(lambda: clock_ns(clocks[-1]) == stepped_ns)
        before = len(clocks)
        spin_until(lambda: len(clocks) > before + 4)
        assert caller.pause(paused=False).success
    code, output = command.finish()
    assert code == 0, output
    with SceneBag(tmp_path / "out" / SCENE) as bag:
        facts = bag.custom_data
    assert json.loads(facts["problems"]) == []
    assert json.loads(facts["recorded"])["/clock"] == 40
