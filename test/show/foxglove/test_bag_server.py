"""A client of the Foxglove WebSocket protocol receives a bag's messages as they are in the file."""

import json
import re
import shutil
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from made_up_scene import made_up_scene
from rosbags.typesys import Stores, get_typestore
from waiting import PATIENCE_S

from simbev_ros.cli.main import main
from simbev_ros.drawing.displays.box_markers import box_markers
from simbev_ros.foundation.installation.extras import install_command
from simbev_ros.recording.arrays import point_array
from simbev_ros.recording.reader import SceneBag
from simbev_ros.show.foxglove.derived import derivations
from simbev_ros.show.foxglove.playback_clock import PlaybackClock

pytest.importorskip("websocket")
pytest.importorskip("foxglove")
from foxglove_client import FoxgloveClient

JAVASCRIPT = Path(__file__).parent / "javascript"
TYPES = get_typestore(Stores.ROS2_JAZZY)


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "simbev_ros.cli.main", "view", "foxglove", *map(str, arguments)]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("served") / "Blocks-0000"
    made_up_scene(path, typed=True)
    return path


@contextmanager
def served(bag: Path, *options: object) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A running command and its address."""
    process = subprocess.Popen(
        command(bag, "--port", 0, *options), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    try:
        yield process, process.stdout.readline().split()[-1]
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def server(bag: Path) -> Iterator[str]:
    """Address of a running command, for tests that leave it playing."""
    with served(bag) as (_, url):
        yield url


@pytest.fixture
def failure(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Runs the command with bad input, in this process; gives the only line that it prints."""

    def run(*arguments: object) -> str:
        monkeypatch.setattr(sys, "argv", ["simbev", "view", "foxglove", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 2
        (line,) = capsys.readouterr().err.splitlines()
        return line

    return run


def test_every_message_arrives_with_its_bytes_and_stamp(bag: Path, server: str) -> None:
    with SceneBag(bag) as opened:
        expected = {(m.topic, m.stamp_ns, bytes(m.data)) for m in opened.messages()}

    def found() -> set[tuple[str, int, bytes]]:
        return {(topic, *each) for topic, messages in client.messages.items() for each in messages if topic in recorded}

    recorded = {topic for topic, _, _ in expected}
    with FoxgloveClient(server) as client:
        client.receive_until(lambda: found() == expected)
        assert set(client.info["capabilities"]) == {"time", "playbackControl"}
        kinds = {(channel["encoding"], channel["schemaEncoding"]) for channel in client.channels.values()}
    assert kinds == {("cdr", "ros2msg")}


def test_displays_are_made_of_what_is_recorded(bag: Path, server: str) -> None:
    with SceneBag(bag) as opened:
        boxes = {box_markers(point_array(opened.decode(m)), m.stamp_ns) for m in opened.messages(["/ego/boxes"])}
        latest = max(opened.topics["/ego/odom"].stamps_ns)
    with FoxgloveClient(server) as client:
        client.receive_until(lambda: {data for _, data in client.messages.get("/ego/boxes/markers", [])} == boxes)
        client.receive_until(lambda: latest in [stamp_ns for stamp_ns, _ in client.messages["/ego/path"]])
        ends = ("/color", "/color/compressed")
        pictures = {name for name in client.channels if name.endswith(ends) and "/cam_" in name}
    assert len(pictures) == 2 * 2 * 4 and pictures <= client.messages.keys()
    path = dict(client.messages["/ego/path"])[latest]
    places = TYPES.deserialize_cdr(path, "nav_msgs/msg/Path").poses
    assert [each.pose.position.x for each in places] == [0.0, 5.0, 10.0]
    assert "/world/markers" not in client.channels, "the bag has no table of street lights"


def test_a_seek_sends_what_was_there_at_that_time(bag: Path) -> None:
    with SceneBag(bag) as opened:
        stamp_ns = int(opened.topics["/ego/odom"].stamps_ns[1])
    with served(bag) as (_, url), FoxgloveClient(url) as client:
        client.receive_until(lambda: "/world/legend" in client.messages)
        client.send(struct.pack("<BBfBQI", 3, 1, 1.0, 1, stamp_ns, 1) + b"a")  # pause, and seek
        client.receive_until(lambda: len(client.messages["/world/legend"]) > 1)  # latched topics are sent again
        client.receive_until(
            lambda: all(
                client.messages[topic][-1][0] == stamp_ns for topic in ("/ego/odom", "/ego/path", "/ego/bev/car/grid")
            )
        )


def test_a_bag_that_was_cut_off_is_served_as_far_as_it_goes(bag: Path, tmp_path: Path) -> None:
    cut = Path(shutil.copytree(bag, tmp_path / "Blocks-0000"))
    (cut / "metadata.yaml").unlink()
    (file,) = cut.glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-400])  # the end of the file, with its index
    with served(cut) as (process, url), FoxgloveClient(url) as client:
        assert process.stdout is not None
        assert process.stdout.readline() == "warning: the bag was cut off; what it holds is served\n"
        client.receive_until(lambda: {"/ego/odom", "/ego/path", "/ego/lidar/points"} <= client.messages.keys())


