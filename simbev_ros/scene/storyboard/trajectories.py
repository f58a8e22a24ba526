"""Trajectories of a storyboard as sampled lines: polylines, clothoids, splines of clothoids, and NURBS."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.storyboard.bodies import Pose
from simbev_ros.scene.storyboard.model import Element

_STEP_M = 0.05
_MAX_POINTS = 200_000
_NURBS_POINTS = 256  # between two knots

Resolve = Callable[[Element], Pose]
"""Resolves a position of the storyboard."""


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """A line in plan view.

    Attributes:
        points_m: (N, 3) points, map frame; z is NaN on the ground.
        distance_m: (N,) distances from the first one.
        yaw_rad: (N,) unwrapped headings; those of a polyline are constant up to the next point.
        time_s: (N,) times at the points, or None.
        is_smooth: Whether headings between points are interpolated.
    """

    points_m: Float64Array
    distance_m: Float64Array
    yaw_rad: Float64Array
    time_s: Float64Array | None
    is_smooth: bool

    @property
    def length_m(self) -> float:
        """Distance of the last point."""
        return float(self.distance_m[-1])

    def pose(self, distance_m: float) -> Pose:
        """The pose at a distance from the start."""
        distance_m = min(max(distance_m, 0.0), self.length_m)
        position_m = np.array([np.interp(distance_m, self.distance_m, self.points_m[:, axis]) for axis in range(3)])
        if self.is_smooth:
            return Pose(position_m, float(np.interp(distance_m, self.distance_m, self.yaw_rad)))
        row = min(int(np.searchsorted(self.distance_m, distance_m, side="right")) - 1, len(self.yaw_rad) - 1)
        return Pose(position_m, float(self.yaw_rad[row]))

    def distance_at(self, time_s: float) -> float:
        """Distance at a time, of a trajectory with times."""
        assert self.time_s is not None
        return float(np.interp(time_s, self.time_s, self.distance_m))

    def speed_at(self, time_s: float) -> float:
        """Speed just after a time, of a trajectory with times; 0 before and after them."""
        assert self.time_s is not None
        row = int(np.searchsorted(self.time_s, time_s, side="right")) - 1
        if not 0 <= row < len(self.time_s) - 1:
            return 0.0
        return float(np.diff(self.distance_m)[row] / max(np.diff(self.time_s)[row], 1e-9))


def curve_of(trajectory: Element, resolve: Resolve) -> Curve:
    """The line of a ``Trajectory`` element."""
    return _CURVES[trajectory.shape.kind](trajectory.shape, resolve, trajectory.closed)


def _curve(points_m: Float64Array, time_s: Sequence[float | None], yaw_rad: Float64Array | None = None) -> Curve:
    """A curve through (N, 3) points, with headings unless they are those of its legs."""
    legs_m = np.diff(points_m[:, :2], axis=0)
    distance_m = np.concatenate([[0.0], np.cumsum(np.hypot(*legs_m.T))])
    leg_rad = np.arctan2(legs_m[:, 1], legs_m[:, 0])
    times = None if any(each is None for each in time_s) else np.array(time_s, np.float64)
    return Curve(points_m, distance_m, leg_rad if yaw_rad is None else yaw_rad, times, yaw_rad is not None)


def _polyline(shape: Element, resolve: Resolve, closed: bool) -> Curve:
    vertices = shape.vertices + shape.vertices[:1] * closed
    points_m = np.array([resolve(vertex.position).position_m for vertex in vertices])
    return _curve(points_m, [vertex.time_s for vertex in shape.vertices] + [None] * closed)


def _clothoid(shape: Element, resolve: Resolve, closed: bool) -> Curve:
    start, end = shape.curvature_per_m, shape.curvature_per_m + shape.curvature_prime_per_m2 * shape.length_m
    pose = resolve(shape.position)
    points_m, yaw_rad = _clothoid_points(pose, start, end, shape.length_m)
    ends = shape.start_time_s, shape.stop_time_s
    times = [None] if None in ends else np.linspace(*ends, len(points_m)).tolist()
    return _curve(points_m, times, yaw_rad)


def _clothoid_spline(shape: Element, resolve: Resolve, closed: bool) -> Curve:
    parts, pose = list[tuple[Float64Array, Float64Array]](), Pose(np.zeros(3), 0.0)
    times, ends = list[float | None](), [*(each.time_start_s for each in shape.segments[1:]), shape.time_end_s]
    for segment, end_s in zip(shape.segments, ends, strict=True):
        if segment.position is not None:
            pose = resolve(segment.position)
        pose = Pose(pose.position_m, pose.yaw_rad + segment.h_offset_rad)
        curvature = segment.curvature_start_per_m, segment.curvature_end_per_m
        points_m, yaw_rad = _clothoid_points(pose, *curvature, segment.length_m)
        timed = segment.time_start_s is not None and end_s is not None
        times += np.linspace(segment.time_start_s, end_s, len(points_m)).tolist() if timed else [None]
        parts.append((points_m, yaw_rad))
        pose = Pose(points_m[-1], float(yaw_rad[-1]))
    points_m, yaw_rad = (np.concatenate(each) for each in zip(*parts, strict=True))
    return _curve(points_m, times, yaw_rad)


def _clothoid_points(pose: Pose, start: float, end: float, length_m: float) -> tuple[Float64Array, Float64Array]:
    """(N, 3) points of a clothoid from a pose, and (N,) headings; integrated by Simpson's rule."""
    count = min(max(2, math.ceil(length_m / _STEP_M) + 1), _MAX_POINTS)
    at_m = np.linspace(0.0, length_m, 2 * count - 1)
    yaw_rad = pose.yaw_rad + start * at_m + (end - start) / (2.0 * max(length_m, 1e-9)) * at_m**2
    direction = np.exp(1j * yaw_rad)
    step = (direction[:-2:2] + 4.0 * direction[1::2] + direction[2::2]) * (at_m[2] - at_m[0]) / 6.0
    line = np.concatenate([[0.0], np.cumsum(step)])
    offsets_m = np.column_stack([line.real, line.imag, np.zeros(count)])
    return pose.position_m + offsets_m, yaw_rad[::2]


def _nurbs(shape: Element, resolve: Resolve, closed: bool) -> Curve:
    points_m = np.array([resolve(point.position).position_m for point in shape.control_points])
    weights = np.array([point.weight for point in shape.control_points])
    times = [point.time_s for point in shape.control_points]
    timed = None not in times
    columns = np.column_stack([points_m, times if timed else np.zeros(len(times))])
    knots, degree = np.array([knot.value for knot in shape.knots]), shape.order - 1
    spline = BSpline(knots, np.column_stack([columns * weights[:, None], weights]), degree)
    low, high = knots[degree], knots[len(weights)]
    spans = max(1, len(np.unique(knots[(knots >= low) & (knots <= high)])) - 1)
    values = spline(np.linspace(low, high, spans * _NURBS_POINTS + 1))
    samples = values[:, :4] / values[:, 4:]
    tangent = np.gradient(samples[:, :2], axis=0)
    yaw_rad = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    return _curve(samples[:, :3], samples[:, 3].tolist() if timed else [None], yaw_rad)


_CURVES: dict[str, Callable[[Element, Resolve, bool], Curve]] = {
    "Polyline": _polyline,
    "Clothoid": _clothoid,
    "ClothoidSpline": _clothoid_spline,
    "Nurbs": _nurbs,
}
