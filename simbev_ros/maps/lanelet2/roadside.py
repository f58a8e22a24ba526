"""Positions traffic lights, signs and stop lines of a Lanelet2 map."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import shapely
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import SpeedBump
from simbev_ros.maps.lane_graph.lane_key import LaneKey
from simbev_ros.maps.lanelet2.document import LaneletMap, Linestring
from simbev_ros.maps.lanelet2.rules import Rule
from simbev_ros.maps.lanelet2.shapes import LaneletShape, resampled_m
from simbev_ros.maps.lanelet2.tags import parse_speed_mps
from simbev_ros.maps.lanelet2.topology import Topology
from simbev_ros.maps.osm.data import Tags
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS
from simbev_ros.maps.roads.layout import Sign, SignalPlace, SignKind, StopLine, Strip
from simbev_ros.maps.roads.surface import strip_polygons

LaneIds = Mapping[LaneKey, Sequence[str]]

_CURB_TO_POST_M = 0.6
_NEAR_M = 40.0
_HEAD_HEIGHT_M = 1.0
_MIN_HEAD_ABOVE_GROUND_M = 2.0
_DEFAULT_HEAD_ABOVE_GROUND_M = 3.0
_SAME_LEVEL_M = 3.0
_MAX_TURN_RAD = np.radians(75.0)
_DISTANCE_TO_END_M = 0.5
_MARGIN_M = 0.25
_SAME_STOP_LINE_M = 12.0
_MIN_STOP_LINE_M = 1.0
_BUMP_HEIGHTS_M, _BUMP_SPEEDS_KMH = (0.05, 0.30), (10.0, 5.0)


class Roadside:
    """The road surface, used to find positions for posts beside it."""

    def __init__(self, strips: Sequence[Strip]) -> None:
        self._strips = [strip for strip in strips if strip.kind in ROAD_KINDS]
        self._areas = strip_polygons(self._strips)
        self._tree = shapely.STRtree(self._areas)

    def foot_m(self, position_m: Float64Array) -> Float64Array:
        """(3,) foot of a post for something at a (3,) position, at the height of the ground there.

        It is below that, or beside the road if that is on the road.
        """
        point = shapely.Point(position_m[:2])
        around = shapely.buffer(point, _NEAR_M, cap_style="square")
        rows = self._tree.query(around, predicate="intersects").tolist()
        rows = [row for row in rows if np.abs(self._strips[row].left_m[:, 2] - position_m[2]).min() < _SAME_LEVEL_M]
        if not shapely.intersects(self._areas[rows], point).any():
            return position_m
        road = overlay.union_all(overlay.intersection(self._areas[rows], around))
        edge = shapely.boundary(shapely.buffer(road, _CURB_TO_POST_M))
        beside = shapely.get_point(shapely.shortest_line(edge, point), 0)
        return np.array([beside.x, beside.y, position_m[2]])


def signal_places(
    rules: Iterable[Rule], topology: Topology, lane_ids: LaneIds, roadside: Roadside
) -> tuple[SignalPlace, ...]:
    """Mounts of all traffic lights with a position, one for each line that is a traffic light."""
    found: dict[str, SignalPlace] = {}
    for rule, post, waiting in _posts(rules, topology, lane_ids):
        if rule.meaning != "traffic_light" or post.tags.get("type", "traffic_light") != "traffic_light":
            continue
        lanes = [lane_ids[topology.shapes[name].key][-1] for name in waiting]
        if post.id in found:
            first = found[post.id]
            found[post.id] = replace(first, lanes=tuple(dict.fromkeys((*first.lanes, *lanes))))
            continue
        bottom_m = _middle_m(post)
        ground_m = _ground_m(topology.shapes[waiting[0]], bottom_m)
        height_m = _positive(post.tags, "height", _HEAD_HEIGHT_M)
        above_m = bottom_m[2] - ground_m
        if above_m < _MIN_HEAD_ABOVE_GROUND_M:
            above_m = _DEFAULT_HEAD_ABOVE_GROUND_M
        head_m = np.array([*bottom_m[:2], ground_m + above_m + height_m / 2.0])
        foot_m = roadside.foot_m(np.array([*bottom_m[:2], ground_m]))
        yaw_rad = _facing_rad(post, topology.shapes[waiting[0]])
        found[post.id] = SignalPlace(foot_m, head_m, yaw_rad, tuple(dict.fromkeys(lanes)))
    return tuple(found.values())


def signs_of(rules: Iterable[Rule], topology: Topology, lane_ids: LaneIds, roadside: Roadside) -> tuple[Sign, ...]:
    """All traffic signs of known meaning with a position."""
    found = {}
    for rule, post, waiting in _posts(rules, topology, lane_ids):
        if rule.meaning in list(SignKind) and post.tags.get("type") == "traffic_sign":
            end = 0 if rule.meaning == SignKind.SPEED_LIMIT else -1
            lanes = tuple(dict.fromkeys(lane_ids[topology.shapes[name].key][end] for name in waiting))
            shape = topology.shapes[waiting[0]]
            middle_m = _middle_m(post)
            foot_m = roadside.foot_m(np.array([*middle_m[:2], _ground_m(shape, middle_m)]))
            found[post.id] = Sign(SignKind(rule.meaning), foot_m, _facing_rad(post, shape), lanes, rule.speed_mps)
    return tuple(found.values())


def stop_lines_of(lines: Iterable[Linestring], rules: Sequence[Rule], topology: Topology) -> tuple[StopLine, ...]:
    """Stop lines of the file, and those that rules imply at the ends of lanes without one."""
    rule_of = {line.id: rule for rule in reversed(rules) for line in rule.stop_lines}
    strict = {line.id for rule in rules if rule.meaning != SignKind.YIELD for line in rule.stop_lines}
    shapes = list(topology.shapes.values())
    tree = shapely.STRtree([shapely.LineString(shape.center_m[:, :2]) for shape in shapes])
    known = []
    for line in lines:
        if line.tags.get("type") != "stop_line":
            continue
        if line.id in rule_of and rule_of[line.id].lanelets:
            heading = _heading(topology.shapes[rule_of[line.id].lanelets[0]].center_m[-2:])
        else:
            nearest = shapes[int(tree.nearest(shapely.Point(_middle_m(line)[:2])))]
            heading = _heading(_nearest_piece_m(nearest.center_m, _middle_m(line)))
        ends_m = line.points_m[[0, -1]]
        if np.linalg.norm((ends_m[1] - ends_m[0])[:2]) > _MIN_STOP_LINE_M:
            is_right_to_left = (ends_m[1] - ends_m[0])[:2] @ np.array([-heading[1], heading[0]]) > 0.0
            yields = line.id in rule_of and line.id not in strict
            known.append(StopLine(ends_m if is_right_to_left else ends_m[::-1].copy(), yields=yields))
    return (*known, *_implied(rules, topology, known))


def speed_bumps_of(source: LaneletMap) -> Iterator[SpeedBump]:
    """Yield the speed bumps, with the speeds of Autoware's behavior_velocity_speed_bump_module, or 15 km/h."""
    outlines = [(line.points_m, line.tags) for line in source.lines.values() if line.tags.get("area") != "yes"]
    for outline_m, tags in (*outlines, *((area.outline_m, area.tags) for area in source.areas)):
        if "speed_bump" in (tags.get("type"), tags.get("subtype")):
            height_m = _positive(tags, "height", 0.0)
            speed_kmh = float(np.interp(height_m, _BUMP_HEIGHTS_M, _BUMP_SPEEDS_KMH)) if height_m else 15.0
            yield SpeedBump(outline_m, parse_speed_mps(tags.get("slow_down_speed", "")) or speed_kmh / 3.6)


