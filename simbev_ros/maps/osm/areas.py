"""Converts closed ways and multipolygons of an OpenStreetMap file to valid polygons in the map frame."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.osm.data import Multipolygon, OsmData, Tags, Way

_GRID_M = 0.001


class Area(NamedTuple):
    """A polygon with the tags of its way or relation."""

    polygon: shapely.Polygon
    tags: Tags


def areas_of(data: OsmData, xy_m: Float64Array) -> list[Area]:
    """All tagged areas, in the order of the file; an area of several parts yields several polygons.

    Args:
        data: The file.
        xy_m: (N, 2) positions of its nodes, map frame.
    """
    areas = []
    for way in data.ways:
        if way.closed and way.tags:
            areas += [Area(part, way.tags) for part in polygons(shapely.Polygon(xy_m[list(way.nodes)]))]
    for relation in data.multipolygons:
        areas += [Area(part, relation.tags) for part in polygons(_assemble(relation, xy_m))]
    return areas


def polygons(area: BaseGeometry) -> Iterator[shapely.Polygon]:
    """The valid two-dimensional parts of any geometry, on a millimeter grid."""
    for part in shapely.get_parts(shapely.set_precision(shapely.make_valid(area), _GRID_M)):
        if shapely.get_dimensions(part) == 2 and part.area > 0.0:
            yield from part.geoms if isinstance(part, shapely.MultiPolygon) else (part,)


def _assemble(relation: Multipolygon, xy_m: Float64Array) -> BaseGeometry:
    """The area inside the outer outlines and outside the inner ones."""
    return overlay.difference(_fill(relation.outer, xy_m), _fill(relation.inner, xy_m))


def _fill(ways: Iterable[Way], xy_m: Float64Array) -> BaseGeometry:
    lines = overlay.union_all([shapely.LineString(xy_m[list(way.nodes)]) for way in ways])
    return shapely.make_valid(overlay.union_all(list(shapely.polygonize([lines]).geoms)))
