"""Traffic lights, stop signs and emergency vehicles."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from simbev_ros.evaluation.driving.infractions import Infraction, InfractionKind
from simbev_ros.evaluation.driving.moment import Moment, is_beside_in_height
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.layout import SignKind
from simbev_ros.schema.scene.route_progress import STANDING_MPS
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import EGO_ID, Behavior, SignalState

_STOP_ZONE_M = 4.0  # before the line (CARLA)
_MAX_TURN_COS = 0.5
_LEVEL_M = 3.0
_HELD_UP_M, _HELD_UP_S = 25.0, 10.0
_QUEUE_M, _CREEPING_MPS = 5.0, 3.0
_RED = (SignalState.RED, SignalState.RED_YELLOW)


class StopLines:
    """The lines at the ends of lanes, where junctions begin.

    Args:
        lanes: The lanes.
    """

    def __init__(self, lanes: Sequence[Lane]) -> None:
        self.lanes = [lane.id for lane in lanes]
        ends_m = np.array([lane.centerline_m[-1] for lane in lanes]).reshape(-1, 3)
        steps_m = ends_m - np.array([lane.centerline_m[-2] for lane in lanes]).reshape(-1, 3)
        self._ends_m = ends_m
        self._heading = steps_m[:, :2] / np.maximum(np.hypot(*steps_m[:, :2].T), 1e-9)[:, None]
        self._half_width_m = np.array([lane.width_m / 2.0 for lane in lanes])

    def beyond_m(self, point_m: Float64Array) -> Float64Array:
        """(L,) distances of a (2,) point beyond the lines; negative before them."""
        distances_m: Float64Array = np.sum((point_m - self._ends_m[:, :2]) * self._heading, axis=1)
        return distances_m

    def faced(self, moment: Moment, point_m: Float64Array) -> BoolArray:
        """(L,) whether the ego, with a (2,) point of it, is in a lane or behind its end, and moves along it."""
        offset_m = point_m - self._ends_m[:, :2]
        aside_m = self._heading[:, 0] * offset_m[:, 1] - self._heading[:, 1] * offset_m[:, 0]
        on_level = np.abs(self._ends_m[:, 2] - moment.position_m[2]) < _LEVEL_M
        facing: BoolArray = on_level & (np.abs(aside_m) <= self._half_width_m)
        return facing & (self._heading @ moment.ahead > _MAX_TURN_COS)

    def crossed(self, moment: Moment, point_m: Float64Array, before_m: Float64Array) -> Int64Array:
        """Rows of the lines that a (2,) point of the ego crosses with this tick."""
        crosses = (self.beyond_m(before_m) <= 0.0) & (self.beyond_m(point_m) > 0.0)
        return np.flatnonzero(crosses & self.faced(moment, point_m))


class RedLightRule:
    """Yields when the ego enters a junction whose line its front crossed while all lights of the lane were red."""

    def __init__(self, network: RoadNetwork) -> None:
        self._heads: Mapping[str, list[int]] = _heads_by_lane(network)
        self._lines = StopLines([network.lanes[lane] for lane in self._heads])
        self._passed_red_s: dict[int, float] = {}

    def judge(self, moment: Moment) -> Iterator[Infraction]:
        """Yield the red lights that the ego runs."""
        if moment.before is None:
            return
        for row in self._lines.crossed(moment, moment.front_m, moment.before.front_m).tolist():
            heads = moment.state.signals[self._heads[self._lines.lanes[row]]]
            self._passed_red_s.pop(row, None)
            if np.isin(heads["state"], _RED).all():
                self._passed_red_s[row] = float(heads["time_in_state"].min())
        beyond_m = self._lines.beyond_m(moment.position_m[:2]) if self._passed_red_s else np.empty(0)
        for row in [row for row in self._passed_red_s if beyond_m[row] > 0.0]:
            yield moment.infraction(InfractionKind.RED_LIGHT, self._passed_red_s.pop(row), self._lines.lanes[row])


class StopSignRule:
    """Yields when the ego enters a junction without having stood within 4 m before the line of its stop sign."""

    def __init__(self, network: RoadNetwork) -> None:
        signs = [sign for sign in network.layout.signs if sign.kind is SignKind.STOP]
        lanes = dict.fromkeys(lane for sign in signs for lane in sign.lanes if lane in network.lanes)
        self._lines = StopLines([network.lanes[lane] for lane in lanes])
        self._slowest_mps: dict[int, float] = {}

    def judge(self, moment: Moment) -> Iterator[Infraction]:
        """Yield the stop signs that the ego runs."""
        if moment.before is None or not self._lines.lanes:
            return
        front_m, center_m = (self._lines.beyond_m(each) for each in (moment.front_m, moment.position_m[:2]))
        inside = (front_m >= -_STOP_ZONE_M) & (center_m <= 0.0) & self._lines.faced(moment, moment.position_m[:2])
        slowest, self._slowest_mps = self._slowest_mps, {}
        for row in np.flatnonzero(inside).tolist():
            self._slowest_mps[row] = min(slowest.get(row, np.inf), moment.speed_mps)
        before_m = moment.before.position_m[:2]
        for row in self._lines.crossed(moment, moment.position_m[:2], before_m).tolist():
            if (speed_mps := slowest.get(row, moment.speed_mps)) > STANDING_MPS:
                yield moment.infraction(InfractionKind.STOP_SIGN, speed_mps, self._lines.lanes[row])


class YieldRule:
    """Yields when an emergency vehicle with its lights on is behind the ego, on its path, for 10 s altogether.

    While the ego stands or creeps in a queue, it is not the one that holds the vehicle up.
    """

    def __init__(self, spec: SceneSpec) -> None:
        vehicles = enumerate(spec.vehicles)
        self._ids = [EGO_ID + k for k, each in vehicles if each.emergency_lights and each.stands_at is None]
        self._held_up_s: dict[int, float] = defaultdict(float)

    def judge(self, moment: Moment) -> Iterator[Infraction]:
        """Yield the emergency vehicles that the ego has held up for too long now."""
        others = moment.others if self._ids else moment.others[:0]
        seen_m = moment.seen_from_ego(others)
        gap_m = np.abs(seen_m[:, 0]) - (others["length"] + moment.ego["length"]) / 2.0
        in_path = np.abs(seen_m[:, 1]) < (others["width"] + moment.ego["width"]) / 2.0
        in_path &= np.cos(others["yaw"].astype(np.float64) - moment.yaw_rad) > _MAX_TURN_COS
        in_path &= (gap_m > -1.0) & is_beside_in_height(moment, others)
        ahead = in_path & (seen_m[:, 0] > 0.0) & (gap_m < _QUEUE_M) & (others["behavior"] & Behavior.PARKED == 0)
        if moment.speed_mps < _CREEPING_MPS and ahead.any():
            return
        held_up = in_path & (seen_m[:, 0] < 0.0) & (gap_m < _HELD_UP_M) & np.isin(others["id"], self._ids)
        for actor_id in others["id"][held_up].tolist():
            before_s = self._held_up_s[actor_id]
            self._held_up_s[actor_id] = now_s = before_s + moment.tick_s
            if before_s < _HELD_UP_S <= now_s:
                yield moment.infraction(InfractionKind.YIELD, now_s, str(actor_id))


def _heads_by_lane(network: RoadNetwork) -> dict[str, list[int]]:
    """Rows of /world/signals by the lane that they stop."""
    heads: dict[str, list[int]] = defaultdict(list)
    for row, signal in enumerate(network.signals):
        if signal.lane in network.lanes:
            heads[signal.lane].append(row)
    return heads
