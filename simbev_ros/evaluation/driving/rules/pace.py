"""Too little speed for the traffic, and scenarios that are not passed in time."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from simbev_ros.evaluation.driving.infractions import Infraction, InfractionKind
from simbev_ros.evaluation.driving.moment import Moment
from simbev_ros.foundation.semantics import Tag
from simbev_ros.schema.scene.drive_spec import DriveSpec
from simbev_ros.schema.scene.route_progress import STANDING_MPS
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, Behavior

SPEED_CHECKS = 20
"""Speed checks on a route, one for every 5 % of the distance to the goal (Bench2Drive)."""

_CHECKS_PER_INFRACTION = 5  # CARLA's leaderboard checks four times
_NEARBY_M = 50.0
_STARTING_MPS2 = 2.0  # CARLA's traffic starts from rest together with the ego; here it is under way
_TRAFFIC = (Tag.CAR, Tag.TRUCK, Tag.BUS, Tag.MOTORCYCLE)
_SCENARIO_M, _SCENARIO_S = 100.0, 240.0  # CARLA's leaderboard: four minutes


class SpeedSums(NamedTuple):
    """Sums over the ticks with traffic nearby: speeds of the ego, and mean speeds of the traffic, m/s."""

    ego: float
    traffic: float

    def ratio_since(self, before: "SpeedSums") -> float | None:
        """Mean speed of the ego divided by that of the traffic since a check; None: there was none that moved."""
        ego, traffic = self.ego - before.ego, self.traffic - before.traffic
        return ego / traffic if traffic > STANDING_MPS else None


class SpeedRule:
    """Compares the speed of the ego with that of the traffic within 50 m, from one check to the next.

    The traffic counts as if it had started from rest at tick 0, as the ego does.

    Attributes:
        checks: Sums at the start and at each check that the ego has reached.
    """

    def __init__(self, spec: SceneSpec, drive: DriveSpec) -> None:
        self._spacing_m = (drive.route.length_m - drive.goal_radius_m) / SPEED_CHECKS
        standing = [EGO_ID + k for k, vehicle in enumerate(spec.vehicles) if vehicle.stands_at is not None]
        self._standing, self._sums = np.array(standing, np.int64), SpeedSums(0.0, 0.0)
        self.checks = [self._sums]

    def judge(self, moment: Moment) -> Iterator[Infraction]:
        """Yield a quarter of the route on which the ego was slower than the traffic."""
        others = moment.others
        counts = np.isin(others["tag"], _TRAFFIC) & (others["behavior"] & Behavior.PARKED == 0)
        counts &= ~np.isin(others["id"], self._standing)
        near = others[counts & (np.hypot(*moment.seen_from_ego(others).T) < _NEARBY_M)]
        if len(near):
            traffic_mps = float(np.hypot(near["vx"], near["vy"]).mean())
            traffic_mps = min(traffic_mps, _STARTING_MPS2 * moment.state.tick * moment.tick_s)
            self._sums = SpeedSums(self._sums.ego + moment.speed_mps, self._sums.traffic + traffic_mps)
        while len(self.checks) <= SPEED_CHECKS and moment.distance_m >= len(self.checks) * self._spacing_m - 1e-6:
            self.checks.append(self._sums)
            if (len(self.checks) - 1) % _CHECKS_PER_INFRACTION == 0:
                ratio = self._sums.ratio_since(self.checks[-1 - _CHECKS_PER_INFRACTION])
                if ratio is not None and ratio < 1.0:
                    yield moment.infraction(InfractionKind.MIN_SPEED, ratio)


class ScenarioRule:
    """Yields events that the ego has not left behind four minutes after it met them."""

    def __init__(self, drive: DriveSpec) -> None:
        self._waiting = [(event.kind.value, event.trigger_m) for event in drive.events]
        self._met: list[tuple[str, float, float]] = []

    def judge(self, moment: Moment) -> Iterator[Infraction]:
        """Yield the events that take too long."""
        now_s = moment.state.tick * moment.tick_s
        self._met += [(kind, at_m, now_s) for kind, at_m in self._waiting if moment.distance_m >= at_m]
        self._waiting = [each for each in self._waiting if moment.distance_m < each[1]]
        self._met = [each for each in self._met if moment.distance_m < each[1] + _SCENARIO_M]
        for late in [each for each in self._met if now_s - each[2] >= _SCENARIO_S]:
            self._met.remove(late)
            yield moment.infraction(InfractionKind.SCENARIO_TIMEOUT, now_s - late[2], late[0])
