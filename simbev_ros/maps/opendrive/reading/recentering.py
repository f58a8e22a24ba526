"""Moves the origin of an OpenDRIVE file with large coordinates, such as UTM, to the middle of the map."""

import math
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.reading.attributes import Malformed, number
from simbev_ros.maps.opendrive.reading.datum import offset_of

_MAX_OFFSET_M = 20_000.0


def recenter(root: Element, notes: Findings) -> tuple[float, float, float]:
    """Shift the coordinates of a file to be small, and its <offset> so that the map keeps its position on Earth.

    Returns:
        The file's coordinates, as they were, of the new origin; zeros if no shift was necessary.
    """
    header = root.find("header")
    moved = [*root.iterfind("road/planView/geometry"), *root.iterfind("road/signals/signal/positionInertial")]
    positions_m = np.array([xy for element in moved for xy in _xy_m(element)]).reshape(-1, 2)
    if len(positions_m) == 0 or np.abs(np.median(positions_m, axis=0)).max() <= _MAX_OFFSET_M:
        return 0.0, 0.0, 0.0
    x_m, y_m = np.round(np.median(positions_m, axis=0)).tolist()
    for element in moved:
        for xy in _xy_m(element):
            element.set("x", repr(xy[0] - x_m))
            element.set("y", repr(xy[1] - y_m))
    header = SubElement(root, "header") if header is None else header
    try:
        offset_x_m, offset_y_m, _, heading_rad = offset_of(header)
    except Malformed:
        return x_m, y_m, 0.0
    offset = header.find("offset")
    offset = SubElement(header, "offset", z="0", hdg="0") if offset is None else offset
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    offset.set("x", repr(offset_x_m + cos * x_m - sin * y_m))
    offset.set("y", repr(offset_y_m + sin * x_m + cos * y_m))
    for side, shift_m in (("north", y_m), ("south", y_m), ("east", x_m), ("west", x_m)):
        try:
            header.set(side, repr(number(header, side) - shift_m))
        except Malformed:
            header.attrib.pop(side, None)
    notes.assumed(f"it lies far from its origin: map (0, 0) is its ({x_m:.0f}, {y_m:.0f})")
    return x_m, y_m, 0.0


def _xy_m(element: Element) -> list[tuple[float, float]]:
    """X and y of an element as a list of one pair; empty if they are not numbers."""
    try:
        return [(number(element, "x"), number(element, "y"))]
    except Malformed:
        return []
