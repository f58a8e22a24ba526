"""The exact shape of every lanelet: both borders in driving direction, with points that lie across from each other."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely
from scipy.optimize import isotonic_regression
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.files.limits import MAX_BOUND_POINTS
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.lane_graph.lane_key import LaneKey
from simbev_ros.maps.lanelet2.document import Lanelet, LaneletMap, Linestring
from simbev_ros.maps.lanelet2.tags import lane_kind
from simbev_ros.maps.roads.lane_kind import LaneKind

_MAX_WIDTH_M = 200.0
_MIN_LENGTH_M = 0.1
_MIN_DRIVING_WIDTH_M = 1.5
_MAX_INVERTED = 0.1
_MIN_LEFT_HANDED = 0.95
_SPACING_M = 0.5
_MIN_SAMPLES, _MAX_SAMPLES = 8, 2_000
_SAME_M = 1e-3


@dataclass(frozen=True)
class LaneletShape:
    """The shape of a lanelet.

    Attributes:
        lanelet: The lanelet.
        kind: Its use.
        left_m: (N, 3) left border in driving direction, map frame: all points of the file, and some between them.
        right_m: (N, 3) right border; point k lies across from point k of ``left_m``.
        left_nodes: Numbers of the points of its left bound, in driving direction.
        right_nodes: Likewise of its right bound.
        flipped: Whether the left and the right bound run against the driving direction in the file.
    """

    lanelet: Lanelet
    kind: LaneKind
    left_m: Float64Array
    right_m: Float64Array
    left_nodes: tuple[int, ...]
    right_nodes: tuple[int, ...]
    flipped: tuple[bool, bool]

    @property
    def id(self) -> str:
        """Id of the lanelet."""
        return self.lanelet.id

    @property
    def key(self) -> LaneKey:
        """Key of the lanelet in the graph of lanes."""
        return LaneKey(self.id, 0, -1)

    @property
    def start(self) -> tuple[int, int]:
        """Numbers of the left and the right point at which it starts."""
        return self.left_nodes[0], self.right_nodes[0]

    @property
    def end(self) -> tuple[int, int]:
        """Numbers of the left and the right point at which it ends."""
        return self.left_nodes[-1], self.right_nodes[-1]

    @cached_property
    def center_m(self) -> Float64Array:
        """(N, 3) line that vehicles follow: the file's center line if it has one, else midway between the borders."""
        middle_m = (self.left_m + self.right_m) / 2.0
        if self.lanelet.centerline is None:
            return middle_m
        line_m = self.lanelet.centerline.points_m[:: -1 if self.is_against_center else 1]
        line_m = np.concatenate([middle_m[:1], line_m[1:-1], middle_m[-1:]])
        return resampled_m(line_m, stations_m(middle_m) / stations_m(middle_m)[-1])

    @property
    def is_against_center(self) -> bool:
        """Whether the file's center line runs against the driving direction."""
        if self.lanelet.centerline is None:
            return False
        start_m = (self.left_m[0] + self.right_m[0]) / 2.0
        first_m, last_m = np.linalg.norm((self.lanelet.centerline.points_m[[0, -1]] - start_m)[:, :2], axis=1).tolist()
        return bool(first_m > last_m)

    @cached_property
    def width_m(self) -> float:
        """Mean width in plan view."""
        return float(self.polygon.area / max(stations_m(self.center_m)[-1], _MIN_LENGTH_M))

    @cached_property
    def length_m(self) -> float:
        """Length of its center line in plan view."""
        return float(stations_m(self.center_m)[-1])

    @cached_property
    def polygon(self) -> BaseGeometry:
        """Its area in plan view."""
        return shapely.make_valid(self._ring)

    @property
    def inverted_fraction(self) -> float:
        """Fraction of its area in which its left border is on the right, because the bounds cross."""
        total_m2 = self.polygon.area
        return float((total_m2 - self._ring.area) / 2.0 / total_m2) if total_m2 > 0.0 else 1.0

    @property
    def _ring(self) -> shapely.Polygon:
        """Its borders as a polygon, valid or not; in its area, what is on the wrong side counts as negative."""
        return shapely.Polygon(np.concatenate([self.left_m, self.right_m[::-1]])[:, :2])

    def reversed(self) -> "LaneletShape":
        """The same area in the opposite direction."""
        return LaneletShape(
            self.lanelet,
            self.kind,
            self.right_m[::-1],
            self.left_m[::-1],
            self.right_nodes[::-1],
            self.left_nodes[::-1],
            (not self.flipped[1], not self.flipped[0]),
        )


