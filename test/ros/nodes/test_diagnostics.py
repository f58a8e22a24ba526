"""Statuses of nodes: their levels, and the shipped analyzers that sort them."""

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus

from simbev_ros.config.paths import shipped_config_dir
from simbev_ros.config.rig import SENSOR_KINDS
from simbev_ros.ros.conventions.diagnostics import frequency_status, load_status
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.nodes.load_meter import LoadMeter


@pytest.mark.parametrize("node", [*SENSOR_KINDS, "camera_3", "annotator", "annotator_boxes", "world", "recorder"])
def test_exactly_one_of_the_shipped_analyzers_takes_the_statuses_of_each_node(node: str) -> None:
    text = (shipped_config_dir() / "diagnostics" / "analyzers.yaml").read_text(encoding="utf-8")
    analyzers = [each for each in yaml.safe_load(text)["/**"]["ros__parameters"].values() if isinstance(each, dict)]
    name = NodeName(node, "" if node in ("world", "recorder") else "ego")
    status = load_status(name, LoadMeter().read())
    assert sum(status.name.startswith(tuple(each["startswith"])) for each in analyzers) == 1
    assert {each["type"] for each in analyzers} == {"diagnostic_aggregator/GenericAnalyzer"}


def test_a_node_that_drops_ticks_or_ignores_messages_warns_until_it_does_so_no_more() -> None:
    name, meter = NodeName("lidar", "ego"), LoadMeter()
    for ticks, late, ignored in ((20, 1, 0), (18, 3, 0), (20, 0, 2), (0, 0, 0)):
        for _ in range(ticks):
            with meter.busy():
                pass
        meter.count_late(late)
        for _ in range(ignored):
            meter.count_ignored()
        load = meter.read()
        warns = frequency_status(name, load).level == DiagnosticStatus.WARN, load_status(name, load).level != b"\0"
        assert warns == (late > 2, ignored > 0)
