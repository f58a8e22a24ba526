"""Vector maps: a hand-computed record of a small street, records under and on a bridge, and a town against shapely."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from road_strips import layout_of_strips, level_ground, side_by_side, straight
from synthetic_world import EGO_ID, actor, box_model, world

from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import Lane, RoadNetwork, Signal
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Crosswalk, Layout, Line, Paint, PaintColor, Sign, SignKind, StopLine
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.annotation.bev.levels import Levels
from simbev_ros.simulation.annotation.vector_map.vector_map import VectorMap

CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))


def ego_at(x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> WorldState:
    return world(actor(CAR, id=EGO_ID, x=x, y=y, z=z, yaw=yaw))


def street() -> tuple[SimpleNamespace, Layout]:
    """Two lanes to the east, one back, a shoulder; a stop line with a light, a crosswalk, a speed limit."""
    left, right, shoulder = side_by_side(3, name="e", start_m=(0, 0), end_m=(100, 0), height=level_ground)
    back = straight("back", (100, 3.5), (0, 3.5), level_ground)
    center, between = Line(Paint.SOLID_SOLID, PaintColor.YELLOW, 0.1), Line(Paint.BROKEN)
    strips = (
        replace(left, left="back", right="e1", left_line=center, right_line=between, speed_mps=13.9),
        replace(right, left="e0", right="e2", left_line=between, right_line=Line(Paint.SOLID), following=("on",)),
        replace(shoulder, left="e1", kind=LaneKind.SHOULDER),
        replace(back, left="e0", left_line=center, junction="J1", index=1),
        replace(straight("on", (100, -3.5), (140, -3.5), level_ground), junction="J2"),
    )
    outline_m = np.array([[80.0, -8, 0], [84, -8, 0], [84, 6, 0], [80, 6, 0]])
    layout = replace(
        layout_of_strips(*strips),
        crosswalks=(Crosswalk(outline_m, np.array([0.0, 1.0])),),
        stop_lines=(StopLine(np.array([[78.0, -5.0, 0], [78.0, 1.5, 0]])),),
        signs=(Sign(SignKind.SPEED_LIMIT, np.array([40.0, -9.0, 0]), np.pi, ("l1",), 13.9),),
    )
    line_m = np.array([[0.0, -3.5, 0], [99.0, -3.5, 0]])
    lane = Lane("l1", "l", 0, LaneKind.DRIVING, line_m, 3.5, 13.9, "", ())
    far = replace(lane, id="far", centerline_m=line_m + np.array([0.0, 500.0, 0.0]))
    lights = [
        Signal(np.array([110.0, -3.5, 5.6]), np.pi, np.zeros(3), "p", link, name)
        for link, name in enumerate(("far", "l1"))
    ]
    return SimpleNamespace(signals=tuple(lights), lanes={"l1": lane, "far": far}), layout


def test_a_record_matches_the_hand_computed_one() -> None:
    record = VectorMap(*street()).record(ego_at(60.0, -3.5, yaw=np.pi / 2))  # the ego looks across the street
    assert json.loads(json.dumps(record)) == record
    assert record["map_from_patch"] == {"translation": [60.0, -3.5, 0.0], "yaw": pytest.approx(np.pi / 2)}
    lanes = {lane["id"]: lane for lane in record["lanes"]}
    assert list(lanes) == ["e0", "e1", "e2", "back"]
    assert lanes["e1"]["center"] == [[[0.0, y, 0.0] for y in [15.0, *np.arange(14.0, -15.0, -2.0), -15.0]]]
    assert {key: lanes["e1"][key] for key in ("type", "level", "junction", "successors", "predecessors")} == {
        "type": "driving",
        "level": 0,
        "junction": None,
        "successors": ["on"],
        "predecessors": [],
    }
    assert (lanes["e1"]["left_neighbors"], lanes["e1"]["right_neighbors"]) == (["e0"], ["e2"])
    assert (lanes["e0"]["left_neighbors"], lanes["e0"]["speed_mps"], lanes["e0"]["width_m"]) == (["back"], 13.9, 3.5)
    assert lanes["e0"]["left_line"] == {"paint": "solid solid", "color": "yellow", "width_m": 0.1}
    assert lanes["back"]["center"][0][0] == [7.0, -15.0, 0.0]  # against the others
    lines = [(line["class"], line["paint"], line["color"], len(line["pieces"])) for line in record["lines"]]
    assert sorted(lines) == [
        ("center", "solid solid", "yellow", 1),
        ("edge", "solid", "white", 1),
        ("lane", "broken", "white", 1),
    ]
    curbs = sorted(piece[0][0] for edge in record["edges"] for piece in edge["pieces"])
    assert curbs == pytest.approx([-5.25, 8.75])  # the shoulder's right side, the left one of the lane back
    assert record["crosswalks"] == record["stop_lines"] == []
    assert record["traffic_lights"] == [{"id": 2, "position": [0.0, -50.0, 5.6], "yaw": 1.5708, "lanes": ["e1"]}]
    assert record["signs"][0]["position"] == [-5.5, 20.0, 0.0]
    assert [record["signs"][0][key] for key in ("kind", "speed_mps", "lanes")] == ["speed_limit", 13.9, ["e1"]]


def test_crosswalks_are_clipped_and_stop_lines_name_their_lanes() -> None:
    record = VectorMap(*street()).record(ego_at(52.0, 0.0))
    (crosswalk,) = record["crosswalks"]
    (outline,) = crosswalk["outlines"]
    assert {tuple(point) for point in outline} == {(28, -8, 0), (30, -8, 0), (30, 6, 0), (28, 6, 0)}
    (line,) = record["stop_lines"]
    assert line == {
        "id": 0,
        "level": 0,
        "yields": False,
        "lanes": ["e0", "e1"],
        "pieces": [[[26, -5, 0], [26, 1.5, 0]]],
    }
    assert max(point[0] for each in record["lines"] for piece in each["pieces"] for point in piece) == 28.0


def test_paint_is_listed_from_left_to_right_of_the_line() -> None:
    network, layout = street()
    line = Line(Paint.SOLID_BROKEN, PaintColor.YELLOW)  # on the left of a lane, inside to outside is right to left
    layout = replace(layout, strips=(replace(layout.strips[0], left="", left_line=line, right_line=Line()),))
    (path,) = VectorMap(network, layout).record(ego_at(50.0, 0.0))["lines"]
    assert (path["class"], path["paint"]) == ("edge", "broken solid")


def crossing() -> Layout:
    """A road to the east that rises to 6 m above one to the north, on a structure between x = ±20."""

    def ramp_height(xy_m: Float64Array) -> Float64Array:
        return np.asarray(6.0 * np.clip((150.0 - np.abs(xy_m[:, 0])) / 130.0, 0.0, 1.0))

    west, deck, east = (
        straight(name, (start, 0), (end, 0), ramp_height)
        for name, start, end in (("west", -150, -20), ("deck", -20, 20), ("east", 20, 150))
    )
    strips = replace(west, following=("deck",)), replace(deck, level=1, following=("east",)), east
    return layout_of_strips(*strips, straight("below", (0, -150), (0, 150), level_ground))


def lengths_m(record: dict[str, list[dict[str, list[list[list[float]]]]]]) -> dict[str, float]:
    """Length of the center line of each lane of a record."""
    return {
        str(lane["id"]): sum(
            float(np.linalg.norm(np.diff(np.array(piece)[:, :2], axis=0), axis=1).sum()) for piece in lane["center"]
        )
        for lane in record["lanes"]
    }


def test_only_roads_on_the_egos_level_are_recorded() -> None:
    layout = crossing()
    levels, vector_map = Levels(layout), VectorMap(SimpleNamespace(signals=(), lanes={}), layout, 100.0, 60.0)
    state = ego_at(0.0, -10.0, yaw=np.pi / 2)
    record = vector_map.record(state, levels.ego_level(state))
    assert lengths_m(record) == pytest.approx({"west": 10.0, "east": 10.0, "below": 100.0})
    assert {edge["level"] for edge in record["edges"]} == {0}
    state = ego_at(-8.0, 0.0, 6.0)
    record = vector_map.record(state, levels.ego_level(state))
    assert lengths_m(record) == pytest.approx({"west": 38.0, "deck": 40.0, "east": 22.0})
    assert sum(len(edge["pieces"]) for edge in record["edges"]) == 6  # no edge across where the structure begins
    assert all(np.ptp(np.array(piece)[:, 1]) < 0.01 for edge in record["edges"] for piece in edge["pieces"])
    heights = [point[2] for lane in record["lanes"] if lane["id"] == "deck" for point in lane["center"][0]]
    assert heights == pytest.approx([0.0] * len(heights))  # the ego's height is the patch's origin
    everything = vector_map.record(state)
    assert set(lengths_m(everything)) == {"west", "deck", "east", "below"}


@pytest.fixture(scope="module")
def town() -> RoadNetwork:
    return load_network(MapSpec(name="Town10HD", seed=0))


def test_lanes_of_a_town_agree_with_shapely(town: RoadNetwork) -> None:
    waypoints = town.waypoints(90.0)
    center_m = np.median(waypoints.position_m, axis=0)
    near = np.argsort(np.linalg.norm(waypoints.position_m - center_m, axis=1))[:4].tolist()
    layout = town.layout.near(shapely.Point(waypoints.position_m[near].mean(axis=0)[:2]).buffer(200.0), 60.0)
    vector_map = VectorMap(town, layout)
    strips = [strip for strip in layout.strips if strip.outline_m is None and strip.kind is not LaneKind.MEDIAN]
    for index in near:
        (x, y, z), yaw = waypoints.position_m[index].tolist(), float(waypoints.yaw_rad[index]) + 0.2
        state = ego_at(x, y, z, yaw)
        found = {lane["id"]: lane for lane in vector_map.record(state)["lanes"]}
        forward, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
        corners_m = [
            np.array([x, y]) + a * 30 * forward + b * 15 * left for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))
        ]
        window, names = shapely.Polygon(corners_m), set()
        for strip in strips:
            for side, line_m in (("left", strip.left_m), ("center", strip.center_m), ("right", strip.right_m)):
                expected_m = shapely.intersection(shapely.LineString(line_m[:, :2]), window).length
                pieces = found.get(strip.id, {}).get(side, [])
                steps = [np.linalg.norm(np.diff(np.array(piece)[:, :2], axis=0), axis=1).sum() for piece in pieces]
                assert sum(steps) == pytest.approx(expected_m, abs=0.01)
                names |= {strip.id} if expected_m > 0.01 else set()
        assert names <= set(found)


def test_links_of_a_town_connect_adjacent_lanes(town: RoadNetwork) -> None:
    center_m = np.median(town.waypoints(24.0).position_m, axis=0)
    layout = town.layout.near(shapely.Point(center_m[:2]).buffer(150.0), 0.0)
    record = VectorMap(town, layout, 200.0, 200.0).record(ego_at(*center_m.tolist()))
    by_id = {strip.id: strip for strip in layout.strips}
    driving = [lane for lane in record["lanes"] if lane["type"] == "driving"]
    assert sum(len(lane["successors"]) for lane in driving) > len(driving) // 2
    records_by_id = {lane["id"]: lane for lane in driving}
    for lane in driving:
        for name in lane["successors"]:
            assert np.linalg.norm(by_id[lane["id"]].center_m[-1] - by_id[name].center_m[0]) < 1.0
            assert name not in records_by_id or lane["id"] in records_by_id[name]["predecessors"]
    assert record["traffic_lights"]
    for light in record["traffic_lights"]:
        (name,) = light["lanes"]
        assert name == town.signals[light["id"] - 1].lane  # strips of towns have the names of traffic lanes
