"""Distances between entities, and between an entity and a position, as conditions measure them."""

import math

import numpy as np
import shapely

from simbev_ros.maps.opendrive.lane_places import RoadPoint
from simbev_ros.scene.storyboard.bodies import Body, Pose
from simbev_ros.scene.storyboard.model import Element
from simbev_ros.simulation.world.storyboard.stage import Stage


def gap_m(stage: Stage, body: Body, other: Body | Pose, element: Element) -> float:
    """Distance as ``element`` asks for it, not negative: its coordinate system, its type, and whether boxes count.

    On roads it is along or across them; infinite if no road leads from one to the other.
    """
    system, kind = element.coordinate_system, element.relative_distance_type
    free = bool(element.freespace)
    if kind == "euclidianDistance":
        return _straight_m(body, other, free)
    if system in ("road", "lane", "trajectory"):
        return _along_roads_m(stage, body, other, kind, free)
    axis = (np.eye(2) if system == "world" else body.axes)[0 if kind == "longitudinal" else 1]
    low_m, high_m = _extent_m(body, axis, body.position_m, free)
    other_low_m, other_high_m = _extent_m(other, axis, body.position_m, free)
    return max(other_low_m - high_m, low_m - other_high_m, 0.0)


def closing_mps(stage: Stage, body: Body, other: Body | Pose, element: Element) -> float:
    """Speed at which the distance of ``gap_m`` shrinks; negative if it grows."""
    kind, system = element.relative_distance_type, element.coordinate_system
    velocity_mps = body.velocity_mps - (other.velocity_mps if isinstance(other, Body) else 0.0)
    arm_m = np.asarray(other.position_m - body.position_m)[:2]
    if kind == "euclidianDistance":
        line = arm_m / max(float(np.hypot(*arm_m)), 1e-9)
        return float(line @ velocity_mps)
    if system in ("road", "lane", "trajectory") and kind == "longitudinal":
        ahead_m = stage.gap_m(body, other) if isinstance(other, Body) else float(body.axes[0] @ arm_m)
        other_mps = 0.0
        if isinstance(other, Body):
            other_mps = other.speed_mps * math.cos(other.yaw_rad - body.yaw_rad)
            if body.place is not None and other.place is not None:
                same = body.place.forward == other.place.forward
                other_mps = other.speed_mps * (1.0 if same or body.place.road != other.place.road else -1.0)
        return math.copysign(1.0, ahead_m) * (body.speed_mps - other_mps)
    axis = (np.eye(2) if system == "world" else body.axes)[0 if kind == "longitudinal" else 1]
    return float(axis @ velocity_mps) * math.copysign(1.0, float(axis @ arm_m))


def overlap(body: Body, other: Body) -> bool:
    """Whether two boxes touch in plan view, and in height."""
    low_m, high_m = sorted((body, other), key=lambda each: float(each.position_m[2]))
    meet = high_m.position_m[2] <= low_m.position_m[2] + low_m.size_m[2]
    return bool(meet) and bool(shapely.intersects(_box(body), _box(other)))


def _box(body: Body) -> shapely.Polygon:
    return shapely.Polygon(body.corners_m)


def _straight_m(body: Body, other: Body | Pose, free: bool) -> float:
    if free:
        there = _box(other) if isinstance(other, Body) else shapely.Point(other.position_m[:2])
        return float(shapely.distance(_box(body), there))
    return float(np.hypot(*np.asarray(other.position_m - body.position_m)[:2]))


def _extent_m(body: Body | Pose, axis: np.ndarray, origin_m: np.ndarray, free: bool) -> tuple[float, float]:
    """The stretch of an axis that a box covers, or a point."""
    points_m = body.corners_m if free and isinstance(body, Body) else body.position_m[None, :2]
    along_m = (points_m - origin_m[:2]) @ axis
    return float(along_m.min()), float(along_m.max())


def _along_roads_m(stage: Stage, body: Body, other: Body | Pose, kind: str, free: bool) -> float:
    roads = stage.mover.roads
    here = stage.mover.lane_at(body.position_m, body.yaw_rad)
    there = other.place or stage.mover.lane_at(other.position_m, other.yaw_rad)
    if here is None or there is None:
        return math.inf
    point: RoadPoint = roads.point_of(there)
    if kind == "lateral":
        across_m = abs(point.t_m - roads.point_of(here).t_m)
        return max(across_m - _half_m(body, 1, free) - _half_m(other, 1, free), 0.0)
    along_m = roads.distance_m(here, point)
    if along_m is None:
        return math.inf
    if free:
        along_m += (_center_m(other) * math.cos(other.yaw_rad - body.yaw_rad)) - _center_m(body)
    return max(abs(along_m) - _half_m(body, 0, free) - _half_m(other, 0, free), 0.0)


def _half_m(body: Body | Pose, axis: int, free: bool) -> float:
    return body.size_m[axis] / 2.0 if free and isinstance(body, Body) else 0.0


def _center_m(body: Body | Pose) -> float:
    return body.center_m[0] if isinstance(body, Body) else 0.0
