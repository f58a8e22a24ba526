"""A graph whose domain is full of malformed and forged messages records the same bytes as an undisturbed one."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from threading import Event, Thread

import pytest
from commands import SCENE, Config, Simbev, digests
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header, String
from subscriber import outside_node

from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag
from simbev_ros.ros.msgs.stamps import header, time_message
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.scene.request import SceneRequest
from simbev_ros.schema.scene.spec import SceneSpec

pytestmark = pytest.mark.graph

LATCHED = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NODES = ("world", "camera", "lidar", "radar", "gnss", "imu", "annotator", "recorder")
TABLE = PointCloud2(
    fields=[PointField(name="x", datatype=PointField.FLOAT32, count=1)], width=3, height=1, point_step=4
)

TRUNCATED = b"\0\1\0\0\xff\xff\xff\xff"
"""A serialized text that says it is longer than it is."""


def forged(spec: SceneSpec) -> dict[str, list[String]]:
    """Well-formed messages that would end the scene at once, or begin another one."""
    other = spec.model_copy(update={"seed": spec.seed + 1})
    end = SceneEnd(scene=spec.name, tick=3, reason="forged")
    return {
        "/world/end": [String(data=end.model_dump_json())],
        "/world/request": [String(data=SceneRequest(spec=other, number=1000).model_dump_json())],
        "/world/scene": [String(data=other.model_dump_json())],
    }


@contextmanager
def _beside(send: Callable[[], None], ended: Event) -> Iterator[None]:
    """Run a sender in a thread until the context, and with it ``ended``, is over."""
    thread = Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def spec_of(recorded: Path) -> SceneSpec:
    with SceneBag(recorded) as bag:
        assert bag.spec is not None
        return bag.spec


def strangers(spec: SceneSpec) -> AbstractContextManager[None]:
    """Nodes of others that send, again and again, what could disturb a scene."""
    words = [String(data=text) for text in ("", "nonsense", "{}", "[]", '{"stamp_ns": "soon"}', "\x00")]
    texts = {topic: words + messages for topic, messages in forged(spec).items()} | {"/world/weather": words}
    beyond = [spec.stamp_ns(tick) for tick in (-(10**6), spec.ticks - 1, spec.ticks, spec.ticks + 9)]
    ended = Event()

    def send() -> None:
        with outside_node("stranger") as (node, _):
            senders = {topic: node.create_publisher(String, topic, LATCHED) for topic in texts}
            ready = node.create_publisher(Header, "/sync/ready", LATCHED)
            clock = node.create_publisher(Clock, "/clock", 10)
            diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
            tables = [node.create_publisher(PointCloud2, f"/world/{name}", 10) for name in ("actors", "signals")]
            while not ended.wait(1.0):
                for topic, messages in texts.items():
                    for message in (*messages, TRUNCATED):
                        senders[topic].publish(message)
                for name in NODES:
                    for stamp_ns in beyond:
                        ready.publish(header(max(stamp_ns, 0), f"{name}:{spec.name}"))
                ready.publish(header(0, "nobody"))
                clock.publish(Clock(clock=time_message(-5_000_000_000)))
                values = [KeyValue(key="ticks", value="many"), KeyValue(key="busy_ms", value="nan")]
                diagnostics.publish(DiagnosticArray(status=[DiagnosticStatus(hardware_id="lidar", values=values)]))
                for sender in tables:
                    sender.publish(PointCloud2(header=header(spec.stamp_ns(2), "map")))
                    sender.publish(TABLE)

    return _beside(send, ended)


@pytest.mark.slow
def test_a_scene_among_strangers_is_the_same(
    recorded: Path, simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    with strangers(spec_of(recorded)):
        code, output = simbev("run", small_config(), "--record", tmp_path / "out").finish()
    assert code == 0, output
    assert digests(tmp_path / "out" / SCENE) == digests(recorded)
    assert not verify_bag(tmp_path / "out" / SCENE)
    assert "ignored messages on /world/request: " in output


def forger(spec: SceneSpec) -> AbstractContextManager[None]:
    """A node that sends well-formed clouds for ticks that are still to come."""
    ended = Event()

    def send() -> None:
        with outside_node("forger") as (node, _):
            clouds = node.create_publisher(PointCloud2, "/ego/lidar/points", 10)
            while not ended.wait(0.2):
                for tick in range(spec.ticks):
                    clouds.publish(
                        PointCloud2(header=header(spec.stamp_ns(tick), "lidar"), height=1, fields=TABLE.fields)
                    )

    return _beside(send, ended)


@pytest.mark.slow
def test_a_scene_with_a_second_sender_is_not_complete(
    recorded: Path, simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    with forger(spec_of(recorded)):
        code, output = simbev("run", small_config(), "--record", tmp_path / "out").finish()
    assert code != 0 and "from a second sender" in output, output
    with SceneBag(next((tmp_path / "out").glob("scenes/*/*"))) as bag:
        assert bag.custom_data["complete"] == "false"
        assert "/forger" in bag.custom_data["senders"]
