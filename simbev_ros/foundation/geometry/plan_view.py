"""Directions and areas in plan view."""

from collections.abc import Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.types import AnyArray, Float64Array, Int64Array


def left_of(direction: AnyArray) -> AnyArray:
    """(…, 2) vectors to the left of (…, 2+) directions and of the same length, in plan view and of the same dtype."""
    return np.stack([-direction[..., 1], direction[..., 0]], axis=-1)


def polygon_parts(area: BaseGeometry) -> AnyArray:
    """(K,) polygons of an area, without the points and lines in which areas touch that do not overlap."""
    parts = shapely.get_parts(shapely.get_parts(area))  # a difference or make_valid may nest them
    return parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON]


def multi_polygon(area: BaseGeometry) -> shapely.MultiPolygon:
    """The ``polygon_parts`` of an area as one geometry."""
    return shapely.MultiPolygon(polygon_parts(area).tolist())


def indexed_polygon_parts(areas: AnyArray) -> tuple[AnyArray, Int64Array]:
    """(K,) polygons of (N,) areas, without points and lines, in order, and the (K,) index of each one's area."""
    parts, area = shapely.get_parts(areas, return_index=True)
    parts, part = shapely.get_parts(parts, return_index=True)
    kept = shapely.get_type_id(parts) == shapely.GeometryType.POLYGON
    return parts[kept], area[part[kept]]


def points_inside(areas: Sequence[BaseGeometry], xy_m: Float64Array) -> list[Int64Array]:
    """For each area the ascending indices of those of (N, 2) points that lie inside it, not on its border.

    The time grows with the number of points near each area, not with the product of both numbers.
    """
    points = np.asarray(shapely.points(xy_m), object)
    area, point = shapely.STRtree(points).query(np.asarray(areas, object), predicate="contains")
    order = np.lexsort([point, area])
    return np.split(point[order], np.searchsorted(area[order], np.arange(1, len(areas)))) if len(areas) else []
