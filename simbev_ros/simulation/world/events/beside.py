"""What happens at the curb: the door of a parked vehicle opens, or a pedestrian comes out from behind it."""

import math

from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.world.events.motion import EgoOnRoute, EventMotion, Stage

_PASSED_M = 15.0
_HALF_LANE_M = 0.5  # from the middle of the lane: the pedestrian is in front of the ego


class OpeningDoor(EventMotion):
    """``opening_door``: the front door of a parked vehicle opens towards the traffic just before the ego is there."""

    def begins(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Whether the ego is about to arrive."""
        return ego.arrival_s(self._stage["at_m"]) < self._stage["lead_s"]

    def advance(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Open the door, until the ego has passed."""
        # Doors 0 and 1 are at the front, to the left and to the right; traffic passes opposite to the curb.
        self._stage.actors.open_doors(self._vehicle, 1 if self._stage["side"] < 0.0 else 2)
        return ego.front_m > self._stage["at_m"] + _PASSED_M


class HiddenPedestrian(EventMotion):
    """``hidden_pedestrian``: it waits on the sidewalk, and is in the ego's lane when the ego arrives."""

    _walks = False

    def __init__(self, stage: Stage) -> None:
        """Let the pedestrian stand."""
        super().__init__(stage)
        self._goal_m = stage["goal_x_m"], stage["goal_y_m"]
        path_m = math.dist(self._goal_m, stage.actors.hold_pedestrian(stage.pedestrians[0])[:2])
        self._to_lane_m = max(path_m - stage["beyond_m"] - _HALF_LANE_M, 0.0)

    def begins(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Whether it must walk now, to arrive in the lane with the ego."""
        needed_s = self._to_lane_m / self._stage["speed_mps"] + self._stage["lead_s"]
        return ego.arrival_s(self._stage["at_m"] + self._stage["ahead_m"]) <= needed_s

    def advance(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Walk across the street."""
        if not self._walks:
            self._stage.actors.walk_across(self._stage.pedestrians[0], self._goal_m)
            self._walks = True
        return ego.front_m > self._stage["at_m"] + self._stage["ahead_m"] + _PASSED_M
