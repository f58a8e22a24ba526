"""A vehicle that comes into the ego's path in a junction, at the moment at which the ego arrives there."""

from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.world.events.motion import EgoOnRoute, EventMotion, travel_s

_MPS2 = 3.0
_BEYOND_M = 25.0  # driven beyond the meeting point before its driver drives on


class Crossing(EventMotion):
    """``red_light_runner``, ``unprotected_left``, ``merge``, ``roundabout`` and ``cyclist_at_right_turn``.

    It waits, drives off when the ego would otherwise arrive first, and yields to nobody.
    """

    is_held = True
    _driven_m = 0.0

    def begins(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Whether it must drive off now, to arrive with the ego."""
        needed_s = travel_s(self._stage["run_m"], self._stage["speed_mps"], _MPS2) + self._stage["lead_s"]
        return ego.arrival_s(self._stage["at_m"]) <= needed_s

    def advance(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Drive through the junction and a little further."""
        has_met = self._driven_m > self._stage["run_m"]
        self._driven_m += self._accelerate(self._stage["speed_mps"], _MPS2, has_met) * self._stage.tick_s
        return self._driven_m >= self._stage["run_m"] + _BEYOND_M and self._release()
