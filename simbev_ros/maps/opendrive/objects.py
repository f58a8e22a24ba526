"""Reads the OpenDRIVE objects that are paint on the road: crosswalks and stop lines."""

import numpy as np

from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.object_shapes import iter_objects, outline_m
from simbev_ros.maps.opendrive.reading.attributes import Malformed, number
from simbev_ros.maps.opendrive.reading.document import Document, Road
from simbev_ros.maps.opendrive.sides import drives_forward_at
from simbev_ros.maps.roads.layout import Crosswalk, StopLine

_MIN_ASPECT = 1.3


def crosswalks_of(document: Document, notes: Findings) -> tuple[Crosswalk, ...]:
    """All crosswalks of a document; unreadable ones are left out with a note."""
    found = []
    for road, element in iter_objects(document):
        if element.get("type", "").lower() != "crosswalk":
            continue
        try:
            corners_m = outline_m(road, element)
            across = road.plan(np.array([number(element, "s")]))[1][0]
        except Malformed as problem:
            notes.left_out("a crosswalk that cannot be read is left out", element, str(problem))
            continue
        found.append(Crosswalk(corners_m, _walking_axis(corners_m, across)))
    return tuple(found)


def stop_lines_of(document: Document, notes: Findings) -> tuple[StopLine, ...]:
    """All stop lines of a document that are objects (not signals); unreadable ones are left out with a note."""
    found = []
    for road, element in iter_objects(document):
        words = (element.get("name", ""), element.get("type", ""), element.get("subtype", ""))
        if not any("stopline" in word.lower().replace("_", "").replace(" ", "") for word in words):
            continue
        try:
            corners_m = outline_m(road, element, min_corners=2)
            s_m, t_m = number(element, "s"), number(element, "t")
        except Malformed as problem:
            notes.left_out("a stop line that cannot be read is left out", element, str(problem))
            continue
        found.append(StopLine(_bar_ends_m(corners_m, left_of_traffic(road, s_m, t_m))))
    return tuple(found)


def left_of_traffic(road: Road, s_m: float, t_m: float) -> Float64Array:
    """(2,) unit vector to the left of the driving direction at a position (s, t) on a road."""
    normal = road.plan(np.array([s_m]))[1][0]
    return normal if drives_forward_at(road, s_m, t_m) else -normal


def _walking_axis(outline_m: Float64Array, across: Float64Array) -> Float64Array:
    """(2,) walking direction: along a long crosswalk, else along the side closest to perpendicular to the road."""
    edges_m = np.roll(outline_m, -1, axis=0)[:, :2] - outline_m[:, :2]
    axis: Float64Array = edges_m[np.argmax(np.linalg.norm(edges_m, axis=1))]
    axis = axis / np.linalg.norm(axis)
    normal = left_of(axis)
    length_m, width_m = (np.ptp(outline_m[:, :2] @ direction) for direction in (axis, normal))
    if length_m < _MIN_ASPECT * width_m and abs(normal @ across) > abs(axis @ across):
        axis = normal
    return axis if axis @ across >= 0.0 else -axis


def _bar_ends_m(corners_m: Float64Array, left: Float64Array) -> Float64Array:
    """(2, 3) midpoints of the ends of a bar, from right to left."""
    reach_m = corners_m[:, :2] @ left
    middle_m = (reach_m.min() + reach_m.max()) / 2.0
    return np.stack([corners_m[reach_m < middle_m].mean(axis=0), corners_m[reach_m >= middle_m].mean(axis=0)])