def lanelet_shapes(source: LaneletMap, notes: Findings) -> Iterator[LaneletShape]:
    """Yield the shapes of all lanelets of known use, in order; those with unusable bounds are left out with a note."""
    for lanelet in source.lanelets.values():
        kind = lane_kind(lanelet.tags)
        if kind is None:
            subtype = lanelet.tags.get("subtype", "")
            notes.left_out("a lanelet of unknown subtype is left out", lanelet.element, f"subtype={subtype[:30]!r}")
            continue
        problem = _problem(lanelet)
        if problem:
            rule = f"a lanelet {problem} is left out"
            notes.left_out(rule, lanelet.element, f"lanelet {lanelet.id}", *place_of_loss(lanelet.left, kind))
            continue
        shape = _shape(lanelet, kind)
        if shape.inverted_fraction > _MAX_INVERTED:
            rule = "a lanelet with crossing bounds is left out"
            notes.left_out(rule, lanelet.element, f"lanelet {lanelet.id}", *place_of_loss(lanelet.left, kind))
            continue
        if kind is LaneKind.DRIVING and shape.width_m < _MIN_DRIVING_WIDTH_M:
            notes.repaired(
                "a lanelet that is too narrow for vehicles is a shoulder",
                lanelet.element,
                f"lanelet {lanelet.id}: {shape.width_m:.1f} m",
            )
            shape = replace(shape, kind=LaneKind.SHOULDER)
        yield shape


def are_left_handed(shapes: Iterable[LaneletShape]) -> bool:
    """Whether coordinates are left-handed: nearly all lanelets run against their center line and a bound.

    The direction of bounds alone proves nothing, since they may run in either one, and oncoming lanelets share them.
    Lanelets without a center line are not counted.
    """
    against = [any(shape.flipped) and shape.is_against_center for shape in shapes if shape.lanelet.centerline]
    return bool(against) and sum(against) >= _MIN_LEFT_HANDED * len(against)


