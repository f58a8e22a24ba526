"""Nodes outside the graph: the world waits for participants, subscribers receive topics, services control the world."""

import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from commands import Command
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool, Trigger
from subscriber import keep, outside_node
from visualization_msgs.msg import MarkerArray

from simbev_ros.schema.scene.spec import SceneSpec

pytestmark = pytest.mark.graph

Simbev = Callable[..., Command]
Config = Callable[..., Path]
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def test_world_is_at_most_the_window_ahead_of_a_listed_participant(simbev: Simbev, small_config: Config) -> None:
    lockstep = "graph: {participants: [stack], window_ticks: 2}"
    simbev("run", small_config(600, lockstep, without=["camera", "lidar", "radar"]))
    scenes: list[String] = []
    clocks: list[Clock] = []
    with outside_node("stack") as (node, spin_until):
        node.create_subscription(String, "/world/scene", keep(scenes), LATCHED)
        node.create_subscription(Clock, "/clock", keep(clocks), 50)
        ready = node.create_publisher(Header, "/sync/ready", LATCHED)
        spin_until(lambda: bool(scenes))
        spec = SceneSpec.model_validate_json(scenes[0].data)

        def finish(tick: int) -> None:
            stamp_ns = spec.stamp_ns(tick)
            message = Header(frame_id=f"stack:{spec.name}")
            message.stamp.sec, message.stamp.nanosec = divmod(stamp_ns, 10**9)
            ready.publish(message)

        def last_tick() -> int:
            return spec.tick_of(clocks[-1].clock.sec * 10**9 + clocks[-1].clock.nanosec) if clocks else -100

        finish(-1)
        spin_until(lambda: last_tick() >= 1)  # the next report would replace one that the world has not received
        finish(3)
        spin_until(lambda: last_tick() >= 5)
        with pytest.raises(AssertionError, match="timed out"):
            spin_until(lambda: last_tick() > 5, 1.5)
        finish(9)
        spin_until(lambda: last_tick() == 11)


def test_live_graph_serves_subscribers_and_services(simbev: Simbev, small_config: Config) -> None:
    simbev("run", small_config(600, without=["camera", "radar"]), "--live")
    clouds: list[PointCloud2] = []
    grids: list[OccupancyGrid] = []
    drawn: list[MarkerArray] = []
    clocks: list[Clock] = []
    with outside_node("consumer") as (node, spin_until):
        node.create_subscription(PointCloud2, "/ego/lidar/points", keep(clouds), qos_profile_sensor_data)
        node.create_subscription(OccupancyGrid, "/ego/bev/road/grid", keep(grids), 10)
        node.create_subscription(MarkerArray, "/world/markers", keep(drawn), 10)
        node.create_subscription(Clock, "/clock", keep(clocks), 10)
        spin_until(lambda: len(clouds) > 5 and len(grids) > 5 and len(drawn) > 5)
        assert [field.name for field in clouds[0].fields] == ["x", "y", "z", "intensity", "ring", "time"]
        assert set(grids[0].data) == {0, 100}
        assert {"car", "pedestrian"} <= {marker.ns for marker in drawn[0].markers}

        pause = node.create_client(SetBool, "/world/pause")
        step = node.create_client(Trigger, "/world/step")

        def call(client: Any, request: Any) -> Any:
            assert client.wait_for_service(10)
            future = client.call_async(request)
            spin_until(future.done)
            return future.result()

        assert not call(step, Trigger.Request()).success
        assert call(pause, SetBool.Request(data=True)).success
        with pytest.raises(AssertionError, match="timed out"):
            spin_until(lambda: False, 1.0)
        paused_at = clocks[-1].clock
        assert call(step, Trigger.Request()).success
        spin_until(lambda: clocks[-1].clock != paused_at)
        moved_ns = (clocks[-1].clock.sec - paused_at.sec) * 10**9 + clocks[-1].clock.nanosec - paused_at.nanosec
        assert moved_ns == 50_000_000


def test_subscriber_of_the_readme_works_unchanged(simbev: Simbev, small_config: Config, tmp_path: Path) -> None:
    readme = (Path(__file__).parents[3] / "README.md").read_text()
    match = re.search(r"```python\n(.*?)```", readme, re.DOTALL)
    assert match is not None
    script = tmp_path / "subscriber.py"
    script.write_text(match[1])
    command = simbev("run", small_config(600, without=["radar", "gnss", "imu"]), "--live")
    with subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=command.environment
    ) as process:
        assert process.stdout is not None
        seen: set[str] = set()
        for _ in range(40):
            seen.add(process.stdout.readline().split()[0])
            if len(seen) == 2:
                break
        process.send_signal(signal.SIGINT)
    assert seen == {"image", "lidar"}
