"""Builds the rivers, lakes and ponds of an OpenStreetMap file, from areas and from lines that no area covers."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.geometry import overlay
from simbev_ros.maps.land_features import Water
from simbev_ros.maps.osm.areas import Area, polygons
from simbev_ros.maps.osm.data import OsmData, Tags
from simbev_ros.maps.osm.land_rules import land_rules
from simbev_ros.maps.osm.lengths import parse_length_m
from simbev_ros.types import AnyArray, Float64Array

_MIN_AREA_M2 = 6.0


def water_of(
    data: OsmData,
    xy_m: Float64Array,
    areas: Sequence[Area],
    sea: BaseGeometry,
    extent: BaseGeometry,
    road_bands: AnyArray,
) -> tuple[Water, ...]:
    """The water of a file.

    Args:
        data: The file.
        xy_m: (N, 2) positions of its nodes, map frame.
        areas: Its areas.
        sea: Area of the sea.
        extent: Inland water outside it is left out.
        road_bands: (R,) polygons that roads other than bridges occupy; water passes below them in culverts.
    """
    rules = land_rules().water
    culverts = shapely.STRtree(road_bands)
    found = list(_parts(sea, culverts, rules["sea"].depth_m))
    inland = overlay.difference(extent, sea)
    for area in areas:
        kind = _kind_of_area(area.tags)
        if kind is not None:
            found += _parts(overlay.intersection(area.polygon, inland), culverts, rules[kind].depth_m)
    covered = overlay.union_all([water.area for water in found])
    for way in data.ways:
        kind = way.tags.get("waterway", "")
        if kind in rules and rules[kind].width_m > 0.0 and way.tags.get("tunnel", "no") == "no":
            width_m = parse_length_m(way.tags.get("width", "")) or rules[kind].width_m
            band = shapely.buffer(shapely.LineString(xy_m[list(way.nodes)]), width_m / 2.0, cap_style="flat")
            open_band = overlay.difference(overlay.intersection(band, inland), covered)
            found += _parts(open_band, culverts, rules[kind].depth_m)
            covered = overlay.union(covered, band)
    return tuple(found)


def _kind_of_area(tags: Tags) -> str | None:
    if tags.get("natural") == "water" or tags.get("landuse") in ("reservoir", "basin"):
        kind = tags.get("water", "lake")
        return kind if kind in land_rules().water else "lake"
    return "river" if tags.get("waterway") == "riverbank" else None


def _parts(area: BaseGeometry, culverts: shapely.STRtree, depth_m: float) -> Iterator[Water]:
    """The open water of an area."""
    roads = culverts.geometries[np.sort(culverts.query(area, predicate="intersects"))]
    open_water = overlay.difference(area, overlay.union_all(roads))
    return (Water(part, -depth_m) for part in polygons(open_water) if part.area > _MIN_AREA_M2)
