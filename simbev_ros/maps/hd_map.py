"""Builds the lane record published on /ego/hd_map: the lane under the ego, with the SimBEV format's keys."""

from typing import Any

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Line, Paint, Strip
from simbev_ros.maps.roads.polylines import Polylines

_LANE_TYPES = {
    LaneKind.DRIVING: "Driving",
    LaneKind.BICYCLE: "Biking",
    LaneKind.PARKING: "Parking",
    LaneKind.SHOULDER: "Shoulder",
    LaneKind.MEDIAN: "Median",
    LaneKind.SIDEWALK: "Sidewalk",
}
"""CARLA's lane type names."""
_SLOPE_M = 0.5
_CROSSABLE = {
    Paint.NONE: (True, True),
    Paint.BROKEN: (True, True),
    Paint.BROKEN_BROKEN: (True, True),
    Paint.BOTTS_DOTS: (True, True),
    Paint.BROKEN_SOLID: (True, False),
    Paint.SOLID_BROKEN: (False, True),
}
"""Whether a marking may be crossed (leaving the lane, entering the lane); markings not listed may not be crossed."""


def lane_record(network: RoadNetwork, xyz_m: Float64Array, yaw_rad: float) -> dict[str, Any]:
    """Record of the driving lane that a vehicle is on, or of the nearest driving lane.

    Names are CARLA's. Lengths are in meters, the pose of the lane center is in the map frame, ``rotation`` is roll,
    pitch, yaw in degrees; ``s`` is the distance along the lane from its start.

    Args:
        network: The road network, with at least one driving lane.
        xyz_m: (3,) position of the vehicle, map frame.
        yaw_rad: Heading of the vehicle: where lanes overlap, one along this heading is chosen.
    """
    lanes = network.lane_strips
    found = lanes.index.nearest(xyz_m[None], np.array([yaw_rad]))
    strip, s_m = lanes.strips[int(found.row[0])], float(found.s_m[0])
    sides = Polylines.from_lines([strip.left_m, strip.right_m])
    parameter = found.parameter - lanes.index.lines.first[found.row] + sides.first[:2]
    left_m, right_m = sides.values(parameter)
    heading = lanes.index.lines.headings(found.parameter)[0]
    left, right = (lanes.by_lane.get(name) for name in (strip.left, strip.right))
    return {
        "id": strip.lane,
        "s": strip.s_start_m + s_m,
        "road_id": strip.road,
        "section_id": strip.section,
        "lane_id": strip.index,
        "lane_type": _LANE_TYPES[strip.kind],
        "lane_width": float(np.linalg.norm((left_m - right_m)[:2])),
        "lane_change": _sides(_may_enter(strip.left_line, left), _may_enter(strip.right_line, right)),
        "is_junction": bool(strip.junction),
        "junction_id": strip.junction or None,
        "is_intersection": bool(strip.junction),
        "transform": _transform(left_m, right_m, heading, _slope(strip, s_m)),
        "left_lane_marking": _marking(strip.left_line, outward="Left", inward="Right"),
        "right_lane_marking": _marking(strip.right_line, outward="Right", inward="Left"),
        "left_lane": _neighbor(left),
        "right_lane": _neighbor(right),
    }


def _may_enter(line: Line, neighbor: Strip | None) -> bool:
    """Whether a car may change to the lane beyond a line."""
    outward, _ = _CROSSABLE.get(line.paint, (False, False))
    return outward and neighbor is not None and neighbor.kind is LaneKind.DRIVING


def _sides(left: bool, right: bool) -> str:
    """CARLA's name for the sides to which a lane change is allowed."""
    return {(True, True): "Both", (True, False): "Left", (False, True): "Right"}.get((left, right), "NONE")


def _marking(line: Line, outward: str, inward: str) -> dict[str, Any]:
    """Lane marking in CARLA's terms; ``outward`` and ``inward`` are the crossing directions as seen from the lane."""
    crossable = dict(zip((outward, inward), _CROSSABLE.get(line.paint, (False, False)), strict=True))
    return {
        "type": "NONE" if line.paint is Paint.NONE else line.paint.value.title().replace(" ", ""),
        "width": 0.0 if line.paint is Paint.NONE else line.width_m,
        "color": line.color.value.capitalize(),
        "lane_change": _sides(crossable["Left"], crossable["Right"]),
    }


def _neighbor(strip: Strip | None) -> dict[str, Any] | None:
    """Identifiers of the adjacent lane, or None if there is none."""
    if strip is None:
        return None
    return {
        "id": strip.lane,
        "road_id": strip.road,
        "section_id": strip.section,
        "lane_id": strip.index,
        "lane_type": _LANE_TYPES.get(strip.kind, "NONE"),
    }


def _slope(strip: Strip, s_m: float) -> float:
    """Gradient of a strip (rise per meter) at a distance along it."""
    line = Polylines.from_lines([strip.center_m])
    ends_m = line.values(line.parameter(np.zeros(2, np.int64), s_m + np.array([-_SLOPE_M, _SLOPE_M])))
    return float((ends_m[1, 2] - ends_m[0, 2]) / max(np.linalg.norm((ends_m[1] - ends_m[0])[:2]), 1e-6))


def _transform(left_m: Float64Array, right_m: Float64Array, heading: Float64Array, slope: float) -> dict[str, Any]:
    """Pose of the lane center: x forward, y to the left, z normal to the road surface."""
    across_m = left_m - right_m
    roll_rad = np.arctan2(across_m[2], np.linalg.norm(across_m[:2]))
    rotation_rad = roll_rad, -np.arctan(slope), np.arctan2(heading[1], heading[0])
    return {"location": ((left_m + right_m) / 2.0).tolist(), "rotation": np.degrees(rotation_rad).tolist()}
