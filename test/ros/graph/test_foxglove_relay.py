"""Foxglove's clients see a running graph as it is, and the graph does not notice them."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from commands import SCENE, Command, Config, Simbev, digests, record
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Header, String
from subscriber import keep, outside_node

from simbev_ros.recording.canonical import canonical_cdr
from simbev_ros.recording.reader import SceneBag
from simbev_ros.ros.msgs.stamps import header, serialized_stamp_ns
from simbev_ros.schema.scene.spec import SceneSpec

pytest.importorskip("websocket")
pytest.importorskip("foxglove")
from foxglove_client import FoxgloveClient

from simbev_ros.show.foxglove.derived import derivations

pytestmark = pytest.mark.graph

DURATION_S = 8
GATE = "graph: {participants: [gate], window_ticks: 2, silence_timeout_s: 600}\n"
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RECORDED = {
    *("/ego/lidar/points", "/ego/cam_front/rgb/image_raw/compressed", "/tf", "/tf_static"),
    *("/world/scene", "/robot_description", "/world/map"),  # are latched
}
DISPLAYS = {
    *("/world/markers", "/ego/vector_map/markers", "/ego/cam_front/boxes/markers"),
    *("/ego/cam_front/depth/color/compressed", "/ego/bev/car/grid", "/world/weather/status"),
}


@contextmanager
def relay(simbev: Simbev) -> Iterator[tuple[Command, FoxgloveClient]]:
    """A relay of the tests' domain, and a client."""
    command = simbev("view", "foxglove", "--port", 0)
    assert command.process.stdout is not None
    url = command.process.stdout.readline().split()[-1]
    try:
        with FoxgloveClient(url) as client:
            yield command, client
    except AssertionError:
        command.process.terminate()
        print(command.finish(10))
        raise
    finally:
        command.process.send_signal(signal.SIGCONT)


@pytest.mark.slow
def test_clients_get_the_bytes_that_are_recorded_and_displays_those_that_follow_from_the_bag(
    recorded: Path, simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    with relay(simbev) as (_, client), outside_node("gate") as (node, spin_until):
        scenes: list[String] = []
        node.create_subscription(String, "/world/scene", keep(scenes), LATCHED)
        ready = node.create_publisher(Header, "/sync/ready", LATCHED)
        run = simbev("run", small_config(0.5, GATE), "--record", tmp_path / "dataset")
        spin_until(lambda: bool(scenes))
        spec = SceneSpec.model_validate_json(scenes[0].data)

        def let_play(tick: int) -> None:
            ready.publish(header(spec.stamp_ns(tick), f"gate:{spec.name}"))

        let_play(-4)  # up to tick -2
        client.receive_until(lambda: client.channels.keys() >= RECORDED | DISPLAYS)
        client.receive_until(lambda: all(is_read_by_relay(node, name) for name in RECORDED))
        for tick in range(-3, spec.ticks):
            let_play(tick)
            client.receive(0.05)
        client.receive_until(lambda: run.process.poll() is not None)
        assert run.finish()[0] == 0
    watched, alone = digests(tmp_path / "dataset" / SCENE), digests(recorded)
    assert {name: alone[name] for name in watched} == watched, "the same seed gives the same bytes in any graph"
    with SceneBag(tmp_path / "dataset" / SCENE) as bag:
        messages = {(each.topic, bytes(each.data)) for each in bag.messages()}
        received = {
            (topic, bytes(canonical_cdr(data, bag.topics[topic].type_name)))
            for topic, messages in client.messages.items()
            if topic in bag.topics
            for _, data in messages
            if not is_lead_in(data, bag.topics[topic].type_name, bag.span_ns[0])
        }
        assert received <= messages
        topics = {topic for topic, _ in received}
        assert topics >= RECORDED and len(topics) > 30
        derived = derivations(bag)
        shown = derived.keys() & client.messages.keys() - {"/ego/path"}  # the node's begins in the lead-in
        assert shown >= DISPLAYS
        for name in shown - {name for name in shown if "/color" in name}:  # recorded depth and flow are quantized
            kind, start_ns = derived[name].type_name, bag.span_ns[0]
            sent = [data for _, data in client.messages[name] if not is_lead_in(data, kind, start_ns)]
            found = {bytes(canonical_cdr(data, kind)) for data in sent}  # the middleware pads messages at their end
            assert found <= set(made(bag, name)), name


def is_read_by_relay(node: Node, topic: str) -> bool:
    """Whether a node knows that the relay has subscribed to a topic."""
    return any("simbev_view" in each.node_name for each in node.get_subscriptions_info_by_topic(topic))


def is_lead_in(data: bytes, type_name: str, start_ns: int) -> bool:
    """Whether a message is from the ticks before the recorded ones."""
    with suppress(ValueError):  # a String without JSON has no stamp
        stamp_ns = serialized_stamp_ns(data, type_name)
        return stamp_ns is not None and stamp_ns < start_ns
    return False


def made(bag: SceneBag, name: str) -> Iterator[bytes]:
    """The messages of a topic that follow from a bag."""
    derived, latest = derivations(bag)[name], {}
    for message in bag.messages(derived.sources):
        latest[message.topic] = message
        if message.topic == derived.sources[0] and len(latest) == len(derived.sources):
            yield derived.make([latest[source] for source in derived.sources])


@pytest.mark.slow
def test_a_relay_that_is_stopped_in_the_middle_changes_nothing(
    simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    config = small_config(DURATION_S)
    alone = record(simbev, config, tmp_path / "alone")
    with relay(simbev) as (command, client):
        run = simbev("run", config, "--record", tmp_path / "watched")
        client.receive_until(lambda: "/ego/lidar/points" in client.messages)
        assert run.process.poll() is None
        os.kill(command.process.pid, signal.SIGSTOP)
        code, output = run.finish()
        assert code == 0, output
    assert digests(tmp_path / "watched" / SCENE) == digests(alone)


@pytest.mark.slow
def test_topics_vanish_with_a_graph_and_come_back_with_the_next(simbev: Simbev, small_config: Config) -> None:
    config = small_config(600, without=["camera", "lidar", "radar", "imu"])
    with relay(simbev) as (command, client):
        for _ in range(2):
            run = simbev("run", config)
            client.messages.clear()
            client.receive_until(lambda: {"/ego/odom", "/world/scene"} <= client.messages.keys())
            run.process.send_signal(signal.SIGINT)
            run.finish()
            client.receive_until(lambda: "/ego/odom" not in client.channels)
        command.process.send_signal(signal.SIGTERM)
        assert command.finish()[0] == 130


def test_a_domain_that_is_none_is_named(simbev: Simbev) -> None:
    code, output = simbev("view", "foxglove", "--domain", 233).finish()
    assert code == 2 and "--domain" in output
