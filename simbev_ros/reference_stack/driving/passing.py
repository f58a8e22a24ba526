"""Passing: the line around what stands in the lane of a route without a visible reason, in a free lane beside it.

What stands close before a junction, or behind something that moves, waits.
"""

from itertools import product

import numpy as np

from simbev_ros.reference_stack.arrays import Booleans, Floats
from simbev_ros.reference_stack.driving.keeping_clear import KeepingClear
from simbev_ros.reference_stack.driving.others import Occupied, Others
from simbev_ros.reference_stack.driving.route_line import RouteLine

_STANDING_MPS, _TRY_S = 0.2, 0.5
_CHANGE, _ASIDE = (6.0, 7.5), (1.0, 1.0)  # time to wait and gap to swing out, to another lane and partly
_CHANGE_BACK_M, _ASIDE_BACK_M = (25.0, 14.0), (14.0, 7.0)  # along the route back from there
_ASIDE_M, _STEP_M = 1.0, 0.05  # to the side: maximum without a change of lanes, and margin beyond what is in the path
_QUEUE_M = 12.0  # gap up to which one waits for the other
_SEEN_M, _NEAR_M = 80.0, 45.0  # ahead: what is looked at, and what is passed
_KEEP_M = 10.0  # before what stands, for room to swing out
_OUT_M, _OUT_S = 14.0, 2.5  # along the route from lane to lane: minimum and by speed
_CLEAR_M, _SIDE_M, _BLOCK_M = 1.5, 0.5, 0.35  # behind what is passed, beside others, and beside what does not block
_MARGIN_M, _MARGIN_S = 4.0, 1.0  # from others in the path, and by the difference of speeds
_SPEEDING_UP_MPS2, _BRAKING_MPS2 = 1.5, 2.0


