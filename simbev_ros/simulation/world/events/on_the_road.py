"""What meets the ego on its lane: a vehicle that stands there, one with blue lights from behind, or fog."""

from collections.abc import Mapping

from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.world.events.motion import EgoOnRoute, EventMotion, Stage
from simbev_ros.simulation.world.lights import HAZARD_LIGHTS

_PASSED_M, _LEAVING_M = 15.0, 45.0


class BlockedLane(EventMotion):
    """``blocked_lane``: a vehicle stands in the lane for the whole scene, with its hazard lights on."""

    is_held = True
    _is_noticed = False

    def __init__(self, stage: Stage) -> None:
        """Switch the lights on."""
        super().__init__(stage)
        stage.sumo.given.blinkers[self._vehicle] = HAZARD_LIGHTS

    def advance(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Stand until the ego has passed, and then, too; SUMO's driver would not leave a lane that alone leads on."""
        if not self._is_noticed and ego.front_m > self._stage["at_m"] - _LEAVING_M:
            self._is_noticed = True
            self._stage.sumo.leave_lane(0)
        return ego.front_m > self._stage["at_m"] + _PASSED_M


class Pursuing(EventMotion):
    """``emergency_vehicle``: it waits behind the ego's start, follows fast, and is over when it has passed."""

    is_held = True

    def advance(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Drive as its driver likes, until the ego is behind."""
        self._limit_speed(None)
        return float(along_m[0]) > ego.front_m + _PASSED_M


class FogBank(EventMotion):
    """``fog_bank``: fog comes within seconds, and goes when the ego has driven through."""

    _before: Mapping[str, float] | None = None

    def advance(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Bring the fog, and take it away behind the ego's end of it."""
        if self._before is None:
            now = self._stage.weather.at(self._stage.next_tick())
            self._before = {"fog_density": now.fog_density, "fog_distance_m": now.fog_distance_m}
            self._change({"fog_density": self._stage["fog_density"], "fog_distance_m": 0.0})
        if ego.front_m < self._stage["at_m"] + self._stage["length_m"]:
            return False
        self._change(self._before)
        return True

    def _change(self, parameters: Mapping[str, float]) -> None:
        """Change the weather over the time of the ramp."""
        ticks = max(1, round(self._stage["ramp_s"] / self._stage.tick_s))
        self._stage.weather.change(parameters, self._stage.next_tick(), ticks)
