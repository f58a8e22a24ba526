"""Every built-in town, checked in the net that netconvert wrote, independently of the code that planned it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from simbev_ros.maps.land_features import Water
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.plan.town import build_town
from simbev_ros.maps.recipe import recipe_of

FAST = ("Blocks", "Town04", "Town10HD")
SLOW = ("Town01", "Town02", "Town03", "Town05", "Town06", "Town07", "Town12", "Town13", "Town15")
FREE_HEIGHT_M, DECK_M = 5.5, 1.0
STEEPEST, STEEPEST_MOTORWAY, MOTORWAY_MPS = 0.08, 0.05, 20.0
KINK_PER_5M = 0.01
FASTEST_CYCLING_MPS = 70.0 / 3.6


@dataclass(frozen=True)
class Net:
    """Content of a .net.xml: lanes by id as (speed, type, edge, (N, 3) line), and their successors."""

    parts: MapParts
    speed_mps: dict[str, float]
    kind: dict[str, str]
    edge: dict[str, str]
    line_m: dict[str, NDArray[np.float64]]
    links: tuple[tuple[str, str, str], ...]
    junctions: dict[str, NDArray[np.float64]]
    ends: dict[str, tuple[str, str]]

    def driving(self, internal: bool) -> list[str]:
        """Lanes of cars, on roads or inside junctions."""
        return [lane for lane, kind in self.kind.items() if kind == "driving" and lane.startswith(":") == internal]


@pytest.fixture(
    scope="module",
    params=[*FAST, *(pytest.param(town, marks=pytest.mark.slow) for town in SLOW)],
)
def net(request: pytest.FixtureRequest, built_town: Callable[[str], MapParts]) -> Net:
    return read(built_town(request.param))


def read(parts: MapParts) -> Net:
    root = ElementTree.parse(parts.net).getroot()
    speed, kind, edges, line, ends = {}, {}, {}, {}, {}
    for edge in root.findall("edge"):
        if "from" in edge.attrib:
            ends[edge.attrib["id"]] = (edge.attrib["from"], edge.attrib["to"])
        for lane in edge.findall("lane"):
            name = lane.attrib["id"]
            only = lane.get("allow", "")
            internal = "driving" if edge.get("function") == "internal" and only in ("", "all") else only or "foot"
            kind[name] = lane.get("type") or internal
            speed[name], edges[name] = float(lane.attrib["speed"]), edge.attrib["id"]
            points = [[float(value) for value in point.split(",")] for point in lane.attrib["shape"].split()]
            line[name] = np.array([(*point, 0.0)[:3] for point in points])
    links = tuple(
        (
            f"{link.attrib['from']}_{link.attrib['fromLane']}",
            f"{link.attrib['to']}_{link.attrib['toLane']}",
            link.get("via", ""),
        )
        for link in root.findall("connection")
        if not link.attrib["from"].startswith(":")
    )
    junctions = {
        junction.attrib["id"]: np.array([float(junction.attrib.get(axis, 0.0)) for axis in "xyz"])
        for junction in root.findall("junction")
        if junction.get("type") != "internal"
    }
    return Net(parts, speed, kind, edges, line, links, junctions, ends)


def test_every_road_can_be_reached_from_every_other(net: Net) -> None:
    names = sorted({net.edge[lane] for lane in net.driving(internal=False)})
    pairs = [(names.index(net.edge[a]), names.index(net.edge[b])) for a, b, _ in net.links if net.kind[a] == "driving"]
    graph = coo_array((np.ones(len(pairs)), tuple(zip(*pairs, strict=True))), shape=(len(names), len(names)))
    assert connected_components(graph, connection="strong")[0] == 1


def test_every_lane_has_a_successor_except_those_that_end_beside_a_motorway(net: Net) -> None:
    leading = {a for a, _, _ in net.links}
    ending = [lane for lane in net.driving(internal=False) if lane not in leading]
    assert [lane for lane in ending if net.speed_mps[lane] < MOTORWAY_MPS] == []


def test_lanes_meet_at_one_height_in_junctions(net: Net) -> None:
    for a, _, via in net.links:
        if net.kind[a] == "driving" and via:
            assert abs(net.line_m[a][-1, 2] - net.line_m[via][0, 2]) < 0.02, a
    for lane in net.driving(internal=False):
        for junction, end in zip(net.ends[net.edge[lane]], (0, -1), strict=True):
            assert abs(net.line_m[lane][end, 2] - net.junctions[junction][2]) < 0.3, (lane, junction)


def test_lanes_do_not_shift_sideways_where_a_road_continues(net: Net) -> None:
    for a, b, via in net.links:
        if net.kind[a] != "driving" or not via:
            continue
        before, after = unit(net.line_m[a][-1] - net.line_m[a][-2]), unit(net.line_m[b][1] - net.line_m[b][0])
        step_m = (net.line_m[b][0] - net.line_m[a][-1])[:2]
        middle = unit(before + after)
        aside_m = abs(middle[0] * step_m[1] - middle[1] * step_m[0])
        if before @ after > np.cos(np.radians(30.0)):
            assert aside_m < 0.5 or aside_m < np.tan(np.radians(20.0)) * (middle @ step_m), (a, b)


def test_lanes_of_a_road_end_side_by_side(net: Net) -> None:
    lanes: dict[str, list[NDArray[np.float64]]] = {}
    for lane in net.driving(internal=False):
        lanes.setdefault(net.edge[lane], []).append(net.line_m[lane])
    for edge, lines_m in lanes.items():
        for end, inner in ((0, 1), (-1, -2)):
            along = unit(lines_m[0][end] - lines_m[0][inner])
            assert np.ptp([line_m[end, :2] @ along for line_m in lines_m]) < 0.3, edge


def test_fast_roads_are_closed_to_bicycles_and_pedestrians(net: Net) -> None:
    lanes = ElementTree.parse(net.parts.net).getroot().iterfind("edge/lane[@type='driving']")
    closed = {lane.attrib["id"]: set(lane.get("disallow", "").split()) for lane in lanes}
    fast = {lane for lane in closed if net.speed_mps[lane] > FASTEST_CYCLING_MPS + 0.01}
    assert all({"bicycle", "pedestrian"} <= closed[lane] for lane in fast)
    assert not any("bicycle" in closed[lane] for lane in closed.keys() - fast)


def unit(step_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vector in plan view."""
    return np.asarray(step_m[:2] / np.linalg.norm(step_m[:2]))


