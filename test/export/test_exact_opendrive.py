"""Lanelet2 maps written as OpenDRIVE and read again have the same lanes, lengths and successors."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from lanelet2_sample import Crossing, LaneletSample

from simbev_ros.export.maps.conversion import write_map
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import Lane, RoadNetwork, paths_beyond
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.source import map_spec

SHARED = Path(__file__).parents[3] / "shared/maps/foreign/autoware"


def ring() -> str:
    """A square ring of four lanelets, 8 m wide where it is straight and 3 m wide in its left bends of 2 m radius."""
    sample = LaneletSample()
    turn_rad = np.linspace(-np.pi / 2.0, 0.0, 7)
    straight_m = np.column_stack([np.linspace(-14.0, 14.0, 6), np.full(6, -18.0)])
    bend_m = np.array([16.0, -16.0]) + 2.0 * np.column_stack([np.cos(turn_rad), np.sin(turn_rad)])
    side_m, half_m = np.concatenate([straight_m, bend_m]), np.repeat([4.0, 1.5], [6, 7])[:, None]
    left_m, right_m = (side_m + half_m * sign * _normals(side_m) for sign in (1.0, -1.0))
    quarter = np.array([[0.0, 1.0], [-1.0, 0.0]])
    borders = []
    for line_m in (left_m, right_m):
        sides = np.stack([line_m @ np.linalg.matrix_power(quarter, number) for number in range(4)])
        borders.append(np.concatenate([sides, np.roll(sides, -1, axis=0)[:, :1]], axis=1))
    for left, right in zip(*borders, strict=True):
        sample.lanelet(sample.line(left.tolist()), sample.line(right.tolist()), speed_limit="30")
    return sample.text()


def _normals(line_m: Float64Array) -> Float64Array:
    along_m = np.gradient(line_m, axis=0)
    return np.column_stack([-along_m[:, 1], along_m[:, 0]]) / np.linalg.norm(along_m, axis=1, keepdims=True)


def crossing() -> str:
    sample = LaneletSample()
    roads = Crossing(sample)
    roads.crosswalk(1)
    roads.lights(0)
    return sample.text()


def converted(path: Path, folder: Path) -> tuple[RoadNetwork, RoadNetwork, Path]:
    """A map, the same after it was written as OpenDRIVE, and the file."""
    network, file = load_network(map_spec(str(path)), folder), folder / "written.xodr"
    write_map(network, file)
    return network, load_network(map_spec(str(file)), folder), file


def streets(network: RoadNetwork) -> list[Lane]:
    return [lane for lane in network.lanes_of(LaneKind.DRIVING) if not lane.junction]


def ends_m(lanes: list[Lane]) -> Float64Array:
    return np.array([lane.centerline_m[[0, -1], :2].ravel() for lane in lanes])


FOREIGN = [
    pytest.param(name, marks=pytest.mark.slow) for name in ("aichallenge2024_tight_bends", "kashiwanoha_lanelet2_map")
]


@pytest.fixture(params=["ring", "crossing", *FOREIGN])
def source(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    made = {"ring": ring, "crossing": crossing}.get(request.param)
    if made is None:
        path = SHARED / f"{request.param}.osm"
        return path if path.is_file() else pytest.skip("without the shared maps")
    path = tmp_path / f"{request.param}.osm"
    path.write_text(made())
    return path


def test_lanes_keep_their_number_length_and_successors(source: Path, tmp_path: Path) -> None:
    before, after, _ = converted(source, tmp_path)
    first, second = streets(before), streets(after)
    assert len(second) == len(first)
    apart_m = np.abs(ends_m(first)[:, None] - ends_m(second)).max(axis=2)
    same = {lane.id: second[row].id for lane, row in zip(first, apart_m.argmin(axis=1).tolist(), strict=True)}
    assert apart_m.min(axis=1).max() < 1.0, "the ends of parallel lanes are staggered by up to a meter there"
    assert len(set(same.values())) == len(second)
    for lane in first:
        beyond = {same[path[-1]] for path in paths_beyond(lane, before.lanes)}
        assert {path[-1] for path in paths_beyond(after.lanes[same[lane.id]], after.lanes)} == beyond
        assert after.lanes[same[lane.id]].length_m == pytest.approx(lane.length_m, rel=0.02, abs=0.1)
    assert sum(lane.length_m for lane in second) == pytest.approx(sum(lane.length_m for lane in first), rel=0.01)


def test_no_tiny_roads_are_between_the_halves_of_a_loop(tmp_path: Path) -> None:
    path = tmp_path / "ring.osm"
    path.write_text(ring())
    before, _, file = converted(path, tmp_path)
    root = ElementTree.parse(file).getroot()
    lengths_m = [float(road.attrib["length"]) for road in root.iter("road")]
    assert len(lengths_m) == len(streets(before)) == 2
    assert root.find("junction") is None
    assert sum(lengths_m) == pytest.approx(sum(lane.length_m for lane in streets(before)), rel=0.01)
