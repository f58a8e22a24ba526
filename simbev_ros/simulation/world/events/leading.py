"""A vehicle that leads the ego along its route, and then brakes: hard, or to a crawl on a bend."""

from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.world.events.motion import EgoOnRoute, EventMotion

_LENGTH_M = 5.0
_CLOSE_RATE_HZ = 0.4  # change of speed per meter of gap
_CRAWL_MPS = 1.0  # it never stands for an ego that does not come: nobody may wait for it forever
_MAX_GAP_FACTOR = 2.0  # it brakes only while the ego is near enough


class Leading(EventMotion):
    """``hard_brake`` and ``slow_vehicle``: the gap grows with the ego's speed, until the vehicle brakes."""

    _held_s = 0.0

    def begins(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Keep the gap to the ego."""
        gap_m = max(float(along_m[0]) - _LENGTH_M - ego.front_m, 0.0)
        wanted_m = self._stage["gap_m"] + self._stage["gap_s"] * ego.speed_mps
        self._limit_speed(max(ego.speed_mps + _CLOSE_RATE_HZ * (wanted_m - gap_m), _CRAWL_MPS))
        return gap_m < _MAX_GAP_FACTOR * wanted_m

    def advance(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Brake, hold the speed for a while, and drive on."""
        goal_mps = self._stage["speed_mps"]
        speed_mps = self._accelerate(goal_mps, self._stage["decel_mps2"], heeds_leaders=goal_mps > 0.0)
        self._held_s += self._stage.tick_s * (speed_mps <= goal_mps + 0.5)
        return self._held_s >= self._stage["hold_s"] and self._release()
