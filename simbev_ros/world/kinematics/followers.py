"""Points that follow SUMO's as bodies can: none of them jumps, and each knows the way it came."""

import numpy as np

from simbev_ros.types import Float64Array

_MAKING_UP = 0.1  # metres to the side or along, per metre driven
_SPACING_M = 0.25
_ARRIVED_M = 1e-4


class Pursuit:
    """Points that run after targets as people do: no faster than they can, and so that they can stop where these stop.

    A target's jump becomes a stretch of way, its sharp corner a bend.

    Attributes:
        position_m: (G, 3) where they are.
    """

    def __init__(self, target_m: Float64Array, reach_m: Float64Array, change_m: float) -> None:
        """At the (G, 3) targets, at rest.

        Args:
            target_m: (G, 3) targets.
            reach_m: (G,) longest way in one tick.
            change_m: By so much at most the way of a tick differs from the last one.
        """
        self.position_m = target_m.copy()
        self._step_m = np.zeros((len(target_m), 2))
        self._reach_m = reach_m
        self._change_m = change_m

    def advance(self, target_m: Float64Array) -> Float64Array:
        """(G, 3) points one tick later; exactly the targets where these have been standing for long enough."""
        way_m = (target_m - self.position_m)[:, :2]
        distance_m = np.linalg.norm(way_m, axis=1)
        # Of n ticks to a stop, each shorter by the same, the first one takes 2 n of the n (n + 1) parts of the way.
        ticks = np.sqrt(0.25 + 2.0 * distance_m / self._change_m) - 0.5
        wanted_m = np.minimum(self._reach_m, distance_m * np.minimum(1.0, 2.0 / (ticks + 1.0)))
        wanted_m = way_m * (wanted_m / np.maximum(distance_m, 1e-9))[:, None]
        change_m = wanted_m - self._step_m
        share = np.minimum(1.0, self._change_m / np.maximum(np.linalg.norm(change_m, axis=1), 1e-9))
        self._step_m = self._step_m + share[:, None] * change_m
        arrives = np.linalg.norm(way_m - self._step_m, axis=1) < _ARRIVED_M
        self._step_m = np.where(arrives[:, None], way_m, self._step_m)
        point_m = self.position_m + np.column_stack([self._step_m, target_m[:, 2] - self.position_m[:, 2]])
        self.position_m = np.where(arrives[:, None], target_m, point_m)
        return self.position_m


class Steady:
    """Points that follow targets as vehicles can: where a target jumps, they go on and make up for it on their way."""

    def __init__(self, target_m: Float64Array, most_change_m: float) -> None:
        """At the (G, 3) targets, at rest; by ``most_change_m`` at most the way of a tick differs from the last one."""
        self._target_m = target_m
        self._most_change_m = most_change_m
        self._step_m = np.zeros((len(target_m), 2))
        self._offset_m = np.zeros((len(target_m), 2))

    def advance(self, target_m: Float64Array) -> Float64Array:
        """(G, 3) points one tick later; exactly the targets of those that did not jump lately."""
        step_m = (target_m - self._target_m)[:, :2]
        change_m = step_m - self._step_m
        share = self._most_change_m / np.maximum(np.linalg.norm(change_m, axis=1), 1e-9)
        possible_m = np.where((share < 1.0)[:, None], self._step_m + share[:, None] * change_m, step_m)
        offset_m = self._offset_m + (possible_m - step_m)
        distance_m = np.linalg.norm(offset_m, axis=1)
        made_up_m = np.minimum(distance_m, _MAKING_UP * np.linalg.norm(possible_m, axis=1))
        self._offset_m = offset_m * (1.0 - made_up_m / np.maximum(distance_m, 1e-9))[:, None]
        self._target_m, self._step_m = target_m, possible_m
        point_m = target_m.copy()
        point_m[:, :2] += self._offset_m
        return point_m


class Tow:
    """Points that go the same ways as their leaders, each a fixed distance behind."""

    def __init__(self, lead_m: Float64Array, direction: Float64Array, behind_m: Float64Array) -> None:
        """(G, 3) leaders that have come straight along (G, 3) unit vectors; (G,) distances behind them."""
        self._behind_m = behind_m
        count = int(np.ceil(behind_m.max(initial=0.0) / _SPACING_M)) + 2
        back_m = _SPACING_M * np.arange(1, count + 1)
        self._trail_m: Float64Array = lead_m[:, None] - back_m[:, None] * direction[:, None]

    def advance(self, lead_m: Float64Array) -> Float64Array:
        """(G, 3) points one tick later; exactly the leaders where these are 0 m ahead."""
        trail_m = np.concatenate([lead_m[:, None], self._trail_m], axis=1)
        length_m = np.linalg.norm(np.diff(trail_m, axis=1), axis=2)
        goes_on = length_m[:, 0] >= _SPACING_M
        self._trail_m = np.where(goes_on[:, None, None], trail_m[:, :-1], self._trail_m)
        way_m = np.cumsum(length_m, axis=1)
        row = np.arange(len(lead_m))
        end = np.argmax(way_m >= self._behind_m[:, None] - 1e-9, axis=1)
        share = 1.0 - (way_m[row, end] - self._behind_m) / np.maximum(length_m[row, end], 1e-9)
        point_m: Float64Array = trail_m[row, end] + share[:, None] * (trail_m[row, end + 1] - trail_m[row, end])
        return point_m