def test_grades_and_vertical_curves_are_realistic(net: Net) -> None:
    for lane in net.driving(internal=False):
        steps = np.diff(net.line_m[lane], axis=0)
        length_m = np.linalg.norm(steps[:, :2], axis=1)
        grade = steps[:, 2] / np.maximum(length_m, 0.1)
        limit = STEEPEST_MOTORWAY if net.speed_mps[lane] > MOTORWAY_MPS else STEEPEST
        assert np.abs(grade[length_m > 1.0]).max(initial=0.0) < limit + 0.005, lane
        around_m = (length_m[:-1] + length_m[1:]) / 2.0
        kinks = np.abs(np.diff(grade)) * 5.0 / np.maximum(around_m, 5.0)
        assert kinks.max(initial=0.0) < 1.5 * KINK_PER_5M, lane


def test_roads_cross_at_one_height_or_with_clearance_for_trucks(net: Net) -> None:
    lanes = [*net.driving(internal=False), *net.driving(internal=True)]
    lines = [shapely.LineString(net.line_m[lane]) for lane in lanes]
    first, second = shapely.STRtree(lines).query(lines, predicate="crosses")
    for a, b in zip(first[first < second], second[first < second], strict=True):
        for place in shapely.get_parts(shapely.intersection(shapely.force_2d(lines[a]), shapely.force_2d(lines[b]))):
            if place.geom_type == "Point":
                heights = [lines[index].interpolate(lines[index].project(place)).z for index in (a, b)]
                apart_m = abs(heights[0] - heights[1])
                assert apart_m < 0.3 or apart_m > FREE_HEIGHT_M + DECK_M - 0.1, (lanes[a], lanes[b], apart_m)


def test_roads_stay_above_water(net: Net) -> None:
    for lane in net.driving(internal=False):
        for body in net.parts.features.water:
            above_m = heights_within(net.line_m[lane], body) - body.surface_m
            assert above_m.min(initial=np.inf) > 2.5, lane


def heights_within(line_m: NDArray[np.float64], body: Water) -> NDArray[np.float64]:
    dense = shapely.segmentize(shapely.LineString(line_m), 2.0)
    return shapely.get_coordinates(shapely.intersection(dense, body.area), include_z=True)[:, 2]


@pytest.mark.parametrize("town", ["Town03", pytest.param("Town05", marks=pytest.mark.slow)])
def test_same_recipe_and_seed_give_the_same_bytes(
    town: str, built_town: Callable[[str], MapParts], tmp_path: Path
) -> None:
    once, again = built_town(town), build_town(recipe_of(town), 0, tmp_path)
    assert once.net.read_bytes() == again.net.read_bytes()
    assert once.opendrive.read_bytes() == again.opendrive.read_bytes()