def _implied(rules: Iterable[Rule], topology: Topology, known: Sequence[StopLine]) -> Iterator[StopLine]:
    """Stop lines across the ends of carriageways where a rule holds traffic up and no known line is near."""
    yields: dict[str, bool] = {}
    for rule in rules:
        for name in rule.lanelets if rule.meaning != SignKind.SPEED_LIMIT else ():
            yields[name] = yields.get(name, True) and rule.meaning == SignKind.YIELD
    known_lines = cKDTree(np.array([line.ends_m.mean(axis=0) for line in known]).reshape(-1, 3))
    for names in topology.carriageways:
        waiting = [topology.shapes[name] for name in names if name in yields]
        if not waiting:
            continue
        fraction = np.array([max(0.0, 1.0 - _DISTANCE_TO_END_M / max(waiting[0].length_m, _DISTANCE_TO_END_M))])
        right_m, left_m = resampled_m(waiting[-1].right_m, fraction)[0], resampled_m(waiting[0].left_m, fraction)[0]
        ends_m = np.stack([right_m, left_m])
        length_m = np.linalg.norm(ends_m[1] - ends_m[0])
        is_known = known_lines.query(ends_m.mean(axis=0), distance_upper_bound=_SAME_STOP_LINE_M)[0] < np.inf
        if not is_known and length_m > _MIN_STOP_LINE_M:
            margin_m = _MARGIN_M * (ends_m[1] - ends_m[0]) / length_m
            yield StopLine(ends_m + np.stack([margin_m, -margin_m]), yields=all(yields[shape.id] for shape in waiting))


