"""Directions and areas in plan view."""

import numpy as np
import shapely

from simbev_ros.foundation.geometry.plan_view import (
    indexed_polygon_parts,
    left_of,
    multi_polygon,
    points_inside,
    polygon_parts,
)

MIXED = shapely.GeometryCollection(
    [
        shapely.LineString([(0, 0), (1, 0)]),
        shapely.MultiPolygon([shapely.box(0, 0, 1, 1), shapely.box(2, 0, 3, 1)]),
        shapely.Point(5, 5),
    ]
)


def test_left_of_east_is_north_and_left_of_north_is_west() -> None:
    assert left_of(np.array([[2.0, 0.0, 9.0], [0.0, 3.0, 9.0]])).tolist() == [[0.0, 2.0], [-3.0, 0.0]]
    assert left_of(np.array([1.0, 0.0], np.float32)).dtype == np.float32


def test_only_polygons_are_kept_even_if_they_are_nested() -> None:
    assert [part.bounds for part in polygon_parts(MIXED)] == [(0, 0, 1, 1), (2, 0, 3, 1)]
    assert multi_polygon(MIXED).area == 2.0
    assert multi_polygon(shapely.Point(0, 0)).is_empty


def test_each_part_knows_its_area() -> None:
    parts, area = indexed_polygon_parts(np.array([shapely.box(4, 4, 5, 5), shapely.Point(0, 0), MIXED], object))
    assert area.tolist() == [0, 2, 2]
    assert [part.bounds[0] for part in parts] == [4, 0, 2]


def test_points_inside_areas_are_those_that_each_area_contains() -> None:
    rng = np.random.default_rng(3)
    corners_m = rng.uniform(0.0, 80.0, (40, 2))
    areas = [shapely.box(x, y, x + 15.0, y + 15.0) for x, y in corners_m] + [shapely.Polygon()]
    xy_m = np.concatenate([rng.uniform(0.0, 100.0, (500, 2)), corners_m])  # the corners are on borders
    found = points_inside(areas, xy_m)
    assert [each.tolist() for each in found] == [np.flatnonzero(shapely.contains_xy(a, xy_m)).tolist() for a in areas]
    assert points_inside([], xy_m) == []
