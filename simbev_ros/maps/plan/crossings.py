"""Finds the crossings at two levels in a plan, where links of different layers pass over each other."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.plan import Link, Plan, half_width_m

_MIN_SINE = 0.3
_NODE_TOLERANCE_M = 2.0


class Crossing(NamedTuple):
    """A crossing at two heights.

    Attributes:
        upper: Index of the upper link.
        lower: Index of the lower link.
        upper_m: (3,) stations on the upper link at the start, the middle and the end of the part above the other road.
        lower_m: (3,) stations on the lower link likewise.
    """

    upper: int
    lower: int
    upper_m: Float64Array
    lower_m: Float64Array


def crossings_of(plan: Plan) -> Iterator[Crossing]:
    """Yield all crossings at two heights of a plan with (N, 2 or 3) lines."""
    lines = [shapely.LineString(link.line_m[:, :2]) for link in plan.links]
    first, second = shapely.STRtree(lines).query(lines, predicate="intersects")
    for a, b in zip(first.tolist(), second.tolist(), strict=True):
        if plan.links[a].road.layer > plan.links[b].road.layer:
            for position in shapely.get_coordinates(overlay.intersection(lines[a], lines[b])):
                if not _meet_at(plan, plan.links[a], plan.links[b], position):
                    yield _crossing(plan, lines, a, b, position)


def _meet_at(plan: Plan, upper: Link, lower: Link, position_m: Float64Array) -> bool:
    """Whether two links share a node at a position."""
    shared = {upper.start, upper.end} & {lower.start, lower.end}
    return any(np.linalg.norm(plan.nodes_m[node][:2] - position_m) < _NODE_TOLERANCE_M for node in shared)


def _crossing(
    plan: Plan, lines: list[shapely.LineString], upper: int, lower: int, position_m: Float64Array
) -> Crossing:
    point = shapely.Point(position_m)
    crossing_stations_m = [lines[index].project(point) for index in (upper, lower)]
    directions = [
        _direction(lines[index], station_m)
        for index, station_m in zip((upper, lower), crossing_stations_m, strict=True)
    ]
    cosine = abs(float(directions[0] @ directions[1]))
    sine = max(float(np.sqrt(max(0.0, 1.0 - cosine**2))), _MIN_SINE)
    widths_m = [half_width_m(plan.links[index].road.kind) for index in (upper, lower)]
    spans_m = [(widths_m[1 - side] + widths_m[side] * cosine) / sine for side in (0, 1)]
    stations = [
        np.clip(crossing_stations_m[side] + np.array([-1.0, 0.0, 1.0]) * spans_m[side], 0.0, lines[index].length)
        for side, index in enumerate((upper, lower))
    ]
    return Crossing(upper, lower, stations[0], stations[1])


def _direction(line: shapely.LineString, station_m: float) -> Float64Array:
    ends = [line.interpolate(np.clip(station_m + step_m, 0.0, line.length)).coords[0] for step_m in (-1.0, 1.0)]
    step = np.subtract(ends[1], ends[0])
    return step / np.linalg.norm(step)
