"""Tests that the map expansion for nuScenes has the roads of the map: areas, lanes, paths, links, lines and lights."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from made_up_scene import made_up_scene
from nuscenes_tables import export, tables_of

from simbev_exporters.nuscenes.map_expansion import traffic_control
from simbev_exporters.nuscenes.map_expansion.arcline_paths import arcline_path
from simbev_exporters.nuscenes.map_expansion.dividers import divider_type
from simbev_exporters.nuscenes.map_expansion.expansion import map_expansion
from simbev_exporters.nuscenes.sites import Site
from simbev_ros.assets.street import signal_poles
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Paint, PaintColor
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.schema.scene.map_spec import MapSpec

Layers = dict[str, Any]
PATH_M = 0.1
"""Distance that a path may have from the center line, whose corners it rounds."""


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    return load_network(MapSpec(name="Blocks"))


@pytest.fixture(scope="module")
def site() -> Site:
    """A part of Blocks, so that the site's borders cut roads."""
    extent = {"low_m": [-60.0, -80.0], "high_m": [60.0, 70.0], "bag": ""}
    return Site.around([{"name": "a", "map": {"name": "Blocks", "seed": 0}, **extent}], "Blocks")


@pytest.fixture(scope="module")
def layers(network: RoadNetwork, site: Site) -> Layers:
    layers: Layers = json.loads(json.dumps(map_expansion(network, site)))
    return layers


def positions_m(layers: Layers, site: Site, nodes: list[str]) -> Float64Array:
    """(N, 2) positions of nodes in the map frame."""
    known = {node["token"]: (node["x"], node["y"]) for node in layers["node"]}
    return np.array([known[node] for node in nodes]) + site.low_m


def polygon(layers: Layers, site: Site, token: str) -> shapely.Polygon:
    record = next(each for each in layers["polygon"] if each["token"] == token)
    holes = [positions_m(layers, site, hole["node_tokens"]) for hole in record["holes"]]
    return shapely.Polygon(positions_m(layers, site, record["exterior_node_tokens"]), holes)


def polygons(layers: Layers, site: Site, layer: str) -> list[shapely.Polygon]:
    tokens = [
        token for record in layers[layer] for token in record.get("polygon_tokens", [record.get("polygon_token")])
    ]
    return [polygon(layers, site, token) for token in tokens]


def walked(path: list[dict[str, Any]]) -> Float64Array:
    """(N, 2) positions along an arcline path, integrated numerically from the curvature of its segments."""
    points_m = []
    for record in path:
        (x_m, y_m, yaw_rad), signs = record["start_pose"], {"L": 1, "S": 0, "R": -1}
        points_m.append((x_m, y_m))
        for shape, length_m in zip(record["shape"], record["segment_length"], strict=True):
            steps = 200 if length_m else 0
            for _ in range(steps):
                turn_rad = signs[shape] / record["radius"] * length_m / steps
                x_m += length_m / steps * np.cos(yaw_rad + turn_rad / 2)
                y_m += length_m / steps * np.sin(yaw_rad + turn_rad / 2)
                yaw_rad += turn_rad
                points_m.append((x_m, y_m))
        np.testing.assert_allclose([x_m, y_m], record["end_pose"][:2], atol=1e-3)
        assert np.cos(yaw_rad - record["end_pose"][2]) == pytest.approx(1.0, abs=1e-6)
    return np.array(points_m)


def test_it_is_of_the_version_that_the_devkit_demands(layers: Layers, site: Site) -> None:
    assert layers["version"] == "1.3" and layers["origin_m"] == list(site.low_m)
    assert layers["canvas_edge"] == [site.high_m[0] - site.low_m[0], site.high_m[1] - site.low_m[1]]


def test_every_token_refers_to_something_and_is_unique(layers: Layers) -> None:
    tables = {name: records for name, records in layers.items() if isinstance(records, list) and records}
    known = {
        name: {record["token"] for record in records if isinstance(record, dict)} for name, records in tables.items()
    }
    for name in ("node", "line", "polygon", "lane", "lane_connector", "road_block", "road_segment", "stop_line"):
        assert len(known[name]) == len(tables[name]) > 0, name
    aliases = {"from_edge_line": "line", "to_edge_line": "line", "from_road_block": "road_block"}
    aliases |= {"exterior_node": "node"}
    seen = 0

    def check(value: Any, key: str) -> None:
        nonlocal seen
        if isinstance(value, dict):
            for inner, each in value.items():
                check(each, inner)
        elif isinstance(value, list):
            for each in value:
                check(each, key)
        elif isinstance(value, str) and key.endswith(("_token", "_tokens")):
            table = key.removesuffix("s").removesuffix("_token")
            assert value in known[aliases.get(table, table)], key
            seen += 1

    for name, records in tables.items():
        check(records, name)
    assert seen > 5000
    lanes = known["lane"] | known["lane_connector"]
    assert set(layers["connectivity"]) == set(layers["arcline_path_3"]) == lanes


