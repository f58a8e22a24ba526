"""Motorways as drafts, checked by plane geometry: offsets, ramps, added lanes, and layers at crossings."""

from itertools import pairwise

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.plan.draft import Draft, DraftRoad, RoadClass
from simbev_ros.maps.plan.heights.profile import add_heights
from simbev_ros.maps.plan.merges import LanePair, lane_pairs
from simbev_ros.maps.plan.noding import divide_draft
from simbev_ros.maps.plan.patterns.motorway import CrossingRoad, Motorway, draw_motorway
from simbev_ros.maps.plan.plan import Link

Line = NDArray[np.float64]
LANES, WIDTH_M, MEDIAN_M, CROSSING_M = 3, 3.5, 10.0, 60.0
STREET = RoadClass(lanes=1, sidewalk_m=2.0)
EIGHT = ((-870, -430), (-290, -430), (270, 420), (860, 420), (860, -420), (270, -420), (-290, 430), (-870, 430))
ROADS = (
    CrossingRoad(road=STREET, points_m=((-560, -700), (-560, 0))),
    CrossingRoad(road=STREET, points_m=((560, 700), (560, 0)), over=False),
)


@pytest.fixture(scope="module")
def eight() -> Draft:
    motorway = Motorway(
        pattern="motorway",
        points_m=EIGHT,
        radius_m=300,
        closed=True,
        lanes=LANES,
        lane_width_m=WIDTH_M,
        median_m=MEDIAN_M,
        shoulder_m=WIDTH_M,
        crossing_roads=ROADS,
    )
    draft = Draft()
    draw_motorway(motorway, draft, np.random.default_rng(0))
    return draft


def ramps(draft: Draft) -> list[DraftRoad]:
    return [road for road in draft.roads if road.name.endswith(("entry", "exit"))]


def carriageways(draft: Draft) -> list[DraftRoad]:
    return [road for road in draft.roads if road.kind.one_way and not road.name.endswith(("entry", "exit"))]


def paving(road: DraftRoad, right_m: float) -> shapely.Polygon:
    """Polygon from the left edge of the lanes to ``right_m`` to its right."""
    return shapely.LineString(road.line_m).buffer(-right_m, single_sided=True, join_style="mitre")


def unit(step: Line) -> Line:
    return np.asarray(step / np.linalg.norm(step))


def test_carriageways_run_side_by_side_with_the_median_between_them(eight: Draft) -> None:
    backward = shapely.MultiLineString([road.line_m for road in carriageways(eight) if ".backward." in road.name])
    vertices_m = np.concatenate([road.line_m for road in carriageways(eight) if ".forward." in road.name])
    points = shapely.points(vertices_m[np.linalg.norm(vertices_m, axis=1) > CROSSING_M])
    assert shapely.distance(points, backward) == pytest.approx(MEDIAN_M, abs=0.3)


def test_a_closed_motorway_forms_a_loop(eight: Draft) -> None:
    for name in ("forward", "backward"):
        lines = [road.line_m for road in carriageways(eight) if f".{name}." in road.name]
        assert all(np.allclose(line[-1], onward[0]) for line, onward in pairwise([*lines, lines[0]]))


def test_ramps_begin_and_end_beside_the_lanes_and_along_them(eight: Draft) -> None:
    assert len(ramps(eight)) == 8
    for ramp in ramps(eight):
        leaves = ramp.joins_m[0] is not None
        node_m = ramp.joins_m[0 if leaves else 1]
        assert node_m is not None
        carriageway = next(
            w for w in carriageways(eight) if np.allclose(w.line_m[0 if leaves else -1], node_m, atol=1e-6)
        )
        along = unit(
            carriageway.line_m[1] - carriageway.line_m[0] if leaves else carriageway.line_m[-1] - carriageway.line_m[-2]
        )
        end_m, before = (0, ramp.line_m[1] - ramp.line_m[0]) if leaves else (-1, ramp.line_m[-1] - ramp.line_m[-2])
        beside_m = ramp.line_m[end_m] - node_m
        assert beside_m @ along == pytest.approx(0.0, abs=0.3)
        assert beside_m @ [along[1], -along[0]] == pytest.approx(LANES * WIDTH_M, abs=0.05)
        assert np.degrees(np.arccos(unit(before) @ along)) < 2.0


def test_ramp_curvature_suits_their_speed(eight: Draft) -> None:
    for ramp in ramps(eight):
        steps = np.diff(ramp.line_m, axis=0)
        turn_rad = np.abs(np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))))
        radius_m = np.linalg.norm(steps[1:], axis=1) / np.maximum(turn_rad, 1e-9)
        assert radius_m.min() > 60.0, ramp.name


def test_ramps_cover_neither_the_lanes_nor_the_shoulders_of_the_motorway(eight: Draft) -> None:
    for ramp in ramps(eight):
        lane = paving(ramp, WIDTH_M)
        for carriageway in carriageways(eight):
            width_m = carriageway.kind.lanes * WIDTH_M + carriageway.kind.shoulder_m
            assert lane.intersection(paving(carriageway, width_m)).area < 1.0, (ramp.name, carriageway.name)


