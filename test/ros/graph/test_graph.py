"""The whole graph with real processes records complete bags with repeatable bytes and ends in order."""

import json
import os
import signal
from pathlib import Path

import pytest
from commands import SCENE, Config, Simbev, digests, is_alone, node_processes, record
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from waiting import wait_until

from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.graph.shared_memory import middleware_files, remove_orphans

pytestmark = pytest.mark.graph


SMALL_CHUNKS = "recording: {chunk_kib: 64}\n"
"""With it, a bag grows as soon as ticks are played."""


def size_of(bag: Path) -> int:
    """Size of the files of an unfinished bag, in bytes."""
    return sum(file.stat().st_size for file in bag.glob("*.mcap"))


def test_every_topic_has_exactly_its_messages(recorded: Path) -> None:
    with AnyReader([recorded]) as reader:
        counts = {name: topic.msgcount for name, topic in reader.topics.items() if not name.endswith("/typed")}
    world = ("scene", "map", "legend", "lights", "building_lights")
    once = {"/tf_static", "/robot_description", *(f"/world/{name}" for name in world)}
    camera = {name for name in counts if name.startswith("/ego/cam_front/")}
    assert len(camera) == 12
    assert (counts.pop("/ego/occupancy/points"), counts.pop("/ego/vector_map")) == (5, 3)
    fast = {"/ego/imu_fast/data", "/ego/imu_fast/data_raw"}
    assert {counts.pop(name) for name in fast} == {1 + 9 * 5}  # from tick 0 on
    for name in counts.keys() - {"/world/events"}:  # there may be any number of events
        assert counts[name] == (1 if name in once else 5 if name in camera else 10), name
    sensed = {"/ego/lidar/points", "/ego/radar_front/points", "/ego/bev/labels", "/ego/boxes"}
    assert {"/tf", "/clock", "/ego/odom", *sensed} <= counts.keys()


