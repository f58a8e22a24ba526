"""Objects of an OpenDRIVE file that are paint on the road: crosswalks and stop lines."""

from collections.abc import Iterator
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.maps.opendrive.borders import point_m
from simbev_ros.maps.opendrive.reading.attributes import Malformed, Notes, number
from simbev_ros.maps.opendrive.reading.document import Document, Road
from simbev_ros.maps.opendrive.sides import drives_forward_at
from simbev_ros.maps.roads.layout import Crosswalk, StopLine
from simbev_ros.types import Float64Array

_ELONGATED = 1.3
_SAME_CORNER_M = 1e-3


def crosswalks_of(document: Document, notes: Notes) -> tuple[Crosswalk, ...]:
    """All crosswalks."""
    found = []
    for road, element in _objects(document):
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
    """All stop lines that are objects."""
    found = []
    for road, element in _objects(document):
        words = (element.get("name", ""), element.get("type", ""), element.get("subtype", ""))
        if not any("stopline" in word.lower().replace("_", "").replace(" ", "") for word in words):
            continue
        try:
            corners_m = _outline_m(road, element, fewest=2)
            s_m, t_m = number(element, "s"), number(element, "t")
        except Malformed as problem:
            notes.add("a stop line that cannot be read is left out", element, str(problem))
            continue
        found.append(StopLine(_bar(corners_m, left_of_traffic(road, s_m, t_m))))
    return tuple(found)


def left_of_traffic(road: Road, s_m: float, t_m: float) -> Float64Array:
    """(2,) unit vector to the left of the traffic at a place on a road."""
    normal = road.plan(np.array([s_m]))[1][0]
    left: Float64Array = normal if drives_forward_at(road, s_m, t_m) else -normal
    return left


def _objects(document: Document) -> Iterator[tuple[Road, Element]]:
    return ((road, element) for road in document.roads.values() for element in road.element.findall("objects/object"))


def _outline_m(road: Road, element: Element, fewest: int = 3) -> Float64Array:
    """(N, 3) corners of an object, map frame: its outline, else its width and length.

    Raises:
        Malformed: There are fewer than ``fewest``, or a number is missing or wrong.
    """
    outlines = [*element.findall("outline"), *element.findall("outlines/outline")]
    outline = next((o for o in outlines if o.get("outer", "true") != "false"), None)
    if outline is None:
        u_m, v_m = number(element, "length") / 2.0, number(element, "width") / 2.0
        local = [(u_m, v_m, 0.0), (-u_m, v_m, 0.0), (-u_m, -v_m, 0.0), (u_m, -v_m, 0.0)]
        corners_m = _from_local(road, element, np.array(local))
    elif outline.find("cornerRoad") is not None:
        corners_m = np.array([_place_m(road, corner, "dz") for corner in outline.findall("cornerRoad")])
    else:
        corners = outline.findall("cornerLocal")
        local = [(number(c, "u"), number(c, "v"), number(c, "z", 0.0)) for c in corners]
        corners_m = _from_local(road, element, np.reshape(local, (-1, 3)))
    following_m = np.roll(corners_m, -1, axis=0)
    distinct_m: Float64Array = corners_m[np.linalg.norm(following_m - corners_m, axis=1) > _SAME_CORNER_M]
    if len(distinct_m) < fewest:
        raise Malformed(element, f"its outline has fewer than {fewest} corners")
    return distinct_m


def _from_local(road: Road, element: Element, local_m: Float64Array) -> Float64Array:
    """(N, 3) map frame of points in the frame of an object."""
    yaw_rad = road.plan(np.array([number(element, "s")]))[2][0] + number(element, "hdg", 0.0)
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    map_from_local = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    placed_m: Float64Array = _place_m(road, element, "zOffset") + local_m @ map_from_local.T
    return placed_m


def _place_m(road: Road, element: Element, height: str) -> Float64Array:
    """(3,) map frame of an element's s and t, so much above the road as another attribute says."""
    place_m = point_m(road, number(element, "s"), number(element, "t"))
    place_m[2] += number(element, height, 0.0)
    return place_m


def _walking_axis(outline_m: Float64Array, across: Float64Array) -> Float64Array:
    """(2,) direction in which people walk: along a long crosswalk, else as near to across the road as its sides are."""
    edges_m = np.roll(outline_m, -1, axis=0)[:, :2] - outline_m[:, :2]
    axis: Float64Array = edges_m[np.argmax(np.linalg.norm(edges_m, axis=1))]
    axis = axis / np.linalg.norm(axis)
    normal = np.array([-axis[1], axis[0]])
    length_m, width_m = (np.ptp(outline_m[:, :2] @ direction) for direction in (axis, normal))
    if length_m < _ELONGATED * width_m and abs(normal @ across) > abs(axis @ across):
        axis = normal
    return axis if axis @ across >= 0.0 else -axis


def _bar(corners_m: Float64Array, left: Float64Array) -> Float64Array:
    """(2, 3) middles of the ends of a bar, from right to left."""
    reach_m = corners_m[:, :2] @ left
    middle_m = (reach_m.min() + reach_m.max()) / 2.0
    ends_m: Float64Array = np.stack(
        [corners_m[reach_m < middle_m].mean(axis=0), corners_m[reach_m >= middle_m].mean(axis=0)]
    )
    return ends_m
