"""Linear limits on the heights of planned roads: grades, vertical curves, clearances, height above water, gores."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import coo_array, csr_array, diags_array, vstack

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import Water
from simbev_ros.maps.plan.crossings import crossings_of
from simbev_ros.maps.plan.heights.node_planes import NODE_UNKNOWNS, Planes
from simbev_ros.maps.plan.heights.vertices import Vertices
from simbev_ros.maps.plan.patterns.gores import gores_of
from simbev_ros.maps.plan.plan import Plan

CLEARANCE_M = 6.5
"""Height between the carriageways of roads that cross at two levels: 5.5 m free height and a deck of 1 m."""

_CLEARANCE_MARGIN_M = 0.15
_ABOVE_WATER_M = 3.0
_ABOVE_BANK_M = 1.0
_BANK_M = 15.0
_GORE_TOLERANCE_M = 0.02
_GORE_SLOPE = 0.05
_LIMIT_FRACTION = 0.96


@dataclass(frozen=True, slots=True)
class Limits:
    """A block of constraints ``low <= rows @ x <= high``, scaled so that a violation by 0.01 is small.

    Attributes:
        name: Name of the limit, for messages.
        rows: (C, M) over heights of vertices, or (C, U) over unknowns.
        low: (C,) lower bounds.
        high: (C,) upper bounds.
    """

    name: str
    rows: csr_array
    low: Float64Array
    high: Float64Array

    def in_unknowns(self, heights_from_unknowns: csr_array) -> "Limits":
        """The same limits expressed over the unknowns instead of heights."""
        return Limits(self.name, self.rows @ heights_from_unknowns, self.low, self.high)

    def violation(self, x: Float64Array) -> Float64Array:
        """(C,) violation of each row."""
        values = self.rows @ x
        return np.abs(values - np.clip(values, self.low, self.high))


def limits_of(plan: Plan, vertices: Vertices, bends: csr_array, water: Sequence[Water]) -> list[Limits]:
    """All limits on the heights of vertices; ``bends`` as returned by ``bends_of``."""
    return [
        _grade_limits(vertices),
        _bend_limits(vertices, bends),
        _clearance_limits(plan, vertices),
        _water_limits(vertices, water),
        _gore_limits(plan, vertices),
    ]


def bends_of(vertices: Vertices) -> tuple[csr_array, Float64Array]:
    """(B, M) matrix from heights to changes of grade at inner vertices, and (B,) road lengths that these represent."""
    inner = vertices.inner
    before_m = vertices.station_m[inner] - vertices.station_m[inner - 1]
    after_m = vertices.station_m[inner + 1] - vertices.station_m[inner]
    row = np.tile(np.arange(len(inner)), 3)
    column = np.concatenate([inner - 1, inner, inner + 1])
    value = np.concatenate([1.0 / before_m, -1.0 / before_m - 1.0 / after_m, 1.0 / after_m])
    rows = csr_array(coo_array((value, (row, column)), shape=(len(inner), len(vertices))))
    return rows, (before_m + after_m) / 2.0


def gradient_limits(planes: Planes, unknowns: int) -> Limits:
    """Limits on the gradients of the node planes, over unknowns."""
    count = len(planes.reach_m)
    side = left_of(planes.axis)
    value = np.concatenate([planes.axis / planes.along[:, None], side / planes.across[:, None]])
    column = np.tile(NODE_UNKNOWNS * np.arange(count)[:, None] + [1, 2], (2, 1))
    row = np.repeat(np.arange(2 * count), 2)
    rows = coo_array((value.ravel(), (row, column.ravel())), shape=(2 * count, unknowns))
    return Limits("level junctions", csr_array(rows), np.full(2 * count, -1.0), np.ones(2 * count))


def _grade_limits(vertices: Vertices) -> Limits:
    start = vertices.with_next
    step_m = vertices.station_m[start + 1] - vertices.station_m[start]
    value = 1.0 / (vertices.max_grade[start] * step_m)
    row = np.tile(np.arange(len(start)), 2)
    column = np.concatenate([start, start + 1])
    rows = coo_array((np.concatenate([-value, value]), (row, column)), shape=(len(start), len(vertices)))
    return Limits(
        "grades", csr_array(rows), np.full(len(start), -_LIMIT_FRACTION), np.full(len(start), _LIMIT_FRACTION)
    )


def _bend_limits(vertices: Vertices, bends: csr_array) -> Limits:
    inner = vertices.inner
    around_m = (vertices.station_m[inner + 1] - vertices.station_m[inner - 1]) / 2.0
    rows = csr_array(diags_array(1.0 / (vertices.max_bend_per_m[inner] * around_m)) @ bends)
    return Limits("vertical curves", rows, np.full(len(inner), -_LIMIT_FRACTION), np.full(len(inner), _LIMIT_FRACTION))


def _clearance_limits(plan: Plan, vertices: Vertices) -> Limits:
    """Clearance of each of the upper road's stations above each of the lower road's."""
    rows = []
    for crossing in crossings_of(plan):
        upper = _height_at(vertices, crossing.upper, crossing.upper_m)
        lower = _height_at(vertices, crossing.lower, crossing.lower_m)
        rows += [upper[[a]] - lower[[b]] for a in range(3) for b in range(3)]
    matrix = csr_array(vstack(rows)) if rows else csr_array((0, len(vertices)))
    count = matrix.shape[0]
    low = np.full(count, CLEARANCE_M + _CLEARANCE_MARGIN_M)
    return Limits("clearances", matrix, low, np.full(count, np.inf))


def _gore_limits(plan: Plan, vertices: Vertices) -> Limits:
    """Ramps within a tolerance of the height of the carriageway beside them, which grows with their distance."""
    gores = list(gores_of(plan))
    rows = [_height_at(vertices, g.ramp, g.ramp_m) - _height_at(vertices, g.other, g.other_m) for g in gores]
    matrix = csr_array(vstack(rows)) if rows else csr_array((0, len(vertices)))
    gap_m = np.concatenate([np.empty(0), *(gore.gap_m for gore in gores)])
    allowed_m = _GORE_TOLERANCE_M + _GORE_SLOPE * np.maximum(gap_m, 0.0)
    return Limits("ramps level with their carriageways", matrix, -allowed_m, allowed_m)


def _height_at(vertices: Vertices, link: int, stations: Float64Array) -> csr_array:
    """(S, M) matrix from heights of vertices to heights at stations of a link."""
    first, last = vertices.first[link], vertices.first[link + 1] - 1
    along_m = vertices.station_m[first : last + 1]
    index = np.clip(np.searchsorted(along_m, stations, side="right") - 1, 0, last - first - 1)
    fraction = np.clip((stations - along_m[index]) / (along_m[index + 1] - along_m[index]), 0.0, 1.0)
    row = np.tile(np.arange(len(stations)), 2)
    column = first + np.concatenate([index, index + 1])
    value = np.concatenate([1.0 - fraction, fraction])
    return csr_array(coo_array((value, (row, column)), shape=(len(stations), len(vertices))))


def _water_limits(vertices: Vertices, water: Sequence[Water]) -> Limits:
    """Heights above water, with clearance for boats, and above a bank beside it."""
    min_height_m = np.full(len(vertices), -np.inf)
    points = shapely.points(vertices.xy_m)
    for body in water:
        distance_m = shapely.distance(points, body.area)
        above_m = np.where(distance_m <= 1.0, _ABOVE_WATER_M, _ABOVE_BANK_M)
        near = (distance_m <= _BANK_M + vertices.half_width_m) & (vertices.layer >= 0)
        min_height_m = np.where(near, np.maximum(min_height_m, body.surface_m + above_m), min_height_m)
    bounded = np.flatnonzero(np.isfinite(min_height_m))
    rows = coo_array((np.ones(len(bounded)), (np.arange(len(bounded)), bounded)), shape=(len(bounded), len(vertices)))
    return Limits("height above water", csr_array(rows), min_height_m[bounded], np.full(len(bounded), np.inf))