def test_chunks_and_attachments_pass_their_checksums(recorded: Path) -> None:
    with (recorded / "Blocks-0000_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert sum(1 for _ in reader.iter_messages()) > 300
        assert {attachment.name for attachment in reader.iter_attachments()} == {
            "scene.json",
            "config.yaml",
            "map.xodr",
            "lead_in.json",
            "trajectories.npz",
        }


def test_metadata_holds_the_type_hashes_that_rclpy_offers(recorded: Path, ros_type_hashes: dict[str, str]) -> None:
    with AnyReader([recorded]) as reader:
        hashes = {connection.msgtype: connection.digest for connection in reader.connections}
    shared = ros_type_hashes.keys() & hashes.keys()
    assert len(shared) > 5
    assert {name: hashes[name] for name in shared} == {name: ros_type_hashes[name] for name in shared}


def test_accounting_of_a_complete_bag_is_complete(recorded: Path) -> None:
    with SceneBag(recorded) as bag:
        assert bag.custom_data["complete"] == "true"
        assert json.loads(bag.custom_data["expected"]) == json.loads(bag.custom_data["recorded"])


@pytest.mark.slow
def test_another_seed_changes_all_topics_that_are_not_static(
    recorded: Path, simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    seed_12 = small_config(more="graph: {window_ticks: 1}")
    seed_12.write_text(seed_12.read_text().replace("seed: 11", "seed: 12"))
    other = digests(record(simbev, seed_12, tmp_path / "other"))
    same = {name for name, digest in digests(recorded).items() if digest == other[name]}
    static = {
        "/clock",
        "/world/map",
        "/world/legend",
        "/tf_static",
        *(name for name in other if name.endswith("camera_info")),
    }
    assert same - {"/world/events"} == static, "events may be missing in both"


@pytest.mark.parametrize(
    "node",
    [
        "recorder",
        *(
            pytest.param(node, marks=pytest.mark.slow)
            for node in ("world", "camera", "lidar+radar", "gnss+imu", "annotator")
        ),
    ],
)
def test_killed_node_is_named_and_the_partial_bag_stays_readable(
    simbev: Simbev, small_config: Config, tmp_path: Path, node: str
) -> None:
    others = [kind for kind in ("camera", "lidar", "radar") if kind not in node]
    command = simbev("run", small_config(600, SMALL_CHUNKS, without=others), "--record", tmp_path / "out")
    bag = tmp_path / "out" / f"{SCENE}.partial"
    command.wait_for(lambda: size_of(bag) > 1_200_000)
    os.kill(command.nodes()[node], signal.SIGKILL)
    code, output = command.finish()
    assert code == 1, output
    assert f"node {node} died after tick" in output
    assert "SIGKILL" in output
    assert "Traceback" not in output
    with SceneBag(bag) as partial:
        assert sum(1 for _ in partial.messages(["/clock"])) > 5
    assert not (tmp_path / "out" / SCENE).exists()


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupt_closes_the_bag_and_exits_130(
    simbev: Simbev, small_config: Config, tmp_path: Path, number: signal.Signals
) -> None:
    config = small_config(600, SMALL_CHUNKS, without=["camera", "lidar", "radar"])
    command = simbev("run", config, "--record", tmp_path / "out")
    bag = tmp_path / "out" / f"{SCENE}.partial"
    command.wait_for(lambda: size_of(bag) > 1_200_000)
    os.kill(command.process.pid, number)
    code, output = command.finish()
    assert code == 130, output
    assert "Traceback" not in output
    assert (bag / "metadata.yaml").is_file()
    with AnyReader([bag]) as reader:
        assert reader.message_count > 100


@pytest.mark.slow
def test_stopped_node_is_named_when_it_has_been_silent_for_too_long(
    simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    config = small_config(600, f"{SMALL_CHUNKS}graph: {{silence_timeout_s: 40}}\n", without=["camera"])
    command = simbev("run", config, "--record", tmp_path / "out")
    bag = tmp_path / "out" / f"{SCENE}.partial"
    command.wait_for(lambda: size_of(bag) > 1_000_000)  # ticks are played
    os.kill(command.nodes()["annotator"], signal.SIGSTOP)
    code, output = command.finish()
    assert code == 1, output
    assert "node annotator has been silent for 40 s, after tick" in output


def test_nodes_end_when_the_command_is_killed(simbev: Simbev, small_config: Config) -> None:
    before = set(middleware_files())  # a run killed together with its nodes may have left some
    command = simbev("run", small_config(600))
    command.wait_for(lambda: len(command.nodes()) == 5)
    command.process.kill()
    command.process.wait()
    wait_until(lambda: not node_processes())
    # The killed process could not remove its own two segments and their lock files; its nodes could.
    assert len(remove_orphans(set(middleware_files()) - before)) <= 4 or not is_alone()


@pytest.mark.slow
@pytest.mark.parametrize(("cores", "views"), [(8, set()), (16, {"annotator_views"})])
def test_more_cores_lead_to_more_processes_and_the_same_bytes(
    recorded: Path, simbev: Simbev, small_config: Config, tmp_path: Path, cores: int, views: set[str]
) -> None:
    command = simbev("run", small_config(), "--record", tmp_path / "many", cores=cores)
    nodes = {"world", "camera", "lidar", "radar", "gnss+imu", "annotator_boxes", "annotator_surroundings", "recorder"}
    nodes |= views
    command.wait_for(lambda: len(command.nodes()) == len(nodes))
    assert command.nodes().keys() == nodes
    code, output = command.finish()
    assert code == 0, output
    assert digests(tmp_path / "many" / SCENE) == digests(recorded)


@pytest.mark.slow
def test_bench_reports_the_time_of_every_process(simbev: Simbev, small_config: Config) -> None:
    code, output = simbev("bench", small_config(), "--ticks", 20, "--json").finish()
    assert code == 0, output
    result = json.loads(output[output.index("{") :])
    assert result["ticks_per_s"] > 0
    processes = {process["name"]: process for process in result["processes"]}
    assert processes.keys() == {"world", "camera", "lidar+radar", "gnss+imu", "annotator", "recorder"}
    assert all(process["memory_mib"] > 50 for process in processes.values())
    assert processes["camera"]["cpu_ms"] > 0  # the clock is too coarse for nodes with little load
    parts = {name: {part["name"] for part in process["parts"]} for name, process in processes.items()}
    assert parts["world"] == {"simulate", "message", "send", "all else"}
    assert parts["camera"] == {"draw", "read back", "encode", "message", "send", "all else"}
    assert parts["lidar+radar"] == {"place", "cast", "message", "send", "all else"}
    assert parts["annotator"] == {"receive", "label", "message", "send", "all else"}
    assert parts["recorder"] == {"receive", "write", "all else"}
    slowest = max(result["processes"], key=lambda process: process["busy_ms"])
    assert result["slowest"] == slowest["name"]
    assert result["ticks_per_s_of_slowest"] == pytest.approx(1000 / slowest["busy_ms"])
