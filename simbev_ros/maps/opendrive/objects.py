"""Reads the OpenDRIVE objects that are paint on the road: crosswalks and stop lines."""

from collections.abc import Iterator
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.geometry.plan_view import left_of
from simbev_ros.maps.opendrive.borders import point_m
from simbev_ros.maps.opendrive.reading.attributes import Malformed, Notes, number
from simbev_ros.maps.opendrive.reading.document import Document, Road
from simbev_ros.maps.opendrive.sides import drives_forward_at
from simbev_ros.maps.roads.layout import Crosswalk, StopLine
from simbev_ros.types import Float64Array

_MIN_ASPECT = 1.3
_SAME_CORNER_M = 1e-3


def crosswalks_of(document: Document, notes: Notes) -> tuple[Crosswalk, ...]:
    """All crosswalks of a document; unreadable ones are left out with a note."""
    found = []
    for road, element in _iter_objects(document):
        if element.get("type", "").lower() != "crosswalk":
            continue
        try:
            outline_m = _outline_m(road, element)
            across = road.plan(np.array([number(element, "s")]))[1][0]
        except Malformed as problem:
            notes.add("a crosswalk that cannot be read is left out", element, str(problem))
            continue
        found.append(Crosswalk(outline_m, _walking_axis(outline_m, across)))
    return tuple(found)


def stop_lines_of(document: Document, notes: Notes) -> tuple[StopLine, ...]:
    """All stop lines of a document that are objects (not signals); unreadable ones are left out with a note."""
    found = []
    for road, element in _iter_objects(document):
        words = (element.get("name", ""), element.get("type", ""), element.get("subtype", ""))
        if not any("stopline" in word.lower().replace("_", "").replace(" ", "") for word in words):
            continue
        try:
            corners_m = _outline_m(road, element, min_corners=2)
            s_m, t_m = number(element, "s"), number(element, "t")
        except Malformed as problem:
            notes.add("a stop line that cannot be read is left out", element, str(problem))
            continue
        found.append(StopLine(_bar_ends_m(corners_m, left_of_traffic(road, s_m, t_m))))
    return tuple(found)


def left_of_traffic(road: Road, s_m: float, t_m: float) -> Float64Array:
    """(2,) unit vector to the left of the driving direction at a position (s, t) on a road."""
    normal = road.plan(np.array([s_m]))[1][0]
    return normal if drives_forward_at(road, s_m, t_m) else -normal


def _iter_objects(document: Document) -> Iterator[tuple[Road, Element]]:
    return ((road, element) for road in document.roads.values() for element in road.element.findall("objects/object"))


def _outline_m(road: Road, element: Element, min_corners: int = 3) -> Float64Array:
    """(N, 3) corners of an object, map frame: its outline, else the rectangle of its width and length.

    Raises:
        Malformed: It has fewer than ``min_corners`` corners, or a number is missing or invalid.
    """
    outlines = [*element.findall("outline"), *element.findall("outlines/outline")]
    outline = next((o for o in outlines if o.get("outer", "true") != "false"), None)
    if outline is None:
        u_m, v_m = number(element, "length") / 2.0, number(element, "width") / 2.0
        local = [(u_m, v_m, 0.0), (-u_m, v_m, 0.0), (-u_m, -v_m, 0.0), (u_m, -v_m, 0.0)]
        corners_m = _from_local(road, element, np.array(local))
    elif outline.find("cornerRoad") is not None:
        corners_m = np.array([_position_m(road, corner, "dz") for corner in outline.findall("cornerRoad")])
    else:
        corners = outline.findall("cornerLocal")
        local = [(number(c, "u"), number(c, "v"), number(c, "z", 0.0)) for c in corners]
        corners_m = _from_local(road, element, np.reshape(local, (-1, 3)))
    following_m = np.roll(corners_m, -1, axis=0)
    distinct_m: Float64Array = corners_m[np.linalg.norm(following_m - corners_m, axis=1) > _SAME_CORNER_M]
    if len(distinct_m) < min_corners:
        raise Malformed(element, f"its outline has fewer than {min_corners} corners")
    return distinct_m


def _from_local(road: Road, element: Element, local_m: Float64Array) -> Float64Array:
    """(N, 3) map frame positions of points in the frame of an object."""
    yaw_rad = road.plan(np.array([number(element, "s")]))[2][0] + number(element, "hdg", 0.0)
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    map_from_local = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return _position_m(road, element, "zOffset") + local_m @ map_from_local.T


def _position_m(road: Road, element: Element, height: str) -> Float64Array:
    """(3,) map frame position of an element's s and t, raised above the road by the attribute named ``height``."""
    position_m = point_m(road, number(element, "s"), number(element, "t"))
    position_m[2] += number(element, height, 0.0)
    return position_m


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
