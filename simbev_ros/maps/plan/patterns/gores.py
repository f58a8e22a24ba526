"""Finds gores: stretches of a ramp beside its carriageway, where both must have equal heights."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.lines import stations_m
from simbev_ros.maps.plan.plan import Link, Plan

_MAX_GAP_M = 5.0


class Gore(NamedTuple):
    """A stretch of a ramp beside a carriageway.

    Attributes:
        ramp: Index of the ramp's link.
        other: Index of the carriageway's link.
        ramp_m: (N,) stations on the ramp.
        other_m: (N,) stations across from them on the carriageway.
        gap_m: (N,) distances between the lanes of both.
    """

    ramp: int
    other: int
    ramp_m: Float64Array
    other_m: Float64Array
    gap_m: Float64Array


def gores_of(plan: Plan) -> Iterator[Gore]:
    """Yield all gores of a plan with (N, 2) lines."""
    index = {link.id: number for number, link in enumerate(plan.links)}
    touching = plan.links_at()
    for links in touching:
        for ramp in (link for link in links if _is_ramp(link)):
            carriageways = [link for link in links if link.road.kind.line_at == "left" and not _is_ramp(link)]
            near = {
                link.id: link
                for carriageway in carriageways
                for node in (carriageway.start, carriageway.end)
                for link in touching[node]
            }
            for other in near.values():
                gore = _gore(ramp, other)
                if not _is_ramp(other) and len(gore[0]):
                    yield Gore(index[ramp.id], index[other.id], *gore)


def _is_ramp(link: Link) -> bool:
    return any(join is not None for join in link.road.joins_m)


def _gore(ramp: Link, other: Link) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Stations on the ramp, the stations across from them on the other link, and the gaps between their lanes."""
    line = shapely.LineString(other.line_m)
    points = shapely.points(ramp.line_m)
    other_m = np.asarray(shapely.line_locate_point(line, points))
    gap_m = np.asarray(shapely.distance(line, points)) - other.road.kind.lanes * other.road.kind.lane_width_m
    near = (gap_m < _MAX_GAP_M) & (other_m > 0.0) & (other_m < line.length)
    return stations_m(ramp.line_m)[near], other_m[near], gap_m[near]
