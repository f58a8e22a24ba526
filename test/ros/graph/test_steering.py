"""Services control a running world, and an outside node drives the ego."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Command
from geometry_msgs.msg import Twist
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.highlevel import AnyReader
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool, Trigger
from subscriber import keep, outside_node

from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag
from simbev_ros.schema.scene.spec import SceneSpec

pytestmark = pytest.mark.graph

Simbev = Callable[..., Command]
Config = Callable[..., Path]
RAYS_AND_CAMERAS = ("camera", "lidar", "radar")
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def stamp_ns(clock: Clock) -> int:
    return int(clock.clock.sec) * 10**9 + int(clock.clock.nanosec)


@pytest.mark.parametrize(
    ("options", "answer_to_reset"),
    [
        ([], "only a live scene can start again; in lockstep all nodes are in the middle of this one"),
        pytest.param(["--live"], "restarted", marks=pytest.mark.slow),
        pytest.param(
            ["--live", "--record", "out"], "a scene that is recorded cannot start again", marks=pytest.mark.slow
        ),
    ],
    ids=["lockstep", "live", "recorded"],
)
def test_services_control_the_world(
    simbev: Simbev, small_config: Config, tmp_path: Path, options: list[str], answer_to_reset: str
) -> None:
    run = simbev(
        "run",
        small_config(600, without=RAYS_AND_CAMERAS),
        *(tmp_path / word if word == "out" else word for word in options),
    )
    clocks: list[Clock] = []
    with outside_node("operator") as (node, spin_until):
        node.create_subscription(Clock, "/clock", keep(clocks), 50)
        clients = {
            name: node.create_client(kind, f"/world/{name}")
            for name, kind in (("pause", SetBool), ("step", Trigger), ("reset", Trigger))
        }

        def call(name: str, request: Any) -> Any:
            assert clients[name].wait_for_service(10)
            future = clients[name].call_async(request)
            spin_until(future.done)
            return future.result()

        def settle() -> int:
            with pytest.raises(AssertionError, match="timed out"):
                spin_until(lambda: False, 1.0)
            return stamp_ns(clocks[-1])

        def runs() -> bool:
            assert run.process.poll() is None, run.finish()[1]
            return True

        spin_until(lambda: runs() and len(clocks) > 20)
        answer = call("step", Trigger.Request())
        assert (answer.success, answer.message) == (False, "pause first: /world/pause")
        answer = call("pause", SetBool.Request(data=True))
        assert (answer.success, answer.message) == (True, "paused")
        paused_ns = settle()
        for count in (1, 2):
            assert call("step", Trigger.Request()).success
            assert settle() == paused_ns + count * 50_000_000
        answer = call("reset", Trigger.Request())
        restarted = answer_to_reset == "restarted"
        assert (answer.success, answer.message) == (restarted, answer_to_reset)
        assert call("pause", SetBool.Request(data=False)).message == "running"
        count = len(clocks)
        spin_until(lambda: len(clocks) > count + 10)
        assert (stamp_ns(clocks[-1]) < paused_ns) == restarted


def drive(simbev: Simbev, config: Path, dataset: Path) -> Path:
    """Record a scene whose ego is driven by a listed participant, which sends a command and a report at each tick."""
    command = simbev("run", config, "--record", dataset)
    scenes: list[String] = []
    with outside_node("driver") as (node, spin_until):
        node.create_subscription(String, "/world/scene", keep(scenes), LATCHED)
        ready = node.create_publisher(Header, "/sync/ready", LATCHED)
        wheel = node.create_publisher(Twist, "/ego/cmd_vel", 10)
        spin_until(lambda: bool(scenes) and wheel.get_subscription_count() > 0)
        spec = SceneSpec.model_validate_json(scenes[0].data)

        def finish(tick: int) -> None:
            message = Header(frame_id=f"driver:{spec.name}")
            message.stamp.sec, message.stamp.nanosec = divmod(spec.stamp_ns(tick), 10**9)
            ready.publish(message)

        def on_clock(message: Clock) -> None:
            tick = spec.tick_of(stamp_ns(message))
            twist = Twist()
            twist.linear.x, twist.angular.z = 6.0, 0.2 * np.sin(0.1 * tick)
            wheel.publish(twist)
            finish(tick)

        node.create_subscription(Clock, "/clock", on_clock, 50)
        finish(spec.loaded_tick)
        spin_until(lambda: command.process.poll() is not None)
    code, output = command.finish()
    assert code == 0, output
    return dataset / "scenes" / "train" / "Blocks-0000"


def driven_by_commands(small_config: Config) -> Path:
    """A configuration with an empty street for ``drive``."""
    more = "ego: {driver: twist}\ngraph: {participants: [driver], window_ticks: 1}\n"
    config = small_config(4, more, without=["camera", "lidar", "radar"])
    config.write_text(config.read_text().replace("vehicles: 15, pedestrians: 15", "vehicles: 0, pedestrians: 0"))
    return config


def test_the_ego_follows_commands(simbev: Simbev, small_config: Config, tmp_path: Path) -> None:
    bag = drive(simbev, driven_by_commands(small_config), tmp_path / "out")
    with AnyReader([bag]) as reader:
        odometry: list[Any] = [
            reader.deserialize(payload, connection.msgtype)
            for connection, _, payload in reader.messages([c for c in reader.connections if c.topic == "/ego/odom"])
        ]
    assert odometry[0].twist.twist.linear.x < 0.1
    assert odometry[-1].twist.twist.linear.x == pytest.approx(6.0, abs=0.3)
    # At first, while the ego accelerates, its wheels lag behind.
    assert max(abs(each.twist.twist.angular.z) for each in odometry[-30:]) == pytest.approx(0.2, abs=0.05)


@pytest.mark.slow
def test_equal_commands_lead_to_equal_bytes(simbev: Simbev, small_config: Config, tmp_path: Path) -> None:
    config = driven_by_commands(small_config)
    bags = [drive(simbev, config, tmp_path / name) for name in ("a", "b")]
    with SceneBag(bags[0]) as first, SceneBag(bags[1]) as second:
        assert first.custom_data["complete"] == "true"
        digests = [topic_digests(bag) for bag in (first, second)]
    for each in digests:
        del each["/ego/boxes/markers"]  # the middleware leaves the padding between its fields uninitialized
    assert digests[0] == digests[1]
