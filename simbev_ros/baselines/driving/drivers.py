"""Drives a scene's route with the planner of the reference stack: messages of a tick in, planned positions out.

The drivers differ in what they are told. ``truth`` knows all actors, lights and signs. ``learned`` knows the boxes that
the lidar baseline has found, and the map; it sees no lights, so it runs red ones. ``constant`` drives at 8 m/s whatever
happens.
"""

from collections.abc import Mapping
from dataclasses import replace
from enum import StrEnum
from typing import Any

import numpy as np

from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.layout import SignKind
from simbev_ros.reference_stack.driving.others import Others
from simbev_ros.reference_stack.driving.planner import Planner, ends_of
from simbev_ros.reference_stack.driving.route_line import RouteLine
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.schema.scene.drive_spec import Command
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.state import EGO_ID, SignalState
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.world.driving.vehicle_model import road_friction

_CONSTANT_MPS, _CONSTANT_MPS2 = 8.0, 2.0
_MIN_SCORE = 0.3
_LANE_M = 3.4  # from lane to lane, up to 1 m more or less
_STOP_ZONE_M, _STANDING_MPS = 3.5, 0.08  # a stop sign is served by standing so near to its line
_YELLOW_MPS2 = 2.5  # braking that a yellow light is worth on a dry road
_LINE_M, _DOOR_M = 0.1, 0.95  # from the edges of the lane, and length of an open door
_LEVEL_M, _WINDOW_M = 3.0, (-30.0, 100.0)  # from the road's height, on the part of the route that matters
_LEFT_DOORS, _RIGHT_DOORS = 0b0101, 0b1010
_RED = (SignalState.RED, SignalState.RED_YELLOW)


class DriverKind(StrEnum):
    """Driver."""

    TRUTH = "truth"
    LEARNED = "learned"
    CONSTANT = "constant"