class Passing:
    """Follows one vehicle along one route, in its lane by ``KeepingClear``; arguments are those of ``Planner``."""

    def __init__(
        self,
        keeping_clear: KeepingClear,
        route: RouteLine,
        length_m: float,
        width_m: float,
        tick_s: float,
        beside_m: Floats,
    ) -> None:
        self._keeping_clear, self._beside_m, self._length_m, self._tick_s = keeping_clear, beside_m, length_m, tick_s
        self._width_m, self._path_m = width_m, width_m + 2.0 * _SIDE_M
        self._until_m, self._line = -np.inf, route
        self._block_m, self._ticks = (np.nan, np.nan), 0

    def line_at(self, distance_m: float, speed_mps: float, others: Others) -> tuple[RouteLine, float]:
        """The line to follow now, and the distance along it at which to wait for room to pass; infinite: do not wait.

        Args:
            distance_m: Distance along the route of the vehicle's center.
            speed_mps: Its speed.
            others: All others.
        """
        if distance_m < self._until_m:
            return self._line, np.inf
        kept = self._keeping_clear.line_at(distance_m, speed_mps, others)
        if not self._beside_m.size:
            return kept, np.inf
        window_m, path_m = (distance_m - 25.0, distance_m + _SEEN_M), self._width_m + 2.0 * _BLOCK_M
        now = Occupied.by(others, kept, window_m, np.zeros(1), path_m)
        begin_m, end_m, on_path = now.begin_m[:, 0], now.end_m[:, 0], now.on_path[:, 0]
        block_m = _block(on_path & (begin_m > distance_m), begin_m, end_m, np.linalg.norm(others.velocity_mps, axis=1))
        stands = np.abs(np.subtract(block_m, self._block_m)).max() < 0.5
        self._line, self._ticks = kept, self._ticks + 1 if stands else 0
        self._block_m = self._block_m if stands else block_m
        blocks = on_path & (begin_m < block_m[1]) & (end_m > block_m[0])
        aside_m = self._aside_m(now.left_m[blocks, 0])
        ways = self._ways(kept, distance_m, speed_mps, *block_m, aside_m) if np.isfinite(block_m[0]) else []
        gap_m = block_m[0] - distance_m - self._length_m / 2.0
        waited_s, tries = self._ticks * self._tick_s, self._ticks % max(round(_TRY_S / self._tick_s), 1) == 0
        for line, until_m, (patience_s, min_gap_m) in ways if tries and gap_m < _NEAR_M else []:
            rest = others.chosen(~on_path | (begin_m > block_m[1]))
            is_due = waited_s >= patience_s and gap_m > min_gap_m
            if is_due and self._is_free(line, rest, distance_m, speed_mps, until_m):
                self._line, self._until_m = line, until_m
                return line, np.inf
        waits = ways and gap_m - _KEEP_M > speed_mps**2 / (2.0 * _BRAKING_MPS2) - 0.5
        return kept, block_m[0] - _KEEP_M if waits else np.inf

    def _aside_m(self, near_m: Floats) -> float:
        """Distance to the left to pass obstacles whose (N,) near sides are all on one side; NaN: it changes lanes."""
        lacking_m = self._width_m / 2.0 + _BLOCK_M + _STEP_M - np.abs(near_m)
        if not len(near_m) or np.ptp(np.sign(near_m)) or lacking_m.max() > _ASIDE_M:
            return np.nan
        return float(-np.sign(near_m[0]) * lacking_m.max())

    def _ways(
        self, kept: RouteLine, distance_m: float, speed_mps: float, begin_m: float, end_m: float, aside_m: float
    ) -> list[tuple[RouteLine, float, tuple[float, float]]]:
        """Lines around a part of a line, with the distances at which they are back on it, in order of preference.

        Each comes with the time to wait and the gap that it needs.
        """
        along_m, ways = kept.distance_m, []
        lanes = self._beside_m.T
        asides = [np.where(each * aside_m > 0.0, kept.left_m + aside_m, np.nan) for each in lanes]
        choices = [*product(asides, [_ASIDE], _ASIDE_BACK_M), *product(lanes, [_CHANGE], _CHANGE_BACK_M)]
        swing_m = begin_m - min(max(_OUT_M, _OUT_S * speed_mps), max(begin_m - distance_m, 0.1))
        clear_m = end_m + self._length_m / 2.0 + _CLEAR_M
        for beside_m, needs, back_m in choices:
            until_m = clear_m + back_m
            part = (along_m > swing_m) & (along_m < until_m)
            if until_m < along_m[-1] and np.isfinite(beside_m[part]).all():
                share = np.interp(along_m, [swing_m, begin_m, clear_m, until_m], [0.0, 1.0, 1.0, 0.0])
                left_m = (1.0 - np.cos(np.pi * share)) / 2.0 * np.where(part, beside_m - kept.left_m, 0.0)
                ways.append((kept.shifted(left_m), until_m, needs))
        return ways

    def _is_free(self, line: RouteLine, others: Others, distance_m: float, speed_mps: float, until_m: float) -> bool:
        """Whether nobody comes near a vehicle that drives off along a line now, until it is back on the route."""
        own_m = np.arange(distance_m, until_m)
        limit_mps = np.interp(own_m, line.distance_m, line.speed_mps)
        own_mps = np.minimum(np.sqrt(speed_mps**2 + 2.0 * _SPEEDING_UP_MPS2 * (own_m - distance_m + 0.5)), limit_mps)
        time_s = np.cumsum(1.0 / own_mps)
        them = Occupied.by(others, line, (distance_m - _SEEN_M, until_m + _SEEN_M), time_s, self._path_m)
        apart_m = self._length_m / 2.0 + _MARGIN_M + _MARGIN_S * np.abs(own_mps - them.along_mps[:, None])
        meets = them.on_path & (them.begin_m < own_m + apart_m) & (them.end_m > own_m - apart_m)
        return bool(speed_mps < limit_mps[0] + 1.0 and not meets.any())


def _block(ahead: Booleans, begin_m: Floats, end_m: Floats, speed_mps: Floats) -> tuple[float, float]:
    """The part of the route that the first ones ahead occupy; NaN: there is nobody, or one of them moves."""
    block_m = np.nan, np.nan
    for row in sorted(np.flatnonzero(ahead).tolist(), key=begin_m.tolist().__getitem__):
        if begin_m[row] > block_m[1] + _QUEUE_M:
            break
        if speed_mps[row] > _STANDING_MPS:
            return np.nan, np.nan
        block_m = float(np.fmin(block_m[0], begin_m[row])), float(np.fmax(block_m[1], end_m[row]))
    return block_m
