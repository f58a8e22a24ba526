"""Points that follow SUMO's points the way bodies can: without jumps, and along the path of their leader."""

import numpy as np

from simbev_ros.foundation.types import Float64Array

_CATCH_UP_RATE = 0.1  # meters made up, in any direction, per meter driven
_SPACING_M = 0.25
_ARRIVED_M = 1e-4


class PursuingPoints:
    """Points that pursue targets the way pedestrians do: with limited speed, and able to stop where the target stops.

    A jump of a target becomes a stretch of path, its sharp corner a bend.

    Attributes:
        position_m: (G, 3) current positions.
    """

    def __init__(self, target_m: Float64Array, reach_m: Float64Array, change_m: float) -> None:
        """Start at the (G, 3) targets, at rest.

        Args:
            target_m: (G, 3) targets.
            reach_m: (G,) maximum step per tick.
            change_m: Maximum change of a step from one tick to the next.
        """
        self.position_m = target_m.copy()
        self._step_m = np.zeros((len(target_m), 2))
        self._reach_m = reach_m
        self._max_change_m = change_m

    def pursue(self, target_m: Float64Array) -> Float64Array:
        """(G, 3) points one tick later; exactly the targets once these have stood still for long enough."""
        to_target_m = (target_m - self.position_m)[:, :2]
        distance_m = np.linalg.norm(to_target_m, axis=1)
        # Stopping over n ticks with equally decreasing steps, the first covers 2 n of n (n + 1) parts of the distance.
        ticks = np.sqrt(0.25 + 2.0 * distance_m / self._max_change_m) - 0.5
        desired_m = np.minimum(self._reach_m, distance_m * np.minimum(1.0, 2.0 / (ticks + 1.0)))
        desired_m = to_target_m * (desired_m / np.maximum(distance_m, 1e-9))[:, None]
        change_m = desired_m - self._step_m
        fraction = np.minimum(1.0, self._max_change_m / np.maximum(np.linalg.norm(change_m, axis=1), 1e-9))
        self._step_m = self._step_m + fraction[:, None] * change_m
        has_arrived = np.linalg.norm(to_target_m - self._step_m, axis=1) < _ARRIVED_M
        self._step_m = np.where(has_arrived[:, None], to_target_m, self._step_m)
        point_m = self.position_m + np.column_stack([self._step_m, target_m[:, 2] - self.position_m[:, 2]])
        self.position_m = np.where(has_arrived[:, None], target_m, point_m)
        return self.position_m


class SteadyPoints:
    """Points that follow targets the way vehicles can: when a target jumps they drive on and catch up."""

    def __init__(self, target_m: Float64Array, max_change_m: float) -> None:
        """Start at the (G, 3) targets, at rest; a step may change by ``max_change_m`` from one tick to the next."""
        self._target_m = target_m
        self._max_change_m = max_change_m
        self._step_m = np.zeros((len(target_m), 2))
        self._offset_m = np.zeros((len(target_m), 2))

    def follow(self, target_m: Float64Array) -> Float64Array:
        """(G, 3) points one tick later; exactly the targets that have not jumped recently."""
        step_m = (target_m - self._target_m)[:, :2]
        change_m = step_m - self._step_m
        fraction = self._max_change_m / np.maximum(np.linalg.norm(change_m, axis=1), 1e-9)
        possible_m = np.where((fraction < 1.0)[:, None], self._step_m + fraction[:, None] * change_m, step_m)
        offset_m = self._offset_m + (possible_m - step_m)
        distance_m = np.linalg.norm(offset_m, axis=1)
        catch_up_m = np.minimum(distance_m, _CATCH_UP_RATE * np.linalg.norm(possible_m, axis=1))
        self._offset_m = offset_m * (1.0 - catch_up_m / np.maximum(distance_m, 1e-9))[:, None]
        self._target_m, self._step_m = target_m, possible_m
        point_m = target_m.copy()
        point_m[:, :2] += self._offset_m
        return point_m


class TowedPoints:
    """Points that follow the exact paths of their leaders, each a fixed distance behind."""

    def __init__(
        self, lead_m: Float64Array, direction: Float64Array, behind_m: Float64Array, max_back_m: float = 0.0
    ) -> None:
        """For (G, 3) leaders that have come straight along (G, 3) unit vectors, and (G,) distances behind them.

        Points may fall back by up to ``max_back_m`` more.
        """
        self._behind_m = behind_m
        count = int(np.ceil((behind_m.max(initial=0.0) + max_back_m) / _SPACING_M)) + 2
        back_m = _SPACING_M * np.arange(1, count + 1)
        self._trail_m: Float64Array = lead_m[:, None] - back_m[:, None] * direction[:, None]
        self._length_m = np.linalg.norm(np.diff(self._trail_m, axis=1), axis=2)

    def follow(self, lead_m: Float64Array, back_m: Float64Array) -> tuple[Float64Array, Float64Array]:
        """One tick later, with leaders that have fallen back along their paths by (G,) meters.

        Returns:
            (G, 3) leaders, exactly those given where they have not fallen back, and (G, 3) points, exactly the leaders
            where the distance is 0.
        """
        trail_m = np.concatenate([lead_m[:, None], self._trail_m], axis=1)
        step_m = np.linalg.norm(self._trail_m[:, 0] - lead_m, axis=1)
        length_m = np.concatenate([step_m[:, None], self._length_m], axis=1)
        has_moved = step_m >= _SPACING_M
        self._trail_m[has_moved], self._length_m[has_moved] = trail_m[has_moved, :-1], length_m[has_moved, :-1]
        path_m = np.cumsum(length_m, axis=1)

        def points_behind(behind_m: Float64Array) -> Float64Array:
            row = np.arange(len(lead_m))
            end = np.argmax(path_m >= behind_m[:, None] - 1e-9, axis=1)
            fraction = 1.0 - (path_m[row, end] - behind_m) / np.maximum(length_m[row, end], 1e-9)
            points_m: Float64Array = trail_m[row, end] + fraction[:, None] * (trail_m[row, end + 1] - trail_m[row, end])
            return points_m

        leaders_m = points_behind(back_m) if back_m.any() else lead_m
        return leaders_m, points_behind(self._behind_m + back_m)