class RouteDriver:
    """Drives one scene.

    Args:
        kind: The driver.
        scene: The object of /world/scene.
    """

    def __init__(self, kind: DriverKind, scene: Mapping[str, Any]) -> None:
        self._kind, self._tick_s = kind, scene["tick_ns"] * 1e-9
        agent = scene["agents"][0]
        blueprint = blueprint_named(scene["vehicles"][agent["vehicle"]]["blueprint"])
        self._center_m, self._axle_m = -agent["base_link_x_m"], blueprint.wheelbase_m / 2.0
        is_truth, (self._length_m, width_m, _) = kind is DriverKind.TRUTH, blueprint.size_m
        self._grip = _grip(scene) if is_truth else 1.0
        self._line = RouteLine(scene["drive"]["route"], self._grip)
        self._route_m = np.array([scene["drive"]["route"][f"{axis}_m"] for axis in "xyz"], np.float64).T
        network = load_network(MapSpec.model_validate(scene["map"]))
        room_m = _room_m(scene["drive"]["route"], network, width_m) if is_truth else None
        beside_m = _lanes_beside(self._line, network)
        self._planner = Planner(self._line, self._length_m, width_m, self._tick_s, beside_m, room_m, self._grip)
        heads: dict[str, list[int]] = {}
        for row, signal in enumerate(network.signals):
            heads.setdefault(signal.lane, []).append(row)
        ends = ends_of(self._line.lanes, self._line.distance_m, frozenset(heads))
        self._lights = [(end_m, heads[lane]) for lane, end_m in ends]
        signed = frozenset(lane for sign in network.layout.signs if sign.kind is SignKind.STOP for lane in sign.lanes)
        self._signs_m = [end_m for _, end_m in ends_of(self._line.lanes, self._line.distance_m, signed)]

    def positions(
        self, pose: Float64Array, speed_mps: float, actors: Table | None, boxes: Table | None, signals: Table | None
    ) -> Float64Array:
        """(K, 2) positions of the center of the rear axle at the next ticks, map frame; the first one is the present.

        Args:
            pose: (3,) position and heading of base_link, map frame.
            speed_mps: Speed.
            actors: Rows of /world/actors; None: unknown.
            boxes: Rows of /prediction/boxes; None: unknown.
            signals: Rows of /world/signals; None: unknown.
        """
        ahead = np.array([np.cos(pose[2]), np.sin(pose[2])])
        center_m = pose[:2] + self._center_m * ahead
        start_m = self._planner.advance_to(center_m)
        if self._kind is DriverKind.CONSTANT:
            return self._line.axles_at(self._constant(start_m, speed_mps), self._axle_m)
        if actors is not None:
            others = _actors(self._level_with_route(actors, start_m))
        elif boxes is not None:
            others = _boxes(self._level_with_route(boxes, start_m), center_m, pose[2], self._length_m)
        else:
            raise ValueError("neither actors nor boxes are known")
        front_m = start_m + self._length_m / 2.0
        stops_m = [*self._red_lights(signals, front_m, speed_mps), *self._stop_signs(front_m, speed_mps)]
        motion = self._planner.plan(speed_mps, others, stops_m)
        return self._planner.line.axles_at(motion.distance_m, self._axle_m)

    def _level_with_route(self, rows: Table, start_m: float) -> Table:
        """The rows that are not on a bridge over the route, nor below it."""
        first, last = np.searchsorted(self._line.distance_m, start_m + np.array(_WINDOW_M)).tolist()
        part_m = self._route_m[max(first - 1, 0) : last + 1]
        offset_m = _pair(rows, "x", "y")[:, None] - part_m[:, :2]
        nearest = np.argmin(np.einsum("nki,nki->nk", offset_m, offset_m), axis=1)
        return rows[np.abs(rows["z"] - part_m[nearest, 2]) < _LEVEL_M]

    def _constant(self, start_m: float, speed_mps: float) -> Float64Array:
        time_s = np.arange(60) * self._tick_s
        gain_s = max(_CONSTANT_MPS - speed_mps, 0.0) / _CONSTANT_MPS2
        speeding_s = np.minimum(time_s, gain_s)
        distances: Float64Array = start_m + speed_mps * speeding_s + _CONSTANT_MPS2 * speeding_s**2 / 2.0
        return distances + _CONSTANT_MPS * (time_s - speeding_s)

    def _red_lights(self, signals: Table | None, front_m: float, speed_mps: float) -> list[float]:
        """Distances along the route of the lines to stop at."""
        found = []
        for line_m, rows in self._lights if signals is not None and len(signals) else ():
            states, left_m = signals["state"][rows], line_m - front_m  # type: ignore[index]
            yellow = (states == SignalState.YELLOW).all() and left_m > speed_mps**2 / (2.0 * _YELLOW_MPS2 * self._grip)
            if left_m > 0.0 and (yellow or np.isin(states, _RED).all()):
                found.append(line_m)
        return found

    def _stop_signs(self, front_m: float, speed_mps: float) -> list[float]:
        """Distances along the route of lines with signs at which the vehicle has not stood yet."""
        served = [each for each in self._signs_m if each - front_m < _STOP_ZONE_M and speed_mps < _STANDING_MPS]
        self._signs_m = [each for each in self._signs_m if each > front_m and each not in served]
        return self._signs_m


