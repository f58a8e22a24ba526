"""Writes a map as a Lanelet2 file, as Autoware reads it: lanelets, lights, signs, stop lines, crosswalks.

Beside it goes ``map_projector_info.yaml``, from which Autoware takes the position of the map frame on Earth.
"""

from typing import Any

import numpy as np
import yaml

from simbev_ros.export.maps.lanelet2_lanes import Bound, lanelets_of
from simbev_ros.export.maps.lanelet2_rules import rules_of, turns_of
from simbev_ros.export.maps.osm_file import Member, OsmFile
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lanelet2.projector_info import datum_of_origin
from simbev_ros.maps.network import RoadNetwork, Signal
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Crosswalk, Paint, Sign

_TABLES: dict[str, Any] = load_table("simbev_ros.export.maps", "lanelet2_tags.yaml")
_HEAD_M, _HALF_WIDTH_M, _SIGN_ABOVE_GROUND_M = 1.0, 0.25, 2.0
_BULBS = {"red": 0.3, "yellow": 0.0, "green": -0.3}
_PROBE_M, _EXACT_M = 1000.0, 0.01
_ORIGIN = {"latitude": "deg", "longitude": "deg", "altitude": "m"}
_CHANGES = [{(LaneKind.DRIVING, False, flipped)} for flipped in (False, True)]


def lanelet2_of(network: RoadNetwork) -> bytes:
    """The content of a Lanelet2 file of a map, in UTF-8; the same bytes for the same map.

    Points have latitude and longitude, and their position in the map frame as ``local_x`` and ``local_y``. Lanes are
    lanelets with exact bounds; parking lanes, medians, the signs of speed limits and the land are left out.
    """
    layout = network.layout
    lanelets, bounds = lanelets_of(layout.strips_of(*map(LaneKind, _TABLES["lanelets"])))
    ids = {strip.id: number for number, strip in enumerate(lanelets, 1)}
    file = OsmFile(network.datum, first_id=len(ids) + 1)
    ways = {user: way for bound in bounds for way in [_add_bound(file, bound)] for user in bound.users}
    lines = [file.add_line(line.ends_m, _TABLES["stop_line"]) for line in layout.stop_lines]
    heads = [_add_head(file, signal) for signal in network.signals]
    signs = [_add_sign(file, sign) if sign.kind in _TABLES["signs"] else [] for sign in layout.signs]
    members = {strip.id: [("way", ways[strip.id, side], side) for side in ("left", "right")] for strip in lanelets}
    driven = [strip for strip in lanelets if strip.kind is LaneKind.DRIVING]
    for rule in rules_of(network, driven):
        posts = heads if rule.subtype == "traffic_light" else signs
        found = [member for row in rule.posts for member in posts[row]]
        found += [("way", lines[row], "ref_line") for row in rule.stop_lines]
        found += [("relation", ids[name], "yield") for name in (rule.lanelets if rule.first else ())]
        found += [("relation", ids[name], "right_of_way") for name in rule.first]
        element = file.add("relation", {"type": "regulatory_element", "subtype": rule.subtype}, found)
        for name in rule.lanelets:
            members[name].append(("relation", element, "regulatory_element"))
    turns = turns_of(driven)
    for strip in lanelets:
        tags = _TABLES["lanelets"][strip.kind] | ({"turn_direction": turns[strip.id]} if strip.id in turns else {})
        if strip.kind is not LaneKind.SIDEWALK:
            tags |= {"speed_limit": f"{round(strip.speed_mps * 3.6, 1):g}"}
        file.add("relation", tags, members[strip.id], ids[strip.id])
    for crosswalk in layout.crosswalks:
        sides = zip(_sides_m(crosswalk), ("left", "right"), strict=True)
        bounding = [("way", file.add_line(side_m, _TABLES["crosswalk_bound"]), side) for side_m, side in sides]
        file.add("relation", _TABLES["crosswalk"], bounding)
    return file.content()


