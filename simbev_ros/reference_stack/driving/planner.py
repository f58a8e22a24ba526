"""The planner: where a vehicle will be along its route in the next seconds.

It follows the route's center line at the speeds of ``RouteLine``, behind what is ahead by the Intelligent Driver Model
(Treiber et al., Physical Review E 62, 2000), up to lines where it has to stop, and lets pass what would cross its path
at the time at which it gets there itself. ``passing`` leads it around what blocks its lane. Others are predicted with
constant turn rate, and deceleration until they stand.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from simbev_ros.reference_stack.arrays import Floats
from simbev_ros.reference_stack.driving.keeping_clear import KeepingClear
from simbev_ros.reference_stack.driving.others import Occupied, Others
from simbev_ros.reference_stack.driving.passing import Passing
from simbev_ros.reference_stack.driving.route_line import RouteLine

_SPEEDING_UP_MPS2, _BRAKING_MPS2, _MAX_BRAKING_MPS2 = 1.5, 2.0, 7.5
_GRIP_MPS2, _COMFORT_GRIP_MPS2 = 7.8, 5.0  # maximum by grip of emergency braking, and of all that is comfortable
_JERK_MPS3, _EMERGENCY_JERK_MPS3 = 3.0, 40.0
_EMERGENCY_MPS2, _EMERGENCY_SHARE = 3.5, 0.8  # braking, and its share of the maximum, that is an emergency
_HEADWAY_S, _GAP_M = 1.3, 2.5
_SEEN_M, _HORIZON_S, _STEP_S = 80.0, 4.0, 0.5
_BEFORE_S, _AFTER_S = 1.2, 0.8  # time that stays between the vehicle and what crosses its path
_MARGIN_M, _STOP_M = 0.35, 1.0  # beside others, and before lines and crossing paths
_PLANNED_S = 3.0


class Lead(NamedTuple):
    """Something ahead on the path: distance from the front of the vehicle, and speed along the route."""

    gap_m: float
    speed_mps: float


class Motion(NamedTuple):
    """A planned motion: (K,) distances along the route, (K,) speeds and (K,) accelerations at multiples of a tick."""

    distance_m: Floats
    speed_mps: Floats
    acceleration_mps2: Floats

    def time_at(self, distance_m: float, tick_s: float) -> float:
        """Time at which a distance is reached; infinite: not within the plan."""
        reached = np.flatnonzero(self.distance_m >= distance_m)
        return float(reached[0]) * tick_s if len(reached) else np.inf


class Planner:
    """Plans tick by tick for one vehicle in one scene.

    Args:
        line: The route.
        length_m: Length of the vehicle.
        width_m: Its width.
        tick_s: Time between planned positions, and between two calls.
        beside_m: (N, K) distances to the left of the route's points of lanes in which to pass what blocks its lane, in
            order of preference; NaN: there is none.
        room_m: (N,) how far the vehicle may be off the route's points to either side; None: it stays on them.
        grip: Friction of the road by that of a dry one.

    Attributes:
        line: The line that the vehicle follows: the route, but for what it passes.
    """

    def __init__(
        self,
        line: RouteLine,
        length_m: float,
        width_m: float,
        tick_s: float,
        beside_m: Floats | None = None,
        room_m: Floats | None = None,
        grip: float = 1.0,
    ) -> None:
        self.line, self._length_m, self._width_m, self._tick_s = line, length_m, width_m, tick_s
        self._max_braking_mps2 = min(_MAX_BRAKING_MPS2, _GRIP_MPS2 * grip)
        self._braking_mps2 = min(_BRAKING_MPS2, _COMFORT_GRIP_MPS2 * grip)
        self._speeding_up_mps2 = min(_SPEEDING_UP_MPS2, _COMFORT_GRIP_MPS2 * grip)
        self._emergency_mps2 = min(_EMERGENCY_MPS2, _EMERGENCY_SHARE * self._max_braking_mps2)
        beside_m = np.empty((0, 0)) if beside_m is None else beside_m
        keeping_clear = KeepingClear(line, width_m, room_m, self._max_braking_mps2)
        self._passing = Passing(keeping_clear, line, length_m, width_m, tick_s, beside_m)
        self._distance_m = self._acceleration_mps2 = 0.0

    def advance_to(self, position_m: Floats) -> float:
        """Distance along the route of the vehicle's center, (2,), of which the last one was near."""
        found_m, _ = self.line.project(position_m[None], self._distance_m - 10.0, self._distance_m + 30.0)
        self._distance_m = float(found_m[0])
        return self._distance_m

    def plan(self, speed_mps: float, others: Others, stops_m: Sequence[float]) -> Motion:
        """Plan from the position of the last ``advance_to``.

        Args:
            speed_mps: Speed of the vehicle.
            others: All others, without the vehicle.
            stops_m: Distances along the route of lines before which to stop.
        """
        self.line, wait_m = self._passing.line_at(self._distance_m, speed_mps, others)
        free = self._rollout(speed_mps, [], np.inf)
        front_m = self._distance_m + self._length_m / 2.0
        stops = [stop_m for stop_m in stops_m if stop_m - front_m > speed_mps**2 / (2.0 * self._max_braking_mps2) - 0.5]
        found = list(self._constraints(others, free, speed_mps))
        stops += [each for each in found if not isinstance(each, Lead)]
        leads = [each for each in found if isinstance(each, Lead)]
        motion = self._rollout(speed_mps, leads, min([wait_m, *(stop_m - _STOP_M for stop_m in stops)]))
        self._acceleration_mps2 = float(motion.acceleration_mps2[0])
        return motion

    def _constraints(self, others: Others, free: Motion, speed_mps: float) -> Iterator[Lead | float]:
        """Yield what is ahead, and the distances along the route where the paths of others begin to cross."""
        near_m = self.line.points_at(np.array([self._distance_m]))[0]
        others = others.chosen(np.linalg.norm(others.position_m - near_m, axis=1) < _SEEN_M)
        time_s = np.arange(0.0, _HORIZON_S + 1e-9, _STEP_S)
        window_m, path_m = (self._distance_m - 25.0, self._distance_m + _SEEN_M), self._width_m + 2.0 * _MARGIN_M
        begins_m, ends_m, on_path, speed_along_mps, _ = Occupied.by(others, self.line, window_m, time_s, path_m)
        front_m = self._distance_m + self._length_m / 2.0
        for row in np.flatnonzero(on_path.any(axis=1)).tolist():
            begin_m, end_m = begins_m[row], ends_m[row]
            now_m, along_mps = float(begin_m[0]) - front_m, float(speed_along_mps[row])
            is_ahead = begin_m[0] + end_m[0] > 2.0 * self._distance_m and now_m > -0.5 * self._length_m
            follows = along_mps > max(1.0, 0.8 * float(np.linalg.norm(others.velocity_mps[row])))
            if on_path[row, 0] or (follows and is_ahead):
                if is_ahead:
                    yield Lead(now_m, max(along_mps, 0.0))
                continue
            if follows and along_mps > speed_mps:
                continue  # it overtakes, and is ahead when it is on the path
            conflict = self._conflict(free, begin_m[on_path[row]], end_m[on_path[row]], time_s[on_path[row]])
            if conflict is not None and conflict - front_m > speed_mps**2 / (2.0 * self._max_braking_mps2):
                yield conflict

    def _conflict(self, free: Motion, begin_m: Floats, end_m: Floats, time_s: Floats) -> float | None:
        """Where a path begins to cross that of the vehicle if both would be there at a time; None: they do not meet.

        Args:
            free: Motion of the vehicle if nobody were there.
            begin_m: (T,) distances along the route from which on the other is on the path.
            end_m: (T,) distances up to which it is.
            time_s: (T,) their times.
        """
        ahead = end_m > self._distance_m - self._length_m / 2.0
        if not ahead.any():
            return None
        low_m, high_m = float(begin_m[ahead].min()), float(end_m[ahead].max())
        from_s, to_s = float(time_s[ahead].min()) - _STEP_S / 2.0, float(time_s[ahead].max()) + _STEP_S / 2.0
        arrives_s = free.time_at(low_m - self._length_m / 2.0, self._tick_s)
        leaves_s = free.time_at(high_m + self._length_m / 2.0, self._tick_s)
        meets = arrives_s < to_s + _AFTER_S and leaves_s > from_s - _BEFORE_S
        return low_m if meets and arrives_s < np.inf else None

    def _rollout(self, speed_mps: float, leads: Sequence[Lead], stop_m: float) -> Motion:
        """Simulate the vehicle with leads at constant speeds, up to a distance along the route for its front."""
        tick_s, distance_m, acceleration = self._tick_s, self._distance_m, self._acceleration_mps2
        rows = [(distance_m, speed_mps, acceleration)]
        for tick in range(round(_PLANNED_S / tick_s)):
            limit_mps = float(np.interp(distance_m + 0.3 * speed_mps, self.line.distance_m, self.line.speed_mps))
            wanted = min(max((limit_mps - speed_mps) / 0.8, -self._max_braking_mps2), self._speeding_up_mps2)
            for gap_m, other_mps in leads:
                left_m = gap_m + other_mps * tick * tick_s - (distance_m - self._distance_m)
                wanted = min(wanted, self._following_mps2(speed_mps, other_mps, left_m))
            wanted = min(wanted, self._stopping_mps2(speed_mps, stop_m - distance_m - self._length_m / 2.0))
            jerk = _EMERGENCY_JERK_MPS3 if wanted < -self._emergency_mps2 else _JERK_MPS3
            acceleration = max(min(wanted, acceleration + jerk * tick_s), acceleration - jerk * tick_s)
            acceleration = max(acceleration, -speed_mps / tick_s)
            speed_mps += acceleration * tick_s
            distance_m += speed_mps * tick_s
            rows.append((distance_m, speed_mps, acceleration))
        found = np.array(rows)
        return Motion(found[:, 0], found[:, 1], found[1:, 2])

    def _following_mps2(self, speed_mps: float, other_mps: float, gap_m: float) -> float:
        """Acceleration behind something, without the term of the free road; what is faster opens its gap by itself."""
        gap_m += max(other_mps - speed_mps, 0.0)
        comfort_mps2 = (self._speeding_up_mps2 * self._braking_mps2) ** 0.5
        approach = speed_mps * (speed_mps - other_mps) / (2.0 * comfort_mps2)
        wanted_m = _GAP_M + max(speed_mps * _HEADWAY_S + approach, 0.0)
        return max(self._speeding_up_mps2 * (1.0 - (wanted_m / max(gap_m, 0.1)) ** 2), -self._max_braking_mps2)

    def _stopping_mps2(self, speed_mps: float, left_m: float) -> float:
        """Acceleration before a line; infinite as long as comfortable braking later is enough."""
        if left_m < 0.1:
            return -self._braking_mps2
        needed = speed_mps**2 / (2.0 * left_m)
        return -needed if needed > 0.6 * self._braking_mps2 else np.inf


def ends_of(lanes: Sequence[str], distance_m: Floats, wanted: frozenset[str]) -> list[tuple[str, float]]:
    """The wanted lanes of a route that it leaves again, and the distances along it of their ends."""
    return [
        (before, float(distance_m[row]))
        for row, (before, after) in enumerate(pairwise(lanes))
        if before != after and before in wanted
    ]