def test_damage_in_the_middle_is_reported_and_what_comes_before_is_served(tmp_path: Path) -> None:
    damaged = tmp_path / "Blocks-0000"
    made_up_scene(damaged, ticks=5, chunk_bytes=20_000)
    (file,) = damaged.glob("*.mcap")
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 0xFF
    file.write_bytes(data)
    with served(damaged) as (process, url), FoxgloveClient(url) as client:
        assert process.stdout is not None
        client.receive_until(lambda: "/ego/odom" in client.messages)
        assert re.match(r"warning: .* damaged .*; what comes before is served", process.stdout.readline())
        assert process.poll() is None


@pytest.mark.parametrize(
    ("bind", "shown", "ending"), [("127.0.0.2", "127.0.0.2", signal.SIGINT), ("::1", "[::1]", signal.SIGTERM)]
)
def test_it_listens_only_to_its_address_until_a_signal_ends_it(
    bag: Path, bind: str, shown: str, ending: signal.Signals
) -> None:
    with served(bag, "--bind", bind) as (process, url):
        host, _, port = urlsplit(url).netloc.rpartition(":")
        assert host == shown
        with FoxgloveClient(url) as client:
            client.receive_until(lambda: "/ego/odom" in client.messages)
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", int(port)), timeout=PATIENCE_S)
        process.send_signal(ending)
        assert process.wait(PATIENCE_S) == 130
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((bind, int(port)), timeout=PATIENCE_S)


def test_an_address_of_another_machine_is_named(bag: Path, failure: Callable[..., str]) -> None:
    line = failure(bag, "--port", 0, "--bind", "192.0.2.1")
    assert "192.0.2.1 cannot be used" in line and "another address" in line


def test_a_port_in_use_is_named(bag: Path, failure: Callable[..., str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        line = failure(bag, "--port", port)
    assert f"--port: {port} of 127.0.0.1 cannot be used" in line


def test_what_is_no_bag_is_named(tmp_path: Path, failure: Callable[..., str]) -> None:
    (tmp_path / "a.mcap").write_bytes(b"nothing")
    assert "a.mcap: not an MCAP file" in failure(tmp_path / "a.mcap")


def test_without_the_library_one_line_says_how_to_install_it(
    bag: Path, failure: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "foxglove", None)
    assert failure(bag) == f"error: the server needs Foxglove's SDK; install it: {install_command('foxglove')}"


@pytest.mark.slow
def test_the_clock_keeps_to_the_bag_and_stands_while_paused() -> None:
    clock = PlaybackClock(100, 5_000_000_100, 100, speed=2.0)
    assert clock.advance(0.5) == 1_000_000_100
    clock.playing = False
    assert clock.advance(9.0) == 1_000_000_100
    clock.playing = True
    assert (clock.advance(9.0), clock.at_end) == (5_000_000_100, True)
    clock.seek(0)
    assert clock.position_ns == 100


@pytest.mark.slow
def test_foxgloves_own_client_decodes_every_topic(bag: Path, server: str, tmp_path: Path) -> None:
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("Node.js and npm are not installed")
    folder = Path(shutil.copytree(JAVASCRIPT, tmp_path / "javascript"))
    installed = subprocess.run(
        ["npm", "install", "--no-audit", "--no-fund"], cwd=folder, capture_output=True, timeout=300
    )
    if installed.returncode:
        pytest.skip(f"npm cannot install the packages: {installed.stderr.decode()[-300:]}")
    with SceneBag(bag) as opened:
        expected = {name: topic.type_name for name, topic in opened.topics.items()}
        expected |= {name: derived.type_name for name, derived in derivations(opened).items()}
    output = subprocess.run(
        ["node", str(folder / "client.mjs"), server, str(len(expected))],
        capture_output=True,
        timeout=PATIENCE_S,
        check=True,
    )
    assert json.loads(output.stdout) == expected