def place_of_loss(bound: Linestring | None, kind: LaneKind | None) -> tuple[Float64Array | None, float]:
    """(2,) middle of a bound of a lanelet that is lost, and the length of driving lane that is lost with it."""
    if bound is None:
        return None, 0.0
    points_m = bound.points_m
    return points_m[len(points_m) // 2, :2], float(stations_m(points_m)[-1]) if kind is LaneKind.DRIVING else 0.0


def _problem(lanelet: Lanelet) -> str:
    """Reason why a lanelet has no usable shape; "" if it has one."""
    left_m, right_m = lanelet.left.points_m, lanelet.right.points_m
    if max(len(left_m), len(right_m)) > MAX_BOUND_POINTS:
        return f"with more than {MAX_BOUND_POINTS} points in a bound"
    left, right = shapely.LineString(left_m[:, :2]), shapely.LineString(right_m[:, :2])
    if min(left.length, right.length) < _MIN_LENGTH_M:
        return "with a bound without length"
    if left.distance(right) > _MAX_WIDTH_M:
        return "that is far too wide"
    return ""


def _shape(lanelet: Lanelet, kind: LaneKind) -> LaneletShape:
    """The shape of a lanelet with usable bounds.

    Bounds may run in either direction: the right one is turned such that both run the same way, then both such that the
    left one is on the left.
    """
    left_m, right_m = lanelet.left.points_m, lanelet.right.points_m
    gaps_m = [np.linalg.norm(left_m[i, :2] - right_m[j, :2]) for i, j in ((0, 0), (-1, -1), (0, -1), (-1, 0))]
    flip_right = bool(gaps_m[0] + gaps_m[1] > gaps_m[2] + gaps_m[3])
    ring_m = np.concatenate([left_m, right_m[:: 1 if flip_right else -1]])[:, :2]
    flip_both = bool(shapely.is_ccw(shapely.LinearRing(ring_m)))
    flipped = flip_both, flip_right != flip_both
    left_m, right_m = (line_m[:: -1 if flip else 1] for line_m, flip in zip((left_m, right_m), flipped, strict=True))
    left_nodes, right_nodes = (
        line.nodes[:: -1 if flip else 1] for line, flip in zip((lanelet.left, lanelet.right), flipped, strict=True)
    )
    return LaneletShape(lanelet, kind, *pair_borders(left_m, right_m), left_nodes, right_nodes, flipped)


def pair_borders(left_m: Float64Array, right_m: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Insert points into two borders so that point k of one lies across from point k of the other.

    Positions along the right border are a monotone function of positions along the left one: the nearest points, made
    monotone by isotonic regression.

    Args:
        left_m: (L, 3) left border.
        right_m: (R, 3) right border, in the same direction.

    Returns:
        (N, 3) both borders, with all their points; the first points and the last points are across from each other.
    """
    left_s, right_s = stations_m(left_m), stations_m(right_m)
    count = int(np.clip(np.ceil(left_s[-1] / _SPACING_M), _MIN_SAMPLES, _MAX_SAMPLES))
    samples_s = np.linspace(0.0, left_s[-1], count + 1)
    right = shapely.LineString(right_m[:, :2])
    beside_s = shapely.line_locate_point(right, shapely.points(_at(left_m, samples_s)[:, :2]))
    beside_s = np.clip(isotonic_regression(beside_s).x, 0.0, right_s[-1])
    beside_s[0], beside_s[-1] = 0.0, right_s[-1]
    rungs = np.concatenate(
        [
            np.column_stack([left_s, np.interp(left_s, samples_s, beside_s)]),
            np.column_stack([_inverse(right_s, samples_s, beside_s), right_s]),
        ]
    )
    rungs = np.maximum.accumulate(rungs[np.lexsort([rungs[:, 1], rungs[:, 0]])], axis=0)
    rungs = rungs[np.concatenate([[True], np.diff(rungs, axis=0).max(axis=1) > _SAME_M])]
    if len(rungs) < 2:
        rungs = np.array([[0.0, 0.0], [left_s[-1], right_s[-1]]])
    rungs[-1] = left_s[-1], right_s[-1]
    return _at(left_m, rungs[:, 0]), _at(right_m, rungs[:, 1])


def _inverse(values: Float64Array, inputs: Float64Array, outputs: Float64Array) -> Float64Array:
    """(N,) inputs at which a nondecreasing, piecewise linear function has (N,) values."""
    rising = outputs + 1e-9 * np.arange(len(outputs))
    return np.asarray(np.interp(values, rising, inputs))


def stations_m(line_m: Float64Array) -> Float64Array:
    """(N,) distances of points from the start of their line, in plan view."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1))])


def _at(line_m: Float64Array, at_s: Float64Array) -> Float64Array:
    """(M, 3) points at (M,) distances along an (N, 3) line."""
    return np.column_stack([np.interp(at_s, stations_m(line_m), line_m[:, axis]) for axis in range(3)])


def joined_m(parts_m: Sequence[Float64Array]) -> Float64Array:
    """Concatenate lines that meet end to end to one (N, 3) line."""
    return np.concatenate([parts_m[0], *(part_m[1:] for part_m in parts_m[1:])])


def resampled_m(line_m: Float64Array, fractions: Float64Array) -> Float64Array:
    """(M, 3) points of an (N, 3) line at (M,) fractions of its length."""
    return _at(line_m, fractions * stations_m(line_m)[-1])