def test_drivable_areas_are_our_roads_and_walkways_our_sidewalks(
    layers: Layers, network: RoadNetwork, site: Site
) -> None:
    inside = shapely.box(*site.low_m, *site.high_m)
    surfaces = surfaces_of(network.layout)
    for layer, surface in (("drivable_area", surfaces.road), ("walkway", surfaces.sidewalk)):
        expected = shapely.intersection(surface, inside)
        found = shapely.union_all(polygons(layers, site, layer))
        assert shapely.symmetric_difference(expected, found).area < 1e-4 * expected.area and expected.area > 1000
    drivable = shapely.union_all(polygons(layers, site, "drivable_area"))
    waypoints = network.waypoints(2.0).position_m[:, :2]
    waypoints = waypoints[shapely.contains(inside, shapely.points(waypoints))]
    assert len(waypoints) > 500 and shapely.contains(drivable, shapely.points(waypoints)).all()


def test_road_segments_divide_the_drivable_area_into_intersections_and_stretches(
    layers: Layers, network: RoadNetwork, site: Site
) -> None:
    shapes = np.array(polygons(layers, site, "road_segment"))
    drivable = shapely.union_all(polygons(layers, site, "drivable_area"))
    assert shapely.union_all(shapes).area == pytest.approx(drivable.area, rel=1e-4)
    assert shapely.area(shapes).sum() == pytest.approx(drivable.area, rel=1e-4), "none overlaps another"
    inside = shapely.box(*site.low_m, *site.high_m)
    for strip in network.layout.strips_of(LaneKind.DRIVING):
        middle = shapely.Point(strip.center_m[len(strip.center_m) // 2][:2])
        if inside.contains(middle):
            (row,) = np.flatnonzero(shapely.dwithin(shapes, middle, 1e-6))[:1]
            assert layers["road_segment"][row]["is_intersection"] == bool(strip.junction), strip.id


def test_lanes_have_the_shape_and_paint_of_the_map(layers: Layers, network: RoadNetwork, site: Site) -> None:
    strips = {strip.id: strip for strip in network.layout.strips_of(LaneKind.DRIVING)}
    known = {record["simbev_id"]: record for record in layers["lane"] + layers["lane_connector"]}
    inside = shapely.box(*site.low_m, *site.high_m)
    expected = {name for name, strip in strips.items() if shapely.LineString(strip.center_m[:, :2]).intersects(inside)}
    assert expected <= set(known) <= set(strips) and 50 < len(known) < len(strips)
    lines = {line["token"]: line["node_tokens"] for line in layers["line"]}
    for record in layers["lane"]:
        strip = strips[record["simbev_id"]]
        area = polygon(layers, site, record["polygon_token"])
        assert area.is_valid and area.buffer(0.01).contains(shapely.LineString(strip.center_m[:, :2]))
        ends = positions_m(layers, site, lines[record["to_edge_line_token"]])
        np.testing.assert_allclose(ends, [strip.left_m[-1, :2], strip.right_m[-1, :2]], atol=1e-3)
        kinds = {segment["segment_type"] for segment in record["left_lane_divider_segments"]}
        assert kinds == {divider_type(strip.left_line.paint, strip.left_line.color)}


def test_paths_follow_center_lines_and_links_lead_on(layers: Layers, network: RoadNetwork, site: Site) -> None:
    strips = {strip.id: strip for strip in network.layout.strips_of(LaneKind.DRIVING)}
    ends_m = {}
    for record in layers["lane"] + layers["lane_connector"]:
        path = layers["arcline_path_3"][record["token"]]
        points_m = walked(path) + site.low_m
        center = shapely.LineString(strips[record["simbev_id"]].center_m[:, :2])
        assert shapely.hausdorff_distance(shapely.LineString(points_m), center.segmentize(0.5)) < PATH_M
        for one, following in pairwise(path):
            np.testing.assert_allclose(one["end_pose"], following["start_pose"], atol=1e-6)
        ends_m[record["token"]] = points_m[[0, -1]]
    links = layers["connectivity"]
    outgoing = [(token, other) for token, found in links.items() for other in found["outgoing"]]
    incoming = [(other, token) for token, found in links.items() for other in found["incoming"]]
    assert sorted(incoming) == sorted(outgoing)
    assert len(outgoing) > 100
    for token, other in outgoing:
        np.testing.assert_allclose(ends_m[token][1], ends_m[other][0], atol=0.01)


def test_lights_face_the_lanes_that_they_stop(layers: Layers, network: RoadNetwork, site: Site) -> None:
    lights = {record["token"]: record for record in layers["traffic_light"]}
    lines = {line["token"]: line["node_tokens"] for line in layers["line"]}
    stops = [record for record in layers["stop_line"] if record["stop_line_type"] == "TRAFFIC_LIGHT"]
    assert len(stops) > 3 and len(lights) > 5
    blocks = {record["token"]: record for record in layers["road_block"]}
    for stop in stops:
        bar = polygon(layers, site, stop["polygon_token"])
        edges = [blocks[stop["road_block_token"]][f"{end}_edge_line_token"] for end in ("from", "to")]
        start_m, end_m = (positions_m(layers, site, lines[edge]).mean(axis=0) for edge in edges)
        assert bar.distance(shapely.Point(end_m)) < bar.distance(shapely.Point(start_m)), "at the end of the block"
        for token in stop["traffic_light_tokens"]:
            light = lights[token]
            signal = network.signals[light["signal_id"] - 1]
            pose_m = np.add([light["pose"]["tx"], light["pose"]["ty"]], site.low_m)
            np.testing.assert_allclose(pose_m, signal.position_m[:2], atol=1e-3)
            foot_m, tip_m = positions_m(layers, site, lines[light["line_token"]])
            assert (tip_m - foot_m) @ (np.array(bar.centroid.coords[0]) - foot_m) > 0, "lamps shine to the stop line"
            assert light["from_road_block_token"] == stop["road_block_token"]


def test_lamps_are_where_our_heads_have_them() -> None:
    spacing_m = signal_poles._LAMP_SPACING_M
    assert dict(traffic_control._LAMPS) == {"RED": spacing_m, "YELLOW": 0.0, "GREEN": -spacing_m}


def test_every_paint_has_a_type_of_divider() -> None:
    kinds = {divider_type(paint, color) for paint in Paint for color in PaintColor}
    assert kinds == {"NIL", "DOUBLE_DASHED_WHITE", "DOUBLE_SOLID_WHITE", "SINGLE_SOLID_WHITE", "SINGLE_SOLID_YELLOW"}
    assert divider_type(Paint.SOLID_SOLID, PaintColor.YELLOW) == "SINGLE_SOLID_YELLOW"
    assert divider_type(Paint.CURB, PaintColor.WHITE) == divider_type(Paint.NONE, PaintColor.YELLOW) == "NIL"


def test_a_straight_line_is_one_straight_path_and_an_arc_has_its_radius() -> None:
    for record in arcline_path(np.array([[1.0, 2.0, 0.0], [1.0, 52.0, 0.0]])):
        assert record["segment_length"][0] == record["segment_length"][2] == 0 and record["start_pose"][2] > 1.57
    angle_rad = np.linspace(0, np.pi / 2, 60)
    path = arcline_path(np.stack([30 * np.sin(angle_rad), 30 * np.cos(angle_rad)], axis=1))  # to the right
    assert len(path) <= 4 and {record["shape"] for record in path} == {"RSR"}
    assert sum(sum(record["segment_length"]) for record in path) == pytest.approx(30 * np.pi / 2, abs=0.05)
    assert [record["radius"] for record in path] == pytest.approx([30] * len(path), rel=0.02)


@pytest.mark.slow
def test_the_export_writes_it_once_for_each_extent(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000")
    export(tmp_path / "set", tmp_path / "none", map_expansion=False)
    assert not (tmp_path / "none/maps/expansion").exists()
    export(tmp_path / "set", tmp_path / "out")
    file = tmp_path / "out/maps/expansion/Blocks.json"
    assert json.loads(file.read_text())["origin_m"] == tables_of(tmp_path / "out")["map"][0]["origin_m"]
    before = file.stat().st_mtime_ns
    export(tmp_path / "set", tmp_path / "out")
    assert file.stat().st_mtime_ns == before
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0001", number=1, ticks=40)
    export(tmp_path / "set", tmp_path / "out")
    content = json.loads(file.read_text())
    assert content["origin_m"] == tables_of(tmp_path / "out")["map"][0]["origin_m"]
    assert file.stat().st_mtime_ns != before, "the ego came farther, so the site has grown"
