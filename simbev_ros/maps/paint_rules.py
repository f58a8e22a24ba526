"""Which paint belongs on which border of a lane, where the map does not say.

After MUTCD 2009, sections 3B.01 to 3B.07: yellow parts directions and bounds one-way carriageways on the left, white
parts lanes of one direction and bounds them on the right. Where traffic keeps to the left, all of it is mirrored.
"""

from collections.abc import Sequence

from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.layout import Line, Paint, PaintColor

_NO_LINE = Line()
_CURB = Line(Paint.CURB)
_WHITE_EDGE = Line(Paint.SOLID)
_YELLOW_EDGE = Line(Paint.SOLID, PaintColor.YELLOW)
_NARROW_M = 5.5  # both directions together; MUTCD wants no centre line on narrower roads
_RESIDENTIAL_MPS = 30.5 / 3.6


def line_between(right: Lane, left: Lane) -> Line:
    """Paint between two lanes of one direction."""
    if right.kind not in ROAD_KINDS and left.kind not in ROAD_KINDS:
        return _NO_LINE
    if LaneKind.SIDEWALK in (right.kind, left.kind):
        return _CURB
    if left.kind not in ROAD_KINDS:
        return _YELLOW_EDGE
    if right.kind is left.kind is LaneKind.DRIVING:
        return Line(Paint.BROKEN)
    return _WHITE_EDGE


def right_edge_line(edge: Sequence[Lane], opposite: Sequence[Lane]) -> Line:
    """Paint where nothing lies to the right of an edge's lanes (from right to left)."""
    return _WHITE_EDGE if edge[0].kind in ROAD_KINDS and not _is_lane_of_the_neighbourhood(edge, opposite) else _NO_LINE


def left_line(edge: Sequence[Lane], opposite: Sequence[Lane]) -> Line:
    """Paint to the left of all of an edge's lanes; ``opposite``: those of the direction beside it, empty if none is."""
    if edge[-1].kind not in ROAD_KINDS or _is_lane_of_the_neighbourhood(edge, opposite):
        return _NO_LINE
    if not opposite or opposite[-1].kind not in ROAD_KINDS:
        return _YELLOW_EDGE
    both = (*edge, *opposite)
    one_lane_each = sum(lane.kind is LaneKind.DRIVING for lane in both) == 2
    if one_lane_each and all(lane.kind is not LaneKind.SIDEWALK for lane in both):
        return Line(Paint.BROKEN, PaintColor.YELLOW)
    return Line(Paint.SOLID_SOLID, PaintColor.YELLOW)


def _is_lane_of_the_neighbourhood(edge: Sequence[Lane], opposite: Sequence[Lane]) -> bool:
    """Whether a road is too narrow or too quiet for lines that bound or part its traffic."""
    if edge[-1].speed_mps <= _RESIDENTIAL_MPS:
        return True
    return bool(opposite) and sum(lane.width_m for lane in (*edge, *opposite) if lane.kind in ROAD_KINDS) < _NARROW_M