def test_lanes_are_added_before_exits_and_after_entries_in_place_of_the_shoulder(eight: Draft) -> None:
    for carriageway in carriageways(eight):
        beside_ramp = carriageway.kind.lanes == LANES and carriageway.kind.shoulder_m == 0.0
        assert beside_ramp or carriageway.kind.lanes * WIDTH_M + carriageway.kind.shoulder_m == (LANES + 1) * WIDTH_M
    for ramp in ramps(eight):
        leaves = ramp.joins_m[0] is not None
        node_m = ramp.joins_m[0 if leaves else 1]
        added = next(w for w in carriageways(eight) if np.allclose(w.line_m[-1 if leaves else 0], node_m, atol=1e-6))
        assert added.kind.lanes == LANES + 1
        assert shapely.LineString(added.line_m).length >= 159.0


def test_roads_that_cross_the_motorway_are_on_another_layer(eight: Draft) -> None:
    lines = [shapely.LineString(road.line_m) for road in eight.roads]
    layers = [road.layer for road in eight.roads]
    first, second = shapely.STRtree(lines).query(lines, predicate="crosses")
    pairs = [(a, b) for a, b in zip(first.tolist(), second.tolist(), strict=True) if a < b]
    assert all(layers[a] != layers[b] for a, b in pairs)
    named = [{eight.roads[a].name.split(".")[1], eight.roads[b].name.split(".")[1]} for a, b in pairs]
    assert len([pair for pair in named if pair <= {"forward", "backward"}]) == 4, "each carriageway over both others"
    assert len(pairs) == 4 + 2 * len(ROADS)


def test_a_street_that_passes_beneath_stays_on_the_ground(eight: Draft) -> None:
    assert {road.layer for road in eight.roads if road.name.startswith("motorway.road1")} == {0}
    assert 1 in {road.layer for road in eight.roads if road.name.startswith("motorway.road0")}


def test_a_road_that_misses_the_motorway_is_refused() -> None:
    far = CrossingRoad(road=STREET, points_m=((0, 500), (900, 500)))
    motorway = Motorway(pattern="motorway", points_m=((0, 0), (1000, 0)), crossing_roads=(far,))
    with pytest.raises(InputError, match=r"road motorway\.road0: does not cross its motorway"):
        draw_motorway(motorway, Draft(), np.random.default_rng(0))


def one_way(name: str, lanes: int, start: int, end: int, *points_m: tuple[float, float]) -> Link:
    kind = RoadClass(one_way=True, lanes=lanes, line_at="left")
    line_m = np.array(points_m)
    return Link(name, DraftRoad(name, kind, line_m), start, end, line_m)


def test_lanes_of_a_ramp_become_the_right_ones_where_it_joins() -> None:
    main = one_way("main", 2, 0, 1, (0, 0), (100, 0))
    ramp = one_way("ramp", 1, 2, 1, (0, -27), (50, -12), (100, -7))
    onward = one_way("onward", 3, 1, 3, (100, 0), (200, 0))
    expected = [("ramp", 0, "onward", 0), ("main", 0, "onward", 1), ("main", 1, "onward", 2)]
    assert list(lane_pairs(1, [main, ramp, onward])) == [LanePair(*pair) for pair in expected]


def test_a_new_lane_begins_on_the_right_and_the_others_continue_straight() -> None:
    links = [one_way("a", 2, 0, 1, (0, 0), (100, 0)), one_way("b", 3, 1, 2, (100, 0), (200, 0))]
    expected = [("a", 0, "b", 1), ("a", 1, "b", 2)]
    assert list(lane_pairs(1, links)) == [LanePair(*pair) for pair in expected]


def test_ramps_are_level_with_the_carriageway_beside_them_on_hilly_land(eight: Draft) -> None:
    def land(xy_m: Line) -> Line:
        return np.asarray(12.0 * np.sin(xy_m[:, 0] / 150.0) * np.cos(xy_m[:, 1] / 170.0))

    plan = add_heights(divide_draft(Draft([road for road in eight.roads if road.kind.one_way or road.layer])), land, ())
    ramp_names = {road.name for road in ramps(eight)}
    main = [link for link in plan.links if link.road.kind.one_way and link.road.name not in ramp_names]
    steps_m = []
    for ramp in (link for link in plan.links if link.road.name in ramp_names):
        for carriageway in main:
            line = shapely.LineString(carriageway.line_m)
            for x, y, z in ramp.line_m:
                point = shapely.Point(x, y)
                at_m = line.project(point)
                if line.distance(point) < carriageway.road.kind.lanes * WIDTH_M + 1.0 and 0.0 < at_m < line.length:
                    steps_m.append(abs(line.interpolate(at_m).z - z))
    assert len(steps_m) > 20
    assert max(steps_m) < 0.12