def _posts(
    rules: Iterable[Rule], topology: Topology, lane_ids: LaneIds
) -> Iterator[tuple[Rule, Linestring, list[str]]]:
    """Yield each light or sign of each rule, with the lanelets in the net that it applies to."""
    for rule in rules:
        waiting = [name for name in rule.lanelets if topology.shapes[name].key in lane_ids]
        for post in rule.posts if waiting else ():
            yield rule, post, waiting


def _middle_m(line: Linestring) -> Float64Array:
    """(3,) midpoint between the ends of a line; of an outline the mean of its corners."""
    rows = slice(None, -1) if line.nodes[0] == line.nodes[-1] else [0, -1]
    return np.asarray(line.points_m[rows].mean(axis=0))


def _ground_m(shape: LaneletShape, position_m: Float64Array) -> float:
    """Height of a lanelet's end, at which something at a position stands."""
    return float(_nearest_piece_m(shape.center_m, position_m)[0, 2])


def _nearest_piece_m(line_m: Float64Array, position_m: Float64Array) -> Float64Array:
    """(2, 3) piece of a line that begins at the point nearest to a position, or ends at its last one."""
    nearest = int(np.argmin(np.linalg.norm(line_m[:, :2] - position_m[:2], axis=1)))
    return line_m[-2:] if nearest == len(line_m) - 1 else line_m[nearest : nearest + 2]


def _heading(piece_m: Float64Array) -> Float64Array:
    """(2,) direction of a (2, 3) piece of a line."""
    return np.asarray((piece_m[1] - piece_m[0])[:2])


def _facing_rad(post: Linestring, shape: LaneletShape) -> float:
    """Direction that a light or sign faces: across its line, towards the traffic at the end of a lanelet.

    If the line hardly runs across that traffic, it faces straight at it.
    """
    traffic, along = _heading(shape.center_m[-2:]), _heading(post.points_m[[0, -1]])
    traffic_rad = float(np.arctan2(traffic[1], traffic[0]))
    turn_rad = (np.arctan2(along[0], -along[1]) - traffic_rad + np.pi / 2.0) % np.pi - np.pi / 2.0
    if abs(turn_rad) > _MAX_TURN_RAD or not along.any():
        turn_rad = 0.0
    return float(np.angle(-np.exp(1j * (traffic_rad + turn_rad))))


def _positive(tags: Tags, name: str, default: float) -> float:
    """A tag as a positive number of at most 10, else the default."""
    try:
        value = float(tags.get(name, ""))
    except ValueError:
        return default
    return value if 0.0 < value <= 10.0 else default
