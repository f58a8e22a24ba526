"""Nodes and commands beside a live graph: subscribers receive topics, services control the world."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from commands import Command, Config, Simbev
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import qos_profile_sensor_data
from ros_domain import DOMAIN
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from subscriber import Caller, clock_ns, keep, outside_node, paused_ns
from visualization_msgs.msg import MarkerArray

pytestmark = pytest.mark.graph


def test_live_graph_serves_subscribers_and_services(graph: Command) -> None:
    clouds: list[PointCloud2] = []
    grids: list[OccupancyGrid] = []
    drawn: list[MarkerArray] = []
    clocks: list[Clock] = []
    with outside_node("consumer") as (node, spin_until):
        node.create_subscription(PointCloud2, "/ego/lidar/points", keep(clouds), qos_profile_sensor_data)
        node.create_subscription(OccupancyGrid, "/ego/bev/road/grid", keep(grids), 10)
        node.create_subscription(MarkerArray, "/world/markers", keep(drawn), 10)
        node.create_subscription(Clock, "/clock", keep(clocks), 10)
        graph.wait_for(lambda: min(map(len, (clouds, grids, drawn))) > 3, spin_until)
        assert [field.name for field in clouds[0].fields] == ["x", "y", "z", "intensity", "ring", "time"]
        assert set(grids[0].data) == {0, 100}
        assert {"car", "pedestrian"} <= {marker.ns for marker in drawn[0].markers}

        caller = Caller(node, spin_until)
        assert not caller.trigger("/world/step").success
        assert caller.pause(paused=True).success
        try:
            start_ns = paused_ns(clocks, spin_until)
            assert caller.trigger("/world/step").success
            spin_until(lambda: clock_ns(clocks[-1]) != start_ns)
            assert clock_ns(clocks[-1]) == start_ns + 100_000_000
        finally:
            assert caller.pause(paused=False).success


def test_subscriber_of_the_readme_works_unchanged(graph: Command, tmp_path: Path) -> None:
    readme = (Path(__file__).parents[4] / "README.md").read_text()
    match = re.search(r"```python\n(.*?)```", readme, re.DOTALL)
    assert match is not None
    script, log = tmp_path / "subscriber.py", tmp_path / "subscriber.log"
    script.write_text(match[1])
    with (
        log.open("w") as output,
        subprocess.Popen([sys.executable, script], stdout=output, env=graph.environment) as it,
    ):
        graph.wait_for(lambda: {line.partition(" ")[0] for line in log.read_text().splitlines()} == {"image", "lidar"})
        it.kill()


def test_another_graph_is_refused_in_the_same_domain(graph: Command, simbev: Simbev, small_config: Config) -> None:
    code, output = simbev("run", small_config()).finish()
    assert code == 2, output
    assert f"ROS domain {DOMAIN} is in use by another simbev graph" in output
    assert graph.process.poll() is None
