"""Two graphs share a ROS domain under different namespaces, and neither notices the other."""

from pathlib import Path

import pytest
from commands import SCENE, Config, Simbev, digests
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import SetBool
from subscriber import keep, outside_node

pytestmark = [pytest.mark.graph, pytest.mark.slow]


def test_a_graph_below_a_namespace_beside_another_one_records_the_same_bytes_under_the_same_names(
    recorded: Path, simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    everything = small_config(0.5)
    live = simbev("run", small_config(600, name="live.yaml", without=["camera", "radar", "lidar"]), "--live")
    remapped = ("--ros-args", "-r", "/sim1/ego/lidar/points:=/sensing/points", "-p", "qos_overrides:=unused")
    below = simbev("run", everything, "--record", tmp_path / "out", "--namespace", "sim1", *remapped)
    with outside_node("outside") as (node, spin_until):
        pause = node.create_client(SetBool, "/sim1/world/pause")
        spin_until(pause.service_is_ready)
        asked = pause.call_async(SetBool.Request(data=True))
        spin_until(asked.done)
        clocks: list[Clock] = []
        others: list[Clock] = []
        clouds: list[PointCloud2] = []
        node.create_subscription(Clock, "/sim1/clock", keep(clocks), 1000)
        node.create_subscription(Clock, "/clock", keep(others), 1000)
        node.create_subscription(PointCloud2, "/sensing/points", keep(clouds), 1000)
        spin_until(lambda: node.count_publishers("/sensing/points") == 1 and len(clocks) > 2)
        spin_until(lambda: len({each.clock.nanosec for each in others}) > 4)
        assert len({each.clock.nanosec for each in clocks}) == 1  # the other graph is not paused
        names = {f"{namespace.rstrip('/')}/{name}" for name, namespace in node.get_node_names_and_namespaces()}
        assert {"/world", "/supervisor", "/ego/annotator", "/sim1/world", "/sim1/supervisor", "/sim1/recorder"} <= names
        assert {"/sim1/ego/lidar", "/sim1/ego/camera", "/sim1/ego/annotator"} <= names
        found = {name for name, _ in node.get_topic_names_and_types()}
        assert {"/sim1/world/scene", "/sim1/sync/ready", "/sim1/ego/odom", "/diagnostics"} <= found
        assert {"/sim1/diagnostics", "/sim1/ego/lidar/points"} & found == set()
        asked = pause.call_async(SetBool.Request(data=False))
        spin_until(lambda: len(clouds) >= 10)
    code, output = below.finish()
    assert code == 0, output
    assert live.process.poll() is None
    assert digests(tmp_path / "out" / SCENE) == digests(recorded)
