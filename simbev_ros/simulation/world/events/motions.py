"""The motions of all kinds of events; ``route_events`` has the table of kinds."""

import math
from collections.abc import Mapping

from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.world.driving.vehicle_model import road_friction
from simbev_ros.simulation.world.events.motion import EgoOnRoute, EventMotion, Stage, travel_s
from simbev_ros.simulation.world.lights import HAZARD_LIGHTS

_PASSED_M = 15.0
_HALF_LANE_M = 0.5  # from the middle of the lane: the pedestrian is in front of the ego
_CROSSING_MPS2, _BEYOND_M = 3.0, 25.0  # driven beyond the meeting point before its driver drives on
_ROLLING_MPS2, _LENGTH_M = 2.5, 5.0
_MIN_MPS, _LANE_CHANGE_S, _OVER_M = 3.0, 2.5, 30.0
_AVOIDED_MPS2, _AVOIDED_GRIP_MPS2 = 4.0, 5.0  # maximum of braking that an ego needs, and the same by grip
_CLOSE_RATE_HZ = 0.4  # change of speed per meter of gap
_CRAWL_MPS = 1.0  # it never stands for an ego that does not come: nobody may wait for it forever
_MAX_GAP_FACTOR = 2.0  # it brakes only while the ego is near enough
_LEAVING_M = 45.0


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


class Crossing(EventMotion):
    """``red_light_runner``, ``unprotected_left``, ``merge``, ``roundabout`` and ``cyclist_at_right_turn``.

    It waits, drives off when the ego would otherwise arrive first, and yields to nobody.
    """

    is_held = True
    _driven_m = 0.0

    def begins(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Whether it must drive off now, to arrive with the ego."""
        needed_s = travel_s(self._stage["run_m"], self._stage["speed_mps"], _CROSSING_MPS2) + self._stage["lead_s"]
        return ego.arrival_s(self._stage["at_m"]) <= needed_s

    def advance(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Drive through the junction and a little further."""
        has_met = self._driven_m > self._stage["run_m"]
        self._driven_m += self._accelerate(self._stage["speed_mps"], _CROSSING_MPS2, has_met) * self._stage.tick_s
        return self._driven_m >= self._stage["run_m"] + _BEYOND_M and self._release()


class CuttingIn(EventMotion):
    """``cut_in``: it starts to roll as the ego comes, and changes lanes when the ego has almost reached it."""

    is_held = True
    _changing_s = 0.0

    def begins(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Whether it must roll now, to be at its speed with the gap ahead of the ego."""
        own_mps, ego_mps = self._speed_mps(ego), max(ego.speed_mps, 1.0)
        starting_s = own_mps / _ROLLING_MPS2
        made_good_m = (ego_mps - own_mps / 2.0) * starting_s
        made_good_m += (ego_mps - own_mps) ** 2 * (
            0.5 / self._braking_mps2() - 0.5 / _AVOIDED_MPS2
        )  # on slippery roads
        return ego.arrival_s(float(along_m[0]) - _LENGTH_M) < (made_good_m + self._stage["gap_m"]) / ego_mps

    def advance(self, ego: EgoOnRoute, along_m: Float64Array) -> bool:
        """Roll ahead of the ego, then change to its lane."""
        gap_m = float(along_m[0]) - _LENGTH_M - ego.front_m
        closing_mps = ego.speed_mps - self._accelerate(self._speed_mps(ego), _ROLLING_MPS2, heeds_leaders=True)
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
