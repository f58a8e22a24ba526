"""A slower vehicle on the next lane cuts in close in front of the ego."""

from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.world.driving.vehicle_model import road_friction
from simbev_ros.simulation.world.events.motion import EgoOnRoute, EventMotion

_MPS2, _LENGTH_M = 2.5, 5.0
_MIN_MPS, _LANE_CHANGE_S, _OVER_M = 3.0, 2.5, 30.0
_AVOIDED_MPS2, _AVOIDED_GRIP_MPS2 = 4.0, 5.0  # maximum of braking that an ego needs, and the same by grip


class CuttingIn(EventMotion):
    """``cut_in``: it starts to roll as the ego comes, and changes lanes when the ego has almost reached it."""

    is_held = True
    _changing_s = 0.0

    def begins(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Whether it must roll now, to be at its speed with the gap ahead of the ego."""
        own_mps, ego_mps = self._speed_mps(ego), max(ego.speed_mps, 1.0)
        starting_s = own_mps / _MPS2
        made_good_m = (ego_mps - own_mps / 2.0) * starting_s
        made_good_m += (ego_mps - own_mps) ** 2 * (
            0.5 / self._braking_mps2() - 0.5 / _AVOIDED_MPS2
        )  # on slippery roads
        return ego.arrival_s(float(along_m[0]) - _LENGTH_M) < (made_good_m + self._stage["gap_m"]) / ego_mps

    def advance(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Roll ahead of the ego, then change to its lane."""
        gap_m = float(along_m[0]) - _LENGTH_M - ego.front_m
        closing_mps = ego.speed_mps - self._accelerate(self._speed_mps(ego), _MPS2, heeds_leaders=True)
        braking_m = max(closing_mps, 0.0) ** 2 / (2.0 * self._braking_mps2())
        if self._changing_s or gap_m < self._stage["gap_m"] + braking_m:
            if not self._changing_s:
                self._stage.sumo.given.move_aside(self._vehicle, self._stage["left_m"])
            self._changing_s += self._stage.tick_s
        return (self._changing_s >= _LANE_CHANGE_S or gap_m < -_OVER_M) and self._release()

    def _braking_mps2(self) -> float:
        """Braking of the ego that leaves the gap that was drawn."""
        grip = road_friction(self._stage.weather.at(self._stage.next_tick()), with_snow=True)
        return min(_AVOIDED_MPS2, _AVOIDED_GRIP_MPS2 * grip)

    def _speed_mps(self, ego: EgoOnRoute) -> float:
        """Speed with which it cuts in."""
        return max(self._stage["speed_share"] * ego.speed_mps, _MIN_MPS)
