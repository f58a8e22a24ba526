"""Where links of different layers pass over each other."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.maps.plan.plan import Link, Plan, half_width_m
from simbev_ros.types import Float64Array

_SMALLEST_SINE = 0.3
_AT_NODE_M = 2.0


class Crossing(NamedTuple):
    """One crossing at two heights.

    Attributes:
        upper: Index of the link above; lower: of the link below.
        upper_m: (3,) stations on the upper link at the start, in the middle and at the end of what lies above the
            other road; lower_m: on the lower link likewise.
    """

    upper: int
    lower: int
    upper_m: Float64Array
    lower_m: Float64Array


def crossings_of(plan: Plan) -> Iterator[Crossing]:
    """All crossings at two heights of a plan whose lines are (N, 2 or 3)."""
    lines = [shapely.LineString(link.line_m[:, :2]) for link in plan.links]
    first, second = shapely.STRtree(lines).query(lines, predicate="intersects")
    for a, b in zip(first.tolist(), second.tolist(), strict=True):
        if plan.links[a].road.layer > plan.links[b].road.layer:
            for place in shapely.get_coordinates(shapely.intersection(lines[a], lines[b])):
                if not _meet_at(plan, plan.links[a], plan.links[b], place):
                    yield _crossing(plan, lines, a, b, place)


def _meet_at(plan: Plan, upper: Link, lower: Link, place_m: Float64Array) -> bool:
    """Two links share a node there."""
    shared = {upper.start, upper.end} & {lower.start, lower.end}
    return any(np.linalg.norm(plan.nodes_m[node][:2] - place_m) < _AT_NODE_M for node in shared)


def _crossing(plan: Plan, lines: list[shapely.LineString], upper: int, lower: int, place_m: Float64Array) -> Crossing:
    point = shapely.Point(place_m)
    at_m = [lines[index].project(point) for index in (upper, lower)]
    directions = [_direction(lines[index], station_m) for index, station_m in zip((upper, lower), at_m, strict=True)]
    cosine = abs(float(directions[0] @ directions[1]))
    sine = max(float(np.sqrt(max(0.0, 1.0 - cosine**2))), _SMALLEST_SINE)
    widths_m = [half_width_m(plan.links[index].road.kind) for index in (upper, lower)]
    spans_m = [(widths_m[1 - side] + widths_m[side] * cosine) / sine for side in (0, 1)]
    stations = [
        np.clip(at_m[side] + np.array([-1.0, 0.0, 1.0]) * spans_m[side], 0.0, lines[index].length)
        for side, index in enumerate((upper, lower))
    ]
    return Crossing(upper, lower, stations[0], stations[1])


def _direction(line: shapely.LineString, station_m: float) -> Float64Array:
    ends = [line.interpolate(np.clip(station_m + step_m, 0.0, line.length)).coords[0] for step_m in (-1.0, 1.0)]
    step = np.subtract(ends[1], ends[0])
    unit: Float64Array = step / np.linalg.norm(step)
    return unit
