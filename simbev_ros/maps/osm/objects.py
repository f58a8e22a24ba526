"""Reads what stands beside the roads of an OpenStreetMap file: trees, furniture, barriers, rails and power lines."""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache

import numpy as np
import shapely
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.foundation.files.limits import MAX_MAP_OBJECTS, MAX_OBJECT_LINES_KM
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Finding
from simbev_ros.maps.land_features import BARRIER_KINDS, MapObject, ObjectKind
from simbev_ros.maps.osm.areas import Area
from simbev_ros.maps.osm.data import OsmData, Tags, Way
from simbev_ros.maps.osm.lengths import parse_direction_rad, parse_length_m

_MAX_HEIGHT_M = 60.0
_POST_CORNERS = 8


class PostRule(Model):
    """Size of a kind of post."""

    diameter_m: float = Field(gt=0)
    height_m: float = Field(gt=0)


class ObjectRules(Model):
    """The content of object_rules.yaml, which documents each entry."""

    points: Mapping[str, ObjectKind]
    required: Mapping[str, Mapping[str, tuple[str, ...]]]
    excluded: Mapping[str, tuple[str, ...]]
    posts: Mapping[str, PostRule]
    calming: Mapping[str, tuple[float, float]]
    lines: Mapping[str, ObjectKind]
    parking: Mapping[str, ObjectKind]
    parking_on_ground: tuple[str, ...]
    trees: Mapping[str, ObjectKind]
    tree_row_spacing_m: float = Field(gt=0)


@lru_cache(maxsize=1)
def object_rules() -> ObjectRules:
    """Load the rule table."""
    return ObjectRules.model_validate(load_table("simbev_ros.maps.osm", "object_rules.yaml"))


def objects_of(
    data: OsmData, xy_m: Float64Array, areas: Sequence[Area], extent: shapely.Polygon
) -> tuple[tuple[MapObject, ...], tuple[Finding, ...]]:
    """The objects of a file within an extent, and findings about what was left out.

    Args:
        data: The file.
        xy_m: (N, 2) positions of its nodes, map frame.
        areas: Its areas within the extent.
        extent: A rectangle along the axes of the map frame.
    """
    lines = [way for way in data.ways if _line_kind(way.tags) is not None]
    in_lines = {node for way in lines for node in way.nodes}
    found: list[MapObject] = []
    tagged = np.array(list(data.node_tags), np.int64)
    for node in tagged[shapely.contains_xy(extent, xy_m[tagged])].tolist():
        found += _at_point(xy_m[node], data.node_tags[node], node in in_lines)
    bare, length_m, longer = 0, 0.0, 0
    for way in lines:
        if not _is_on_ground(way.tags):
            bare += _line_kind(way.tags) is ObjectKind.RAILS
            continue
        length_m += float(np.hypot(*np.diff(xy_m[list(way.nodes)], axis=0).T).sum())
        if length_m > MAX_OBJECT_LINES_KM * 1000.0:
            longer += 1
            continue
        found += _along_way(data, way, xy_m, extent)
    for area in areas:
        found += _parking(area)
    counts = (
        ("a railway on a bridge or in a tunnel is left out", bare),
        (f"a line of objects beyond the first {MAX_OBJECT_LINES_KM} km is left out", longer),
        (f"an object beyond the first {MAX_MAP_OBJECTS} is left out", max(0, len(found) - MAX_MAP_OBJECTS)),
    )
    return tuple(found[:MAX_MAP_OBJECTS]), tuple(Finding(rule, count=count) for rule, count in counts if count)


def _at_point(xy_m: Float64Array, tags: Tags, in_line: bool) -> Iterator[MapObject]:
    """The object at a node, if there is one."""
    rules = object_rules()
    if any(tags.get(key) in values for key, values in rules.excluded.items()):
        return
    foot_m = np.array([[*xy_m, 0.0]])
    height_m = _height_m(tags)
    for key, post in rules.posts.items():
        if _has(tags, key):
            turn_rad = np.arange(_POST_CORNERS + 1) % _POST_CORNERS * (2.0 * np.pi / _POST_CORNERS)
            around_m = post.diameter_m / 2.0 * np.column_stack([np.cos(turn_rad), np.sin(turn_rad), 0.0 * turn_rad])
            yield MapObject(ObjectKind.POLE, foot_m + around_m, height_m or post.height_m)
            return
    for key, kind in rules.points.items():
        needs = rules.required.get(key, {})
        if _has(tags, key) and all(tags.get(name) in values for name, values in needs.items()):
            if kind is ObjectKind.UTILITY_POLE and in_line:
                return  # the line has poles at its nodes
            known = rules.trees.get(tags.get("leaf_type", ""), kind) if kind is ObjectKind.TREE else kind
            yield MapObject(known, foot_m, height_m, yaw_rad=parse_direction_rad(tags.get("direction", "")))
            return


def _along_way(data: OsmData, way: Way, xy_m: Float64Array, extent: shapely.Polygon) -> Iterator[MapObject]:
    """The objects along a way."""
    kind = _line_kind(way.tags)
    line = shapely.LineString(xy_m[list(way.nodes)])
    if kind is None or not line.intersects(extent):
        return
    height_m = _height_m(way.tags)
    if kind is ObjectKind.TREE:
        if any(data.node_tags.get(node, {}).get("natural") == "tree" for node in way.nodes):
            return
        rules = object_rules()
        stations_m = np.arange(0.0, line.length, rules.tree_row_spacing_m)
        for foot_m in shapely.get_coordinates(shapely.line_interpolate_point(line, stations_m)):
            yield MapObject(rules.trees.get(way.tags.get("leaf_type", ""), kind), _on_ground(foot_m[None]), height_m)
    elif way.closed and way.tags.get("area") == "yes" and kind in BARRIER_KINDS:
        yield MapObject(kind, _on_ground(shapely.get_coordinates(line)), height_m)
    else:
        points_m = _on_ground(shapely.get_coordinates(line))
        half = len(points_m) // 2 if way.closed else len(points_m) - 1  # a closed line would be an outline
        yield MapObject(kind, points_m[: half + 1], height_m)
        if way.closed:
            yield MapObject(kind, points_m[half:], height_m)


def _parking(area: Area) -> Iterator[MapObject]:
    """The parking lot or space on an area, if there is one on the ground."""
    kind = object_rules().parking.get(area.tags.get("amenity", ""))
    if kind is not None and area.tags.get("parking", "surface") in object_rules().parking_on_ground:
        yield MapObject(kind, _on_ground(shapely.get_coordinates(area.polygon.exterior)))


def _line_kind(tags: Tags) -> ObjectKind | None:
    """Kind of the objects along a way, if there are any."""
    return next((kind for key, kind in object_rules().lines.items() if _has(tags, key)), None)


def _is_on_ground(tags: Tags) -> bool:
    return all(tags.get(key, "no") == "no" for key in ("bridge", "tunnel", "covered", "indoor")) and not tags.get(
        "layer", "0"
    ).startswith("-")


def _has(tags: Tags, key_value: str) -> bool:
    key, _, value = key_value.rpartition("=")
    return tags.get(key) == value


def _height_m(tags: Tags) -> float:
    return min(parse_length_m(tags.get("height", "")), _MAX_HEIGHT_M)


def _on_ground(xy_m: Float64Array) -> Float64Array:
    """(N, 3) points on the ground."""
    return np.column_stack([xy_m, np.zeros(len(xy_m))])
