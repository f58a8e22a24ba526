"""Rivers, lakes and ponds: areas, and lines with a width where no area covers them."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.maps.land_features import Water
from simbev_ros.maps.osm.areas import Area, polygons
from simbev_ros.maps.osm.data import OsmData, Tags, metres
from simbev_ros.maps.osm.land_rules import land_rules
from simbev_ros.types import AnyArray, Float64Array

_SMALLEST_M2 = 6.0


def water_of(
    data: OsmData, xy_m: Float64Array, areas: Sequence[Area], extent: BaseGeometry, road_bands: AnyArray
) -> tuple[Water, ...]:
    """The water of a file.

    Args:
        data: The file.
        xy_m: (N, 2) its nodes in the map frame.
        areas: Its areas.
        extent: Water beyond it is left out.
        road_bands: (R,) polygons that roads without bridges take: there water flows through culverts.
    """
    rules = land_rules().water
    culverts = shapely.STRtree(road_bands)
    found: list[Water] = []
    for area in areas:
        kind = _kind_of_area(area.tags)
        if kind is not None:
            found += _parts(area.polygon, extent, culverts, rules[kind].depth_m)
    covered = shapely.union_all([water.area for water in found])
    for way in data.ways:
        kind = way.tags.get("waterway", "")
        if kind in rules and rules[kind].width_m > 0.0 and way.tags.get("tunnel", "no") == "no":
            width_m = metres(way.tags.get("width", "")) or rules[kind].width_m
            band = shapely.buffer(shapely.LineString(xy_m[list(way.nodes)]), width_m / 2.0, cap_style="flat")
            found += _parts(shapely.difference(band, covered), extent, culverts, rules[kind].depth_m)
            covered = shapely.union(covered, band)
    return tuple(found)


def _kind_of_area(tags: Tags) -> str | None:
    if tags.get("natural") == "water" or tags.get("landuse") in ("reservoir", "basin"):
        kind = tags.get("water", "lake")
        return kind if kind in land_rules().water else "lake"
    return "river" if tags.get("waterway") == "riverbank" else None


def _parts(area: BaseGeometry, extent: BaseGeometry, culverts: shapely.STRtree, depth_m: float) -> Iterator[Water]:
    """The open water of an area."""
    roads = culverts.geometries[np.sort(culverts.query(area, predicate="intersects"))]
    open_water = shapely.difference(shapely.intersection(area, extent), shapely.union_all(roads))
    return (Water(part, -depth_m) for part in polygons(open_water) if part.area > _SMALLEST_M2)
