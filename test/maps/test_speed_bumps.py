"""Speed bumps of Lanelet2 and OpenStreetMap files: their outlines, and the speeds at which drivers pass them."""

from pathlib import Path

import numpy as np
import pytest
from lanelet2_sample import LaneletSample, straight_lane
from osm_sample import Writer

from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.source import map_spec


def network_of(folder: Path, text: str) -> RoadNetwork:
    (folder / "map.osm").write_text(text)
    return load_network(map_spec(str(folder / "map.osm")), folder / "cache")


@pytest.mark.parametrize("area", ["yes", "no"])
@pytest.mark.parametrize(
    ("tags", "speed_kmh"),
    [
        ({"height": "0.15"}, 8.0),
        ({"height": "0.02"}, 10.0),
        ({"height": "0.5"}, 5.0),
        ({"height": "high"}, 15.0),
        ({"height": "0.15", "slow_down_speed": "7.0"}, 7.0),
        ({}, 15.0),
    ],
)
def test_the_speed_at_a_bump_of_lanelet2_follows_from_its_tags(
    tmp_path: Path, tags: dict[str, str], speed_kmh: float, area: str
) -> None:
    sample = LaneletSample()
    names = straight_lane(sample, (0.0, 60.0, 120.0), 0.0, 3.5)
    corners = [(80.0, -1.0), (82.0, -1.0), (82.0, 5.0), (80.0, 5.0)]
    outline = sample.line(corners, "speed_bump", "", area=area, **tags)
    sample.add_rule(names[1], sample.rule("speed_bump", ("way", "refers", outline)))
    network = network_of(tmp_path, sample.text())
    (bump,) = network.features.speed_bumps
    assert bump.speed_mps == pytest.approx(speed_kmh / 3.6)
    start_m = min((lane.centerline_m[0] for lane in network.lanes_of(LaneKind.DRIVING)), key=lambda each: each[0])
    expected_m = np.array(corners) - [0.0, 1.75] + start_m[:2]
    np.testing.assert_allclose(bump.outline_m[:, :2], expected_m, atol=0.01)
    assert not any("regulatory" in finding.rule for finding in network.findings)


@pytest.mark.parametrize(
    ("kind", "speed_kmh", "length_m"),
    [("bump", 15.0, 0.5), ("hump", 25.0, 4.0), ("table", 25.0, 6.0), ("island", 0, 0)],
)
def test_a_node_with_traffic_calming_is_a_bump_across_its_road_only(
    tmp_path: Path, kind: str, speed_kmh: float, length_m: float
) -> None:
    writer = Writer()
    writer.way([(0, 0), (60, 0), (120, 0)], {"highway": "residential", "lanes": "2"})
    writer.way([(0, 12), (60, 12), (120, 12)], {"highway": "residential", "lanes": "2"})
    writer.way([(0, 0), (0, 12)], {"highway": "residential", "lanes": "2"})
    node = next(line for line in writer.text().splitlines() if "<node" in line and 'id="2"' in line)
    calmed = node.replace("/>", f'><tag k="traffic_calming" v="{kind}"/></node>')
    network = network_of(tmp_path, writer.text().replace(node, calmed))
    assert len(network.features.speed_bumps) == bool(speed_kmh)
    for bump in network.features.speed_bumps:
        assert bump.speed_mps == pytest.approx(speed_kmh / 3.6)
        assert np.isnan(bump.outline_m[:, 2]).all()
        low_m, high_m = bump.outline_m[:, :2].min(axis=0), bump.outline_m[:, :2].max(axis=0)
        assert high_m[0] - low_m[0] == pytest.approx(length_m, abs=0.1)
        lines_m = [lane.centerline_m for lane in network.lanes_of(LaneKind.DRIVING) if lane.length_m > 60.0]
        assert sum(low_m[1] < line_m[:, 1].mean() < high_m[1] for line_m in lines_m) == 2, "both directions"
        assert len(lines_m) == 4
