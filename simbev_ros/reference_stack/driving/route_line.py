"""The line of a route: positions along it, distances beside it, and the speeds at which it can be driven."""

from collections.abc import Mapping
from copy import copy
from typing import Any

import numpy as np

from simbev_ros.reference_stack.arrays import Floats

_LATERAL_MPS2, _SLOWING_MPS2 = 2.0, 1.3  # comfortable in bends, and before slower parts
_LATERAL_GRIP_MPS2, _SLOWING_GRIP_MPS2 = 4.0, 3.0  # both are at most this by grip
_BEND_M = 3.0  # curvature is that of an arc from so far behind to so far ahead


class RouteLine:
    """A route as polyline, which goes on straight before its first and after its last point.

    Args:
        route: The object ``drive.route`` of /world/scene.
        grip: Friction of the road by that of a dry one.

    Attributes:
        lanes: Id of the lane at each of the N points.
        distance_m: (N,) distances along the route.
        speed_mps: (N,) speeds by limits and bends, low enough before slower parts.
        left_m: (N,) distances to the left of the route.
    """

    def __init__(self, route: Mapping[str, Any], grip: float = 1.0) -> None:
        self._lateral_mps2 = min(_LATERAL_MPS2, _LATERAL_GRIP_MPS2 * grip)
        self._slowing_mps2 = min(_SLOWING_MPS2, _SLOWING_GRIP_MPS2 * grip)
        self.distance_m: Floats = np.array(route["distance_m"], np.float64)
        self.lanes: list[str] = list(route["lane"])
        self._limit_mps: Floats = np.array(route["limit_mps"], np.float64)
        self.left_m: Floats = np.zeros_like(self.distance_m)
        self._lay(np.array([route["x_m"], route["y_m"]], np.float64).T)

    def shifted(self, left_m: Floats, limit_mps: Floats | float = np.inf) -> "RouteLine":
        """The line whose N points are (N,) distances to the left; distances along it are still those of the route.

        Its speeds are at most (N,) ``limit_mps``.
        """
        line = copy(self)
        line.left_m = self.left_m + left_m
        line._limit_mps = np.minimum(self._limit_mps, limit_mps)
        heading = self.headings_at(self.distance_m)
        line._lay(self._points_m + left_m[:, None] * np.stack([-heading[:, 1], heading[:, 0]], axis=1))
        return line

    def _lay(self, points_m: Floats) -> None:
        """Lead through (N, 2) points."""
        self._points_m = points_m
        step_m = np.diff(points_m, axis=0)
        self._heading = step_m / np.linalg.norm(step_m, axis=1)[:, None]
        self._yaw_rad = yaw_rad = np.unwrap(np.arctan2(self._heading[:, 1], self._heading[:, 0]))
        self._middle_m = (self.distance_m[1:] + self.distance_m[:-1]) / 2.0
        ahead, behind = (np.interp(self.distance_m + d, self._middle_m, yaw_rad) for d in (_BEND_M, -_BEND_M))
        bend_pm = np.abs(ahead - behind) / (2.0 * _BEND_M)
        self.speed_mps: Floats = np.minimum(self._limit_mps, np.sqrt(self._lateral_mps2 / np.maximum(bend_pm, 1e-6)))
        for row in range(len(self.distance_m) - 2, -1, -1):
            gain = 2.0 * self._slowing_mps2 * (self.distance_m[row + 1] - self.distance_m[row])
            self.speed_mps[row] = min(self.speed_mps[row], (self.speed_mps[row + 1] ** 2 + gain) ** 0.5)

    def points_at(self, distance_m: Floats) -> Floats:
        """(M, 2) points at (M,) distances along the route."""
        row = np.clip(np.searchsorted(self.distance_m, distance_m) - 1, 0, len(self._heading) - 1)
        share = (distance_m - self.distance_m[row]) / (self.distance_m[row + 1] - self.distance_m[row])
        points_m: Floats = self._points_m[row] + share[:, None] * (self._points_m[row + 1] - self._points_m[row])
        return points_m

    def axles_at(self, distance_m: Floats, behind_m: float) -> Floats:
        """(M, 2) rear axles, so far behind the centers, of a vehicle with its center on the route at (M,) distances."""
        yaw_rad = np.interp(distance_m, self._middle_m, self._yaw_rad)
        axles_m: Floats = self.points_at(distance_m) - behind_m * np.stack([np.cos(yaw_rad), np.sin(yaw_rad)], axis=1)
        return axles_m

    def headings_at(self, distance_m: Floats) -> Floats:
        """(M, 2) unit vectors along the route at (M,) distances."""
        row = np.clip(np.searchsorted(self.distance_m, distance_m) - 1, 0, len(self._heading) - 1)
        headings: Floats = self._heading[row]
        return headings

    def project(self, points_m: Floats, from_m: float, to_m: float) -> tuple[Floats, Floats]:
        """Distances along the route, (M,), and to its left, (M,), of (M, 2) points.

        Only the part of the route between two distances is searched. Points before or behind it have infinite
        distances to the left.
        """
        first, last = np.searchsorted(self.distance_m, (from_m, to_m)).tolist()
        first = min(max(first - 1, 0), len(self._heading) - 1)
        last = min(max(last, first + 1), len(self._heading))
        offset_m = points_m[:, None] - self._points_m[None, first:last]
        heading = self._heading[first:last]
        length_m = np.diff(self.distance_m[first : last + 1])
        along_m = np.einsum("mni,ni->mn", offset_m, heading)
        low_m = np.where(np.arange(first, last) > 0, 0.0, -np.inf)
        high_m = np.where(np.arange(first, last) < len(self._heading) - 1, length_m, np.inf)
        inside_m = np.clip(along_m, low_m, high_m)
        gap_m = np.linalg.norm(offset_m - inside_m[..., None] * heading, axis=2)
        row, every = np.argmin(gap_m, axis=1), np.arange(len(points_m))
        left_m = heading[row, 0] * offset_m[every, row, 1] - heading[row, 1] * offset_m[every, row, 0]
        at_m = along_m[every, row]
        outside = ((row == 0) & (at_m < low_m[0])) | ((row == len(length_m) - 1) & (at_m > high_m[-1]))
        return self.distance_m[first + row] + inside_m[every, row], np.where(outside, np.inf, left_m)
