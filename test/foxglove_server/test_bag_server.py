"""A client of the Foxglove WebSocket protocol receives a bag's messages as they are in the file."""

import json
import shutil
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from made_up_scene import made_up_scene

from simbev_ros.foxglove_server.playback_clock import PlaybackClock
from simbev_ros.recording.reader import SceneBag

websocket = pytest.importorskip("websocket")
pytest.importorskip("foxglove")
JAVASCRIPT = Path(__file__).parent / "javascript"
_MESSAGE = struct.Struct("<BIQ")


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "simbev_ros.cli.main", "view", "--foxglove", *map(str, arguments)]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("served") / "Blocks-0000"
    made_up_scene(path)
    return path


@pytest.fixture
def server(bag: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A running command and its address."""
    process = subprocess.Popen(command(bag, "--port", 0), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield process, process.stdout.readline().split()[-1]
    finally:
        process.kill()
        process.communicate()


def connect(url: str) -> tuple[Any, dict[str, Any], list[dict[str, Any]]]:
    """A connection, the server's description, and its channels."""
    client = websocket.create_connection(url, subprotocols=["foxglove.sdk.v1"], timeout=20)
    info, channels = json.loads(client.recv()), []
    while isinstance(data := client.recv(), str):  # binary data is the time, which comes afterwards
        channels += json.loads(data).get("channels", [])
    client.send(
        json.dumps({"op": "subscribe", "subscriptions": [{"id": c["id"], "channelId": c["id"]} for c in channels]})
    )
    return client, info, channels


def test_every_message_arrives_with_its_bytes_and_stamp(bag: Path, server: tuple[Any, str]) -> None:
    with SceneBag(bag) as opened:
        expected = {(m.topic, m.stamp_ns, bytes(m.data)) for m in opened.messages()}
    client, info, channels = connect(server[1])
    assert set(info["capabilities"]) == {"time", "playbackControl"}
    names = {channel["id"]: channel["topic"] for channel in channels}
    assert {(channel["encoding"], channel["schemaEncoding"]) for channel in channels} == {("cdr", "ros2msg")}
    found, end_s = set(), time.monotonic() + 20
    while found != expected and time.monotonic() < end_s:
        data = client.recv()
        if data[0] == 1:
            _, channel, stamp_ns = _MESSAGE.unpack_from(data)
            found.add((names[channel], stamp_ns, data[_MESSAGE.size :]))
    client.close()
    assert found == expected


def test_a_seek_sends_what_was_there_at_that_time(bag: Path, server: tuple[Any, str]) -> None:
    with SceneBag(bag) as opened:
        stamp_ns = int(opened.topics["/ego/odom"].stamps_ns[1])
    client, _, channels = connect(server[1])
    names = {channel["id"]: channel["topic"] for channel in channels}
    request = struct.pack("<BBfBQI", 3, 1, 1.0, 1, stamp_ns, 1) + b"a"  # pause, and seek
    client.send_binary(request)
    last_ns: dict[str, int] = {}
    end_s = time.monotonic() + 1.5
    while time.monotonic() < end_s:
        data = client.recv()
        if data[0] == 1:
            _, channel, sent_ns = _MESSAGE.unpack_from(data)
            last_ns[names[channel]] = sent_ns
    client.close()
    assert last_ns["/ego/odom"] == stamp_ns
    assert "/world/legend" in last_ns, "latched topics are sent again"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_and_frees_the_port(server: tuple[Any, str], number: int) -> None:
    process, url = server
    process.send_signal(number)
    assert process.wait(10) == 130
    with socket.create_server(("127.0.0.1", int(url.rpartition(":")[2]))):
        pass


def failure(*arguments: object) -> str:
    """The only line that a command with bad input prints."""
    result = subprocess.run(command(*arguments), capture_output=True, text=True, timeout=60)
    assert result.returncode == 2
    (line,) = result.stderr.splitlines()
    return line


def test_a_port_in_use_is_named(bag: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        line = failure(bag, "--port", port)
    assert f"port {port} of 127.0.0.1 cannot be used" in line and "--port" in line


def test_what_is_no_bag_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"nothing")
    assert "a.mcap: not an MCAP file" in failure(tmp_path / "a.mcap")


def test_without_the_library_one_line_says_how_to_install_it(bag: Path) -> None:
    program = f"""
import sys
sys.modules["foxglove"] = None
sys.argv = ["simbev", "view", "--foxglove", {str(bag)!r}]
from simbev_ros.cli.main import main
main()
"""
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert (result.returncode, result.stderr) == (
        2,
        "error: foxglove-sdk is not installed: pip install 'simbev_ros[foxglove]'\n",
    )


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
def test_foxgloves_own_client_decodes_every_topic(bag: Path, server: tuple[Any, str], tmp_path: Path) -> None:
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
    output = subprocess.run(
        ["node", str(folder / "client.mjs"), server[1], str(len(expected))],
        capture_output=True,
        timeout=60,
        check=True,
    )
    assert json.loads(output.stdout) == expected
