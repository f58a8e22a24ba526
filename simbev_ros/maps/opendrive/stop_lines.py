"""Builds stop lines from the signals of an OpenDRIVE file: explicit ones, and those implied by rule."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.opendrive.borders import lane_edges_m, point_m
from simbev_ros.maps.opendrive.lane_shapes import LaneShape
from simbev_ros.maps.opendrive.objects import left_of_traffic
from simbev_ros.maps.opendrive.reading.document import LaneKey
from simbev_ros.maps.opendrive.sides import sections_at
from simbev_ros.maps.opendrive.signals import Signal
from simbev_ros.maps.opendrive.traffic.approaches import Approaches
from simbev_ros.maps.roads.layout import StopLine

_DISTANCE_TO_END_M = 0.5
_MARGIN_M = 0.25
_DUPLICATE_DISTANCE_M = 12.0
_MIN_LENGTH_M = 1.0


def signalled_stop_lines(signals: Iterable[Signal]) -> tuple[StopLine, ...]:
    """Stop lines that are signals, each across the lanes that it applies to."""
    found = []
    for signal in signals:
        road, s = signal.road, np.array([signal.s_m])
        own = {key.lane for key in signal.lanes if key.road == road.id}
        edges_m = [
            float(road.offset(s)[0] + edge[0] * (1.0 if lane.id > 0 else -1.0))
            for section in sections_at(road, signal.s_m)
            for number, lane in enumerate(section.lanes)
            if lane.id in own
            for edge in lane_edges_m(section, s)[number : number + 2]
        ]
        if signal.meaning == "stop_line" and edges_m:
            ends_m = np.stack([point_m(road, signal.s_m, t_m) for t_m in (min(edges_m), max(edges_m))])
            left = left_of_traffic(road, signal.s_m, (min(edges_m) + max(edges_m)) / 2.0)
            found.append(StopLine(ends_m if (ends_m[1] - ends_m[0])[:2] @ left > 0.0 else ends_m[::-1].copy()))
    return tuple(found)


def implied_stop_lines(
    signals: Iterable[Signal],
    approaches: Approaches,
    shapes: Mapping[LaneKey, LaneShape],
    known: Sequence[StopLine],
) -> tuple[StopLine, ...]:
    """Stop lines at the end of lanes with traffic lights, stop or yield signs, unless a known one is nearby."""
    yields: dict[LaneKey, bool] = {}
    for signal in signals:
        if signal.meaning in ("traffic_light", "stop", "yield"):
            for key in approaches.waiting_lanes(signal.lanes):
                if key in shapes:
                    yields[key] = yields.get(key, True) and signal.meaning == "yield"
    known_m = np.array([line.ends_m.mean(axis=0) for line in known]).reshape(-1, 3)
    found = []
    for group in _side_by_side(sorted(yields)):
        sections = [_cross_section_m(shapes[key]) for key in group]
        corners_m = np.concatenate(sections)
        left = sections[0][1] - sections[0][0]
        order = np.argsort(corners_m[:, :2] @ left[:2])
        ends_m = corners_m[order[[0, -1]]]
        length_m = np.linalg.norm(ends_m[1] - ends_m[0])
        is_known = np.any(np.linalg.norm(known_m - ends_m.mean(axis=0), axis=1) < _DUPLICATE_DISTANCE_M)
        if not is_known and length_m > _MIN_LENGTH_M:
            margin_m = _MARGIN_M * (ends_m[1] - ends_m[0]) / length_m
            found.append(StopLine(ends_m + np.stack([margin_m, -margin_m]), yields=all(yields[key] for key in group)))
    return tuple(found)


def _side_by_side(keys: Sequence[LaneKey]) -> list[list[LaneKey]]:
    """Group adjacent lanes of one side of a section."""
    groups: list[list[LaneKey]] = []
    for key in keys:
        last = groups[-1][-1] if groups else None
        if last is not None and last == key._replace(lane=key.lane - 1) and last.lane * key.lane > 0:
            groups[-1].append(key)
        else:
            groups.append([key])
    return groups


def _cross_section_m(shape: LaneShape) -> Float64Array:
    """(2, 3) right and left border point of a lane, shortly before its end in driving direction."""
    at_m = shape.s_m[-1] - _DISTANCE_TO_END_M if shape.runs_forward else shape.s_m[0] + _DISTANCE_TO_END_M
    at_m = np.clip(at_m, shape.s_m[0], shape.s_m[-1])
    inner_m, outer_m = (
        np.array([np.interp(at_m, shape.s_m, line_m[:, axis]) for axis in range(3)])
        for line_m in (shape.inner_m, shape.outer_m)
    )
    left_is_outer = (shape.lane.id > 0) == shape.runs_forward
    return np.stack([inner_m, outer_m] if left_is_outer else [outer_m, inner_m])
