"""Painted lines and road edges as lines, compared with the painted areas and the paved surface."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from road_strips import layout_of_strips, level_ground, straight

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Line, Paint
from simbev_ros.maps.roads.line_paths import line_paths
from simbev_ros.maps.roads.markings import MarkingKind, lane_markings
from simbev_ros.maps.roads.road_edges import road_edges
from simbev_ros.maps.roads.surface import surfaces_of

_LINES = (MarkingKind.LANE, MarkingKind.EDGE, MarkingKind.CENTER)


def test_all_paint_lies_on_the_line_paths_and_solid_lines_are_fully_painted(blocks: RoadNetwork) -> None:
    for level in blocks.layout.levels:
        paths = list(line_paths(blocks.layout, level))
        paint = shapely.union_all([m.polygon for m in lane_markings(blocks.layout, level) if m.kind in _LINES])
        lines = [shapely.LineString(path.along_m[:, :2]) for path in paths]
        reach_m = [1.5 * path.width_m if " " in path.paint else 0.5 * path.width_m for path in paths]
        around = shapely.union_all(shapely.buffer(lines, np.array(reach_m) + 0.01, cap_style="square"))
        assert shapely.difference(paint, around).area < 1e-3 * paint.area
        solid = shapely.union_all([line for line, path in zip(lines, paths, strict=True) if "solid" in path.paint])
        assert shapely.difference(solid, shapely.buffer(paint, 0.2)).length < 1e-2 * solid.length
        crossing = [crosswalk.outline_m[:, :2] for crosswalk in blocks.layout.crosswalks if crosswalk.level == level]
        for outline_m in crossing:
            assert shapely.intersection(shapely.union_all(lines), shapely.Polygon(outline_m)).length < 1e-6


def test_lines_between_lanes_of_a_junction_separate_them_without_links_between_the_lanes() -> None:
    painted = Line(Paint.SOLID)
    there = replace(straight("there", (0, 0), (30, 0), level_ground), junction="j", left_line=painted)
    beside = replace(straight("beside", (0, -3.5), (30, -3.5), level_ground), junction="j", right_line=painted)
    back = replace(straight("back", (30, 3.5), (0, 3.5), level_ground), junction="j")
    across = replace(straight("across", (15, -20), (15, 20), level_ground), junction="j")
    kinds = {path.along_m[0, 1]: path.kind for path in line_paths(layout_of_strips(across, there, beside, back), 0)}
    assert kinds == {1.75: MarkingKind.CENTER, -5.25: MarkingKind.EDGE}
    same = replace(beside, left_line=painted, right_line=Line())
    (path,) = line_paths(layout_of_strips(across, replace(there, left_line=Line()), same), 0)
    assert path.kind is MarkingKind.LANE


def test_edges_are_the_borders_of_the_paved_area(blocks: RoadNetwork) -> None:
    edges = list(road_edges(blocks.layout))
    for level in blocks.layout.levels:
        surfaces = surfaces_of(blocks.layout, level)
        border = shapely.union(surfaces.road, surfaces.shoulder).boundary
        lines = shapely.MultiLineString([edge.along_m[:, :2] for edge in edges if edge.level == level])
        assert shapely.difference(lines, shapely.buffer(border, 0.06)).length < 1e-3 * lines.length
        assert shapely.difference(border, shapely.buffer(lines, 0.06)).length < 0.02 * border.length  # cracks closed
        heights_m = np.concatenate([edge.along_m for edge in edges if edge.level == level])
        assert heights_m[:, 2] == pytest.approx(blocks.elevation.height_m(heights_m[:, :2], level), abs=1e-9)


def test_paved_area_is_to_the_left_and_the_start_of_a_structure_is_not_an_edge() -> None:
    def rising(xy_m: Float64Array) -> Float64Array:
        return np.asarray(0.02 * xy_m[:, 0])

    road = straight("road", (0, 0), (60, 0), rising, width_m=6.0)
    deck = replace(straight("deck", (60, 0), (100, 0), rising, width_m=6.0), level=1)
    edges = list(road_edges(layout_of_strips(road, deck)))
    assert [edge.level for edge in edges] == [0, 1]
    for edge, ends_m in zip(edges, ((0.0, 60.0), (60.0, 100.0)), strict=True):
        middle_m = ((edge.along_m[1:] + edge.along_m[:-1]) / 2.0)[edge.real]
        assert middle_m[:, 2] == pytest.approx(0.02 * middle_m[:, 0], abs=1e-6)
        assert np.abs(middle_m[:, 0] - 60.0).min() > 1.0  # nothing along the joint
        assert {float(x) for x in ends_m if np.any(np.abs(middle_m[:, 0] - x) < 0.01)} == {ends_m[0], ends_m[1]} - {
            60.0
        }
        heading = np.diff(edge.along_m, axis=0)[edge.real]
        to_axis = np.array([50.0 if edge.level == 0 else 80.0, 0.0]) - middle_m[:, :2]
        assert (heading[:, 0] * to_axis[:, 1] - heading[:, 1] * to_axis[:, 0] > 0.0).all()


def test_an_island_is_an_edge_too() -> None:
    sides = [
        replace(straight(name, start, end, level_ground, width_m=4.0), kind=LaneKind.DRIVING)
        for name, start, end in (
            ("s", (-10, -8), (10, -8)),
            ("n", (10, 8), (-10, 8)),
            ("w", (-8, 10), (-8, -10)),
            ("e", (8, -10), (8, 10)),
        )
    ]
    outer, island = road_edges(layout_of_strips(*sides))
    assert shapely.Polygon(outer.along_m[:, :2]).area == pytest.approx(400.0, abs=0.1)
    assert shapely.Polygon(island.along_m[:, :2]).area == pytest.approx(144.0, abs=0.1)
    assert shapely.LinearRing(outer.along_m[:, :2]).is_ccw and not shapely.LinearRing(island.along_m[:, :2]).is_ccw
