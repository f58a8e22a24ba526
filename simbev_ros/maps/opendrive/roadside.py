"""Positions roadside objects of an OpenDRIVE file: traffic signs, and the posts and heads of traffic lights."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import shapely

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.borders import point_m
from simbev_ros.maps.opendrive.reading.document import LaneKey, Road
from simbev_ros.maps.opendrive.sides import reach_m
from simbev_ros.maps.opendrive.signals import Signal
from simbev_ros.maps.opendrive.traffic.approaches import Approaches
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS
from simbev_ros.maps.roads.layout import Sign, SignalPlace, SignKind, Strip
from simbev_ros.maps.roads.surface import strip_polygons

_CURB_TO_POST_M = 0.6
_SAME_LEVEL_M = 3.0
_HEAD_ABOVE_FOOT_M = 3.0
_HEAD_BEFORE_POLE_M = 0.25
_OVERHEAD_M = 2.5
_HEAD_HEIGHT_M = 1.0
_SAME_SIGN_M = 15.0
_MAX_TURN_RAD = np.radians(75.0)


class Carriageway:
    """The road surface, used to test whether a position is on a road."""

    def __init__(self, strips: Sequence[Strip]) -> None:
        self._strips = [strip for strip in strips if strip.kind in ROAD_KINDS]
        self._tree = shapely.STRtree(strip_polygons(self._strips))
        self._beside: dict[tuple[str, float, bool], Float64Array | None] = {}

    def contains(self, position_m: Float64Array) -> bool:
        """Whether a (3,) position is on a road of its level."""
        below = self._tree.query(shapely.Point(position_m[:2]), predicate="intersects")
        return any(np.abs(self._strips[k].left_m[:, 2] - position_m[2]).min() < _SAME_LEVEL_M for k in below)

    def beside(self, road: Road, s_m: float, on_left: bool) -> Float64Array | None:
        """(3,) position for a post beside a road; None if that position is on another road."""
        key = road.id, s_m, on_left
        if key not in self._beside:
            edge_m = reach_m(road, s_m, on_left, ROAD_KINDS)
            beside_m = point_m(road, s_m, edge_m + (_CURB_TO_POST_M if on_left else -_CURB_TO_POST_M))
            self._beside[key] = None if self.contains(beside_m) else beside_m
        return self._beside[key]


def signs_of(
    signals: Iterable[Signal],
    approaches: Approaches,
    lane_ids: Mapping[LaneKey, Sequence[str]],
    carriageway: Carriageway,
    notes: Findings,
) -> tuple[Sign, ...]:
    """All signs on posts; signs that are only painted, or would stand on the road, get a post beside the road."""
    found: list[Sign] = []
    for signal in sorted(signals, key=lambda signal: signal.painted):
        if signal.meaning not in list(SignKind):
            continue
        kind = SignKind(signal.meaning)
        lanes = _lane_ids(signal, approaches, lane_ids)
        if not lanes or (signal.painted and _is_repeated(kind, lanes, signal.position_m, found)):
            continue
        foot_m = foot_of(signal, carriageway, notes)
        found.append(Sign(kind, foot_m, yaw_of(signal, approaches), lanes, signal.speed_mps))
    return tuple(found)


def signal_places_of(
    signals: Iterable[Signal],
    approaches: Approaches,
    lane_ids: Mapping[LaneKey, Sequence[str]],
    carriageway: Carriageway,
    notes: Findings,
) -> tuple[SignalPlace, ...]:
    """Mounts of all traffic lights for vehicles; those without a height of their own hang on a post.

    Several signals at one position, as SUMO writes one for each arrow, become one head with the id of the first.
    """
    found: dict[tuple[float, ...], SignalPlace] = {}
    for signal in signals:
        lanes = _lane_ids(signal, approaches, lane_ids) if signal.meaning == "traffic_light" else ()
        if not lanes:
            continue
        foot_m, yaw_rad = foot_of(signal, carriageway, notes), yaw_of(signal, approaches)
        if signal.bottom_m >= _OVERHEAD_M:
            middle_m = signal.bottom_m + (signal.height_m or _HEAD_HEIGHT_M) / 2.0
            head_m = signal.position_m + np.array([0.0, 0.0, middle_m])
        else:
            ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
            head_m = foot_m + _HEAD_BEFORE_POLE_M * ahead + np.array([0.0, 0.0, _HEAD_ABOVE_FOOT_M])
        mount = (*np.round(head_m, 1).tolist(), round(yaw_rad, 1))
        first = found.get(mount)
        others, name = ((), signal.id) if first is None else (first.lanes, first.opendrive_id)
        found[mount] = SignalPlace(foot_m, head_m, yaw_rad, tuple(dict.fromkeys((*others, *lanes))), name)
    return tuple(found.values())


def _lane_ids(signal: Signal, approaches: Approaches, lane_ids: Mapping[LaneKey, Sequence[str]]) -> tuple[str, ...]:
    """Lanes of the SUMO net that a signal applies to: where traffic waits for it, or from the speed limit on."""
    own = tuple(dict.fromkeys(lane_ids[key][0] for key in signal.lanes if key in lane_ids))
    if own and signal.meaning == SignKind.SPEED_LIMIT:
        return own
    return tuple(dict.fromkeys(lane_ids[key][-1] for key in approaches.waiting_lanes(signal.lanes) if key in lane_ids))


def _is_repeated(kind: SignKind, lanes: Sequence[str], position_m: Float64Array, signs: Sequence[Sign]) -> bool:
    """Whether a sign with the same meaning for one of the lanes stands nearby."""
    return any(
        sign.kind is kind
        and not set(lanes).isdisjoint(sign.lanes)
        and np.linalg.norm(sign.foot_m[:2] - position_m[:2]) < _SAME_SIGN_M
        for sign in signs
    )


def yaw_of(signal: Signal, approaches: Approaches) -> float:
    """Direction that a signal's face points in: along its axis, towards the traffic that it is for.

    If the axis deviates from the direction of that traffic by more than 75°, the face points straight at the traffic.
    """
    traffic_rad = signal.traffic_rad
    waiting = approaches.waiting_lanes(signal.lanes) if signal.meaning != SignKind.SPEED_LIMIT else ()
    if waiting:
        traffic_rad = float(np.angle(sum(np.exp(1j * approaches.heading_rad(key)) for key in waiting)))
    turn_rad = (signal.axis_rad - traffic_rad + np.pi / 2.0) % np.pi - np.pi / 2.0
    if abs(turn_rad) > _MAX_TURN_RAD:
        turn_rad = 0.0
    return float(np.angle(-np.exp(1j * (traffic_rad + turn_rad))))


def foot_of(signal: Signal, carriageway: Carriageway, notes: Findings) -> Float64Array:
    """(3,) foot of a signal's post: its own position, or one beside the road if that is on the road."""
    if not carriageway.contains(signal.position_m):
        return signal.position_m
    left = signal.forward == signal.road.left_hand
    for on_left in (left, not left):
        beside_m = carriageway.beside(signal.road, signal.s_m, on_left)
        if beside_m is not None:
            return beside_m
    notes.repaired("a signal stands on the road, and no free position was found beside it", signal.road.element)
    return signal.position_m
