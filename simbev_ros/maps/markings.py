"""Paint on the roads in plan: lane lines, centre lines, stop lines and the stripes of crosswalks.

Widths and lengths follow what is usual on urban streets (MUTCD 2009, sections 3A.06, 3B.01, 3B.16 and 3B.18).
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.ops import substring

from simbev_ros.maps.lane_kind import LaneKind
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.types import BoolArray, Float64Array

_LINE_WIDTH_M = 0.12
_DASH_M, _DASH_GAP_M = 3.0, 6.0
_CENTER_OFFSET_M = 0.12  # from the middle to each of the two lines
_STOP_LINE_M = (0.3, 0.7)  # its extent, back from the lane's end; SUMO's vehicles halt 1 m before the end
_STOP_LINE_MARGIN_M = 0.25  # clear of the curb, and of the centre lines
_DASH_CLEARANCE_M = 1.0
_STRIPE_M, _STRIPE_GAP_M = 0.5, 0.5
_STRIPE_MARGIN_M = 0.25  # at both ends of a stripe
_SAME_PLACE_M = 0.3


class MarkingKind(StrEnum):
    """What a piece of paint means; centre lines are yellow, all others white."""

    LANE = "lane"
    EDGE = "edge"
    CENTER = "center"
    STOP = "stop"
    CROSSWALK = "crosswalk"


@dataclass(frozen=True, slots=True)
class Marking:
    """One painted area, map frame, metres."""

    kind: MarkingKind
    polygon: Polygon


def lane_markings(network: RoadNetwork) -> tuple[Marking, ...]:
    """All paint; none of it overlaps other paint, and inside junctions there is only that of crosswalks.

    Dashes between lanes of one direction, two solid lines between directions, a solid line at the left edge of a
    one-way street, stop lines at signals, stripes on crosswalks.
    """
    edges = _driving_edges(network)
    stopped = {signal.lane for signal in network.signals}
    return (
        *(mark for lanes in edges for right in lanes[:-1] for mark in _dashes(right)),
        *_left_lines([lanes[-1] for lanes in edges]),
        *(_stop_line(lanes) for lanes in edges if stopped.issuperset(lane.id for lane in lanes)),
        *(mark for crossing in network.lanes_of(LaneKind.CROSSING) for mark in _stripes(crossing)),
    )


def _driving_edges(network: RoadNetwork) -> list[list[Lane]]:
    """Driving lanes outside junctions, grouped by edge, from right to left."""
    edges: dict[str, list[Lane]] = defaultdict(list)
    for lane in network.lanes_of(LaneKind.DRIVING):
        if not lane.junction:
            edges[lane.edge].append(lane)
    return [sorted(lanes, key=lambda lane: lane.index) for lanes in edges.values()]


def _left_lines(leftmost: Sequence[Lane]) -> Iterator[Marking]:
    """The lines to the left of each direction's leftmost lane; the two directions of a street share theirs."""
    borders = [_beside(lane, lane.width_m / 2.0) for lane in leftmost]
    starts = np.array([border.coords[0] for border in borders]).reshape(-1, 2)
    ends = np.array([border.coords[-1] for border in borders]).reshape(-1, 2)
    facing = _close(starts, ends) & _close(ends, starts)
    for row, lane in enumerate(leftmost):
        if not facing[row].any():
            yield _line(_beside(lane, lane.width_m / 2.0 - _LINE_WIDTH_M), MarkingKind.EDGE)
        elif not facing[row, :row].any():
            for side in (-1.0, 1.0):
                yield _line(_beside(lane, lane.width_m / 2.0 + side * _CENTER_OFFSET_M), MarkingKind.CENTER)


def _close(points_a: Float64Array, points_b: Float64Array) -> BoolArray:
    """(A, B) whether two points are at the same place, of (A, 2) and (B, 2) metres."""
    distances_m: Float64Array = np.linalg.norm(points_a[:, None] - points_b[None], axis=2)
    return distances_m < _SAME_PLACE_M


def _dashes(lane: Lane) -> Iterator[Marking]:
    """Dashes on the left border of a lane, whole ones only, clear of stop lines."""
    border = _beside(lane, lane.width_m / 2.0)
    for dash in _pieces(_part(border, _DASH_CLEARANCE_M, border.length - _DASH_CLEARANCE_M), _DASH_M, _DASH_GAP_M):
        yield _line(dash, MarkingKind.LANE)


def _stop_line(lanes: Sequence[Lane]) -> Marking:
    """The bar before the end of lanes that run side by side (from right to left), from curb to centre line."""
    right = lanes[0]
    street_m = sum(lane.width_m for lane in lanes)
    across_m = street_m - 2.0 * _STOP_LINE_MARGIN_M
    middle = _beside(right, (street_m - right.width_m) / 2.0)
    near_m, far_m = _STOP_LINE_M
    return _line(_part(middle, middle.length - far_m, middle.length - near_m), MarkingKind.STOP, across_m)


def _stripes(crossing: Lane) -> Iterator[Marking]:
    """Bars along the direction of traffic, all the way across."""
    across_m = crossing.width_m - 2.0 * _STRIPE_MARGIN_M
    for piece in _pieces(LineString(crossing.centerline_m[:, :2]), _STRIPE_M, _STRIPE_GAP_M):
        yield _line(piece, MarkingKind.CROSSWALK, across_m)


def _beside(lane: Lane, left_m: float) -> LineString:
    """The line along a lane, ``left_m`` to the left of its centre, in driving direction."""
    line = shapely.offset_curve(LineString(lane.centerline_m[:, :2]), left_m, join_style="mitre")
    assert isinstance(line, LineString), f"lane {lane.id} bends more sharply than it is wide"
    return line


def _part(line: LineString, start_m: float, end_m: float) -> LineString:
    """A stretch of a line; empty if it ends before it starts."""
    if end_m <= start_m:
        return LineString()
    part = substring(line, start_m, end_m)
    assert isinstance(part, LineString)
    return part


def _pieces(line: LineString, piece_m: float, gap_m: float) -> Iterator[LineString]:
    """As many pieces as fit on a line, placed symmetrically."""
    count = int((line.length + gap_m) // (piece_m + gap_m))
    first_m = (line.length - count * (piece_m + gap_m) + gap_m) / 2.0
    for start_m in first_m + (piece_m + gap_m) * np.arange(count):
        yield _part(line, float(start_m), float(start_m) + piece_m)


def _line(line: LineString, kind: MarkingKind, width_m: float = _LINE_WIDTH_M) -> Marking:
    """Paint along a line."""
    return Marking(kind, shapely.buffer(line, width_m / 2.0, cap_style="flat", join_style="mitre"))
