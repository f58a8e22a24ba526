"""Meaning of the tags of lanelets and their bounds: use, speed limit, paint, permission to change lanes."""

import re

from simbev_ros.maps.lanelet2.document import Linestring
from simbev_ros.maps.lanelet2.tables import (
    DEFAULT_SPEEDS_KMH,
    LANE_CHANGES,
    LANE_KINDS,
    PAINT_WIDTHS_M,
    PAINTS,
    PARTICIPANTS,
    RESERVED,
    SPEED_UNITS_MPS,
)
from simbev_ros.maps.osm.data import Tags
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Line, Paint, PaintColor

_SPEED = re.compile(r"(\d{1,3}(?:\.\d{1,6})?) ?([a-z/]{0,4})")
_SPEED_RANGE_MPS = (0.1, 100.0)
_MAX_PAINT_WIDTH_M = 1.0
_MIRRORED = {Paint.SOLID_BROKEN: Paint.BROKEN_SOLID, Paint.BROKEN_SOLID: Paint.SOLID_BROKEN}


def lane_kind(tags: Tags) -> LaneKind | None:
    """Use of a lanelet: that of its participants if they are stated, else that of its subtype; None if unknown."""
    by_subtype = LANE_KINDS.get(tags.get("subtype", ""))
    if by_subtype is LaneKind.CROSSING:
        return by_subtype
    stated = {key.removeprefix("participant:"): value for key, value in tags.items() if key.startswith("participant:")}
    admitted = [kind for name, kind in PARTICIPANTS.items() if stated.get(name) == "yes"]
    if admitted and by_subtype not in (admitted[0], LaneKind.SHOULDER):
        return admitted[0]
    return by_subtype


def allowed_classes(tags: Tags, kind: LaneKind) -> str:
    """The only SUMO vehicle classes that may use a lanelet; "": all that drive on roads."""
    return RESERVED.get(kind.value, RESERVED.get(tags.get("subtype", ""), ""))


def parse_speed_mps(text: str) -> float:
    """Parse a speed such as ``50``, ``50 km/h`` or ``30 mph``; 0 if it is none between 0.1 and 100 m/s."""
    match = _SPEED.fullmatch(text.strip().lower())
    speed_mps = 0.0 if match is None else float(match[1]) * SPEED_UNITS_MPS.get(match[2], 0.0)
    return speed_mps if _SPEED_RANGE_MPS[0] <= speed_mps <= _SPEED_RANGE_MPS[1] else 0.0


def speed_limit_mps(tags: Tags) -> float:
    """Speed limit of a lanelet: its own, else the default of its subtype and location."""
    limits = DEFAULT_SPEEDS_KMH.get(tags.get("subtype", ""), DEFAULT_SPEEDS_KMH["default"])
    default_kmh = limits["nonurban" if tags.get("location") == "nonurban" else "urban"]
    return parse_speed_mps(tags.get("speed_limit", "")) or default_kmh / 3.6


def paint_of(line: Linestring, flipped: bool) -> Line:
    """Paint of a bound, from left to right in driving direction; ``flipped``: the bound runs against it."""
    kind = line.tags.get("type", "")
    if kind == "curbstone":
        return Line(Paint.CURB)
    if kind not in PAINT_WIDTHS_M:
        return Line()
    paint = PAINTS.get(line.tags.get("subtype", ""), Paint.SOLID)
    color = line.tags.get("color", "white")
    try:
        width_m = float(line.tags.get("width", ""))
    except ValueError:
        width_m = 0.0
    return Line(
        mirrored(paint) if flipped else paint,
        PaintColor(color) if color in list(PaintColor) else PaintColor.WHITE,
        width_m if 0.0 < width_m <= _MAX_PAINT_WIDTH_M else PAINT_WIDTHS_M[kind],
    )


def mirrored(paint: Paint) -> Paint:
    """The same paint seen from its other side."""
    return _MIRRORED.get(paint, paint)


def may_cross(line: Linestring, flipped: bool, to_left: bool) -> bool:
    """Whether one may change lanes across a bound, seen in driving direction."""
    side = "left" if to_left != flipped else "right"
    stated = line.tags.get("lane_change") or line.tags.get(f"lane_change:{side}")
    if stated is not None:
        return stated == "yes"
    if line.tags.get("type", "") not in PAINT_WIDTHS_M:
        return False
    paint = PAINTS.get(line.tags.get("subtype", ""), Paint.SOLID)
    left, right = LANE_CHANGES.get(paint, (False, False))
    return left if side == "left" else right