def _lanes_beside(line: RouteLine, network: RoadNetwork) -> Float64Array:
    """(N, 4) distances to the left of the lanes beside a route, NaN: none; left and right with it, then against it."""
    points_m, ahead = line.points_at(line.distance_m), line.headings_at(line.distance_m)
    left, yaw_rad = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1), np.arctan2(ahead[:, 1], ahead[:, 0])
    columns, outside = [], np.array([not network.lanes[each].junction for each in line.lanes])
    for side in (1.0, -1.0):
        found = network.nearest_lane(points_m + side * _LANE_M * left)
        lanes, off_m = [network.lanes[each] for each in found.lane], found.position_m[:, :2] - points_m
        left_m, along_m = (np.einsum("ni,ni->n", off_m, axis) for axis in (left, ahead))
        is_open = outside & [not each.junction and "passenger" in each.classes for each in lanes]
        is_open &= (np.abs(side * left_m - _LANE_M) < 1.0) & (np.abs(along_m) < 1.0)
        cosine = np.cos(found.yaw_rad - yaw_rad)
        columns += [np.where(is_open & each, left_m, np.nan) for each in (cosine > 0.9, cosine < -0.9)]
    return np.stack([columns[each] for each in (0, 2, 1, 3)], axis=1)


def _grip(scene: Mapping[str, Any]) -> float:
    """Minimum friction of the road during a scene, relative to a dry one."""
    weathers = (Weather.model_validate(each) for each in (scene["weather"], scene.get("final_weather")) if each)
    return min(road_friction(each, with_snow=True) for each in weathers)


def _room_m(route: Mapping[str, Any], network: RoadNetwork, width_m: float) -> Float64Array:
    """(N,) how far a vehicle may be off the points of a route within its lanes; 0 in junctions and lane changes."""
    lanes = [network.lanes[each] for each in route["lane"]]
    follows = np.array([each == Command.FOLLOW for each in route["command"]])
    room_m = np.array([0.0 if each.junction else (each.width_m - width_m) / 2.0 - _LINE_M for each in lanes])
    return np.where(follows, np.maximum(room_m, 0.0), 0.0)


def _actors(actors: Table) -> Others:
    """All actors, with their open doors, but the ego and those that ride in or on others."""
    rows = actors[(actors["id"] != EGO_ID) & (actors["parent"] == 0)]
    velocity, acceleration = _pair(rows, "vx", "vy"), _pair(rows, "ax", "ay")
    speed = np.linalg.norm(velocity, axis=1)
    along = np.einsum("ni,ni->n", velocity, acceleration) / np.maximum(speed, 0.1)
    others = _others(rows, np.maximum(-along, 0.0), rows["wz"].astype(np.float64))
    left_m, right_m = (_DOOR_M * (rows["doors"] & doors > 0) for doors in (_LEFT_DOORS, _RIGHT_DOORS))
    left = np.stack([-np.sin(others.yaw_rad), np.cos(others.yaw_rad)], axis=1)
    position_m = others.position_m + ((left_m - right_m) / 2.0)[:, None] * left
    size_m = others.size_m + np.stack([np.zeros_like(left_m), left_m + right_m], axis=1)
    return replace(others, position_m=position_m, size_m=size_m)


def _boxes(boxes: Table, center_m: Float64Array, yaw_rad: float, length_m: float) -> Others:
    """Likely boxes that are not the ego itself."""
    seen_m = _pair(boxes, "x", "y") - center_m
    along_m, left_m = seen_m @ [np.cos(yaw_rad), np.sin(yaw_rad)], seen_m @ [-np.sin(yaw_rad), np.cos(yaw_rad)]
    is_own = (np.abs(along_m) < length_m / 2.0) & (np.abs(left_m) < 1.0)
    rows = boxes[(boxes["score"] >= _MIN_SCORE) & ~is_own]
    return _others(rows, np.zeros(len(rows)), np.zeros(len(rows)))


def _others(rows: Table, braking_mps2: Float64Array, turn_radps: Float64Array) -> Others:
    position_m, velocity_mps = _pair(rows, "x", "y"), _pair(rows, "vx", "vy")
    yaw_rad, size_m = rows["yaw"].astype(np.float64), _pair(rows, "length", "width")
    return Others(position_m, yaw_rad, velocity_mps, turn_radps, braking_mps2, size_m)


def _pair(rows: Table, first: str, second: str) -> Float64Array:
    return np.stack([rows[first], rows[second]], axis=1, dtype=np.float64)