def _add_bound(file: OsmFile, bound: Bound) -> int:
    """Add a bound, with the tags of its paint, else of the lanelets beside it; return its id."""
    users = list(bound.users.values())
    if bound.line.paint is not Paint.NONE:
        tags = dict(zip(("type", "subtype"), _TABLES["bounds"][bound.line.paint], strict=True))
        if bound.line.paint is not Paint.CURB:
            tags |= {"color": bound.line.color.value, "width": f"{bound.line.width_m:.2f}"}
    elif len(users) > 1 or users[0][0].junction:
        may_change = {(strip.kind, bool(strip.junction), flipped) for strip, flipped in users} in _CHANGES
        tags = {"type": "virtual"} | ({"lane_change": "yes"} if may_change else {})
    else:
        tags = {"type": "road_border"}
    return file.add_line(bound.points_m, tags)


def _add_head(file: OsmFile, signal: Signal) -> list[Member]:
    """Add a traffic light and its bulbs; return them as members of a rule."""
    line_m = _across_m(signal.position_m - [0.0, 0.0, _HEAD_M / 2.0], signal.yaw_rad)
    tags = {"type": "traffic_light", "subtype": "red_yellow_green", "height": f"{_HEAD_M:g}"}
    head = file.add_line(line_m, tags)
    bulbs = [
        file.add_node(signal.position_m + np.array([0.0, 0.0, up_m]), {"color": color})
        for color, up_m in _BULBS.items()
    ]
    way = file.add("way", {"type": "light_bulbs", "traffic_light_id": str(head)}, bulbs)
    return [("way", head, "refers"), ("way", way, "light_bulbs")]


def _add_sign(file: OsmFile, sign: Sign) -> list[Member]:
    """Add a sign; return it as a member of a rule."""
    line_m = _across_m(sign.foot_m + np.array([0.0, 0.0, _SIGN_ABOVE_GROUND_M]), sign.yaw_rad)
    return [("way", file.add_line(line_m, {"type": "traffic_sign", "subtype": _TABLES["signs"][sign.kind]}), "refers")]


def _across_m(middle_m: Float64Array, yaw_rad: float) -> Float64Array:
    """(2, 3) ends of a light or sign that faces in a direction, from left to right as drivers see it."""
    right_m = _HALF_WIDTH_M * np.array([-np.sin(yaw_rad), np.cos(yaw_rad), 0.0])
    return np.stack([middle_m - right_m, middle_m + right_m])


def _sides_m(crosswalk: Crosswalk) -> list[Float64Array]:
    """The (N, 3) left and right side of a crosswalk in walking direction."""
    offsets_m = (crosswalk.outline_m - crosswalk.outline_m.mean(axis=0))[:, :2]
    along_m, left_m = offsets_m @ crosswalk.axis, offsets_m @ np.array([-crosswalk.axis[1], crosswalk.axis[0]])
    order = np.argsort(along_m, kind="stable")
    return [crosswalk.outline_m[order[is_on_side[order]]] for is_on_side in (left_m > 0.0, left_m <= 0.0)]


def projector_info(datum: MapDatum) -> bytes:
    """The content of ``map_projector_info.yaml`` for the map frame of a datum, in UTF-8.

    If none of Autoware's projections gives it, the type is ``Local``: Autoware then takes ``local_x`` and ``local_y``,
    and knows no position on Earth.
    """
    kind, other = _projector_of(datum)
    if other is None:
        return b"projector_type: Local\n"
    origin = {name: getattr(other, f"{name}_{unit}") for name, unit in _ORIGIN.items()}
    content = {"projector_type": kind, "vertical_datum": "WGS84", "map_origin": origin}
    return yaml.safe_dump(content, sort_keys=False).encode()


def autoware_rise_m(datum: MapDatum) -> float:
    """Height of the map frame's origin in Autoware's, which begins at the origin of the projection, if any."""
    _, other = _projector_of(datum)
    return datum.altitude_m - (0.0 if other is None else other.altitude_m)


def _projector_of(datum: MapDatum) -> tuple[str, MapDatum | None]:
    """The projection of Autoware's that gives the map frame of a datum, and its datum; None if none does."""
    for kind in ("LocalCartesian", "LocalCartesianUTM", "TransverseMercator"):
        other = datum_of_origin(kind, datum.latitude_deg, datum.longitude_deg, datum.altitude_m)
        there_m = other.map_from_geodetic(*datum.geodetic_from_map((_PROBE_M, _PROBE_M, 0.0)))[:2]
        if np.abs(np.subtract(there_m, _PROBE_M)).max() < _EXACT_M:
            return kind, other
    return "Local", None
