"""Builds the sea of an OpenStreetMap file from its coastline: lines with the land on their left."""

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.maps.findings import Finding
from simbev_ros.maps.osm.data import OsmData

_PROBE_M = 0.05
_MAX_FLOODED_SHARE = 0.2


def sea_of(
    data: OsmData, xy_m: Float64Array, extent: shapely.Polygon, streets: AnyArray
) -> tuple[BaseGeometry, tuple[Finding, ...]]:
    """The area of the sea within an extent, and findings about what was left out.

    A coastline that ends inside the extent, as in a clipped file, continues straight to the nearest side of the extent.

    Args:
        data: The file.
        xy_m: (N, 2) positions of its nodes, map frame.
        extent: A rectangle along the axes of the map frame.
        streets: (R,) lines of the roads on the ground. A sea that floods more than a fifth of their length is left out:
            its coastline is reversed or has a gap.
    """
    ways = [xy_m[list(way.nodes)] for way in data.ways if way.tags.get("natural") == "coastline"]
    lines = [line for line in map(shapely.LineString, ways) if line.intersects(extent)]
    if not lines:
        return shapely.Polygon(), ()
    coast = shapely.get_parts(shapely.line_merge(shapely.MultiLineString(lines), directed=True))
    borders = [*coast, *_extensions(coast, extent), extent.boundary]
    faces = shapely.get_parts(shapely.polygonize([overlay.intersection(overlay.union_all(borders), extent)]))
    wet = faces[_water_length_m(faces, coast) > 0.0]
    sea = overlay.union_all(wet)
    flooded_m = shapely.length(overlay.intersection(shapely.multilinestrings(streets), sea))
    if flooded_m > _MAX_FLOODED_SHARE * float(shapely.length(streets).sum()):
        return shapely.Polygon(), (Finding("the sea is left out: its coastline would flood roads: reversed, or a gap"),)
    return sea, ()


def _extensions(coast: AnyArray, extent: shapely.Polygon) -> list[shapely.LineString]:
    """Lines from the ends of a coastline inside the extent to the nearest side of the extent."""
    x0, y0, x1, y1 = extent.bounds
    found = []
    for line in coast:
        ends = shapely.get_coordinates(line)[[0, -1]]
        if np.array_equal(*ends):
            continue
        for x, y in ends.tolist():
            if x0 < x < x1 and y0 < y < y1:
                sides = ((x - x0, (x0, y)), (x1 - x, (x1, y)), (y - y0, (x, y0)), (y1 - y, (x, y1)))
                found.append(shapely.LineString([(x, y), min(sides)[1]]))
    return found


def _water_length_m(faces: AnyArray, coast: AnyArray) -> Float64Array:
    """(F,) length of coastline with its water in each face, less the length with its land there."""
    steps = [np.stack([line[:-1], line[1:]], axis=1) for line in map(shapely.get_coordinates, coast)]
    segments_m = np.concatenate(steps)
    along = segments_m[:, 1] - segments_m[:, 0]
    length_m = np.hypot(along[:, 0], along[:, 1])
    right = np.column_stack([along[:, 1], -along[:, 0]]) / np.maximum(length_m, 1e-9)[:, None]
    tree, votes_m = shapely.STRtree(faces), np.zeros(len(faces))
    for side in (1.0, -1.0):
        probes = shapely.points(segments_m.mean(axis=1) + side * _PROBE_M * right)
        segment, face = tree.query(probes, predicate="within")
        np.add.at(votes_m, face, side * length_m[segment])
    return votes_m
