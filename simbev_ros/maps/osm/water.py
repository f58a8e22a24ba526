"""Builds the rivers, lakes and ponds of an OpenStreetMap file, from areas and from lines that no area covers."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.maps.land_features import Water
from simbev_ros.maps.osm.areas import Area, polygons
from simbev_ros.maps.osm.data import OsmData, Tags, Way
from simbev_ros.maps.osm.land_rules import land_rules
from simbev_ros.maps.osm.lengths import parse_length_m

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
    basins = [(area.polygon, kind) for area in areas if (kind := _kind_of_area(area.tags)) is not None]
    streams = [(_band(xy_m[list(way.nodes)], way.tags), way.tags["waterway"]) for way in data.ways if _is_stream(way)]
    shapes, kinds = zip(*basins, *streams, strict=True) if basins or streams else ((), ())
    inland = _inland(np.array(shapes, object), extent, sea)
    whole = shapely.STRtree(inland)
    culverts = shapely.STRtree(road_bands)
    found = list(_parts(sea, culverts, rules["sea"].depth_m))
    for index, (area, kind) in enumerate(zip(inland, kinds, strict=True)):
        if index >= len(basins):  # a stream is drawn where no water is yet
            earlier = whole.query(area, predicate="intersects")
            covered = inland[np.sort(earlier[earlier < index])]
            area = overlay.difference(area, overlay.union_all(covered))
        found += _parts(area, culverts, rules[kind].depth_m)
    return tuple(found)


def _is_stream(way: Way) -> bool:
    rule = land_rules().water.get(way.tags.get("waterway", ""))
    return rule is not None and rule.width_m > 0.0 and way.tags.get("tunnel", "no") == "no"


def _band(line_m: Float64Array, tags: Tags) -> BaseGeometry:
    width_m = parse_length_m(tags.get("width", "")) or land_rules().water[tags["waterway"]].width_m
    return shapely.buffer(shapely.LineString(line_m), width_m / 2.0, cap_style="flat")


def _inland(areas: AnyArray, extent: BaseGeometry, sea: BaseGeometry) -> AnyArray:
    """(N,) parts of areas that are within the extent and outside the sea."""
    parts = np.asarray(overlay.intersection(areas, extent))
    shapely.prepare(sea)
    salty = shapely.intersects(sea, parts)
    parts[salty] = overlay.difference(parts[salty], sea)
    return parts


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
