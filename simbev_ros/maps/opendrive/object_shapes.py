"""Positions, sizes and outlines of OpenDRIVE objects: from coordinates along their road to points of the map frame."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.foundation.files.limits import MAX_OBJECT_COPIES
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.opendrive.borders import points_m
from simbev_ros.maps.opendrive.reading.attributes import Malformed, number
from simbev_ros.maps.opendrive.reading.document import Document, Road

_SAME_CORNER_M = 1e-3
_CIRCLE = 16
_MAX_T_M, _MAX_SIZE_M = 500.0, 1000.0
_STEP_M, _STRETCH_STEPS = 2.0, 2


@dataclass(frozen=True, slots=True)
class Placement:
    """Position and size of one copy of an object; sizes are 0 where the file gives none.

    Attributes:
        s_m: Distance along the road.
        t_m: Distance to the left of the reference line.
        bottom_m: Height of its underside above the road.
        length_m: Size along its heading.
        width_m: Size across its heading.
        height_m: Height.
        is_round: It is a circle of diameter ``width_m``.
    """

    s_m: float
    t_m: float
    bottom_m: float = 0.0
    length_m: float = 0.0
    width_m: float = 0.0
    height_m: float = 0.0
    is_round: bool = False


def iter_objects(document: Document) -> Iterator[tuple[Road, Element]]:
    """All objects of a document with their road."""
    return ((road, element) for road in document.roads.values() for element in road.element.findall("objects/object"))


def placement_of(element: Element) -> Placement:
    """Position of an object without its repetitions, and its size if it has no outline.

    Raises:
        Malformed: A number is missing, invalid or out of bounds.
    """
    place = Placement(number(element, "s"), number(element, "t"), number(element, "zOffset", 0.0))
    if outer_outline(element) is None:
        radius_m = number(element, "radius", 0.0)
        length_m, width_m = (2.0 * radius_m or number(element, name, 0.0) for name in ("length", "width"))
        height_m = number(element, "height", 0.0)
        place = replace(place, length_m=length_m, width_m=width_m, height_m=height_m, is_round=radius_m > 0.0)
    return _checked(place, element)


def copies_of(road: Road, element: Element) -> list[Placement]:
    """Placements of an object and of its repetitions at a distance from each other (OpenDRIVE 1.8, 13.4).

    Raises:
        Malformed: A number is missing, invalid or out of bounds, or there are too many copies.
    """
    own = placement_of(element)
    repeats = element.findall("repeat")
    found = [] if repeats else [own]
    for repeat in repeats:
        distance_m, length_m = number(repeat, "distance", 0.0), number(repeat, "length", 0.0)
        if distance_m <= 0.0:
            continue
        if length_m / distance_m + len(found) > MAX_OBJECT_COPIES:
            raise Malformed(repeat, f"it makes more than {MAX_OBJECT_COPIES} copies")
        offsets_m, start_m = np.arange(0.0, length_m + 1e-6, distance_m), number(repeat, "s", own.s_m)
        offsets_m = offsets_m[(start_m + offsets_m >= 0.0) & (start_m + offsets_m <= road.length_m + 1e-6)]
        found += _along(road, repeat, own, offsets_m, length_m)
    return found


def sweeps_of(road: Road, element: Element, width_m: float) -> list[tuple[Placement, Float64Array]]:
    """Stretches of an object that is repeated without gaps, such as a wall along the road.

    Args:
        road: The object's road.
        element: The object.
        width_m: Its width if the file gives none.

    Returns:
        The placement in the middle of each stretch, with the stretch's own height, and its (N, 3) outline, closed, map
        frame, on the road's surface.

    Raises:
        Malformed: As for ``copies_of``.
    """
    own, found = placement_of(element), []
    own = replace(own, width_m=own.width_m or width_m)
    for repeat in element.findall("repeat"):
        length_m, start_m = number(repeat, "length", 0.0), number(repeat, "s", own.s_m)
        first_m, last_m = max(0.0, -start_m), min(length_m, road.length_m - start_m)
        if number(repeat, "distance", 0.0) > 0.0 or last_m <= first_m:
            continue
        offsets_m = np.linspace(first_m, last_m, max(2, int((last_m - first_m) / _STEP_M) + 2))
        places = _along(road, repeat, own, offsets_m, length_m)
        for start in range(0, len(places) - 1, _STRETCH_STEPS):
            stretch = places[start : start + _STRETCH_STEPS + 1]
            found.append((stretch[len(stretch) // 2], _band_m(road, stretch)))
    return found


def outline_m(road: Road, element: Element, place: Placement | None = None, min_corners: int = 3) -> Float64Array:
    """(N, 3) corners of an object, map frame: its outline, else the rectangle or circle of its size.

    Args:
        road: The object's road.
        element: The object.
        place: Position and size of the copy; those of the object itself when omitted.
        min_corners: Fewer distinct corners are refused.

    Raises:
        Malformed: It has too few corners or no size, or a number is missing or invalid.
    """
    own = placement_of(element)
    place = place or own
    outline = outer_outline(element)
    if outline is None:
        corners_m = _from_local(road, element, place, _local_m(element, place))
    elif outline.find("cornerRoad") is not None:
        moved_m = place.s_m - own.s_m, place.t_m - own.t_m
        rows = [(number(c, "s"), number(c, "t"), number(c, "dz", 0.0)) for c in outline.findall("cornerRoad")]
        s_m, t_m, dz_m = np.array(rows).T
        corners_m = points_m(road, s_m + moved_m[0], t_m + moved_m[1])
        corners_m[:, 2] += dz_m
    else:
        corners = outline.findall("cornerLocal")
        local = [(number(c, "u"), number(c, "v"), number(c, "z", 0.0)) for c in corners]
        corners_m = _from_local(road, element, place, np.reshape(local, (-1, 3)))
    following_m = np.roll(corners_m, -1, axis=0)
    distinct_m: Float64Array = corners_m[np.linalg.norm(following_m - corners_m, axis=1) > _SAME_CORNER_M]
    if len(distinct_m) < min_corners:
        raise Malformed(element, f"its outline has fewer than {min_corners} corners")
    return distinct_m


def outer_outline(element: Element) -> Element | None:
    """The first outline of an object that is not the border of a hole."""
    outlines = [*element.findall("outline"), *element.findall("outlines/outline")]
    return next((outline for outline in outlines if outline.get("outer", "true") != "false"), None)


def heading_rad(road: Road, element: Element, s_m: float) -> float:
    """Heading of an object in the map frame."""
    return float(road.plan(np.array([s_m]))[2][0]) + number(element, "hdg", 0.0)


def _local_m(element: Element, place: Placement) -> Float64Array:
    """(N, 3) corners of the rectangle or circle of an object's size, in its own frame."""
    if place.length_m == place.width_m == 0.0:
        raise Malformed(element, "it has neither an outline nor a size")
    if place.is_round:
        turn_rad = np.arange(_CIRCLE) * (2.0 * np.pi / _CIRCLE)
        around = 0.5 * np.column_stack([np.cos(turn_rad), np.sin(turn_rad)])
    else:
        around = np.array([(0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5)])
    return np.column_stack([around * (place.length_m, place.width_m), np.zeros(len(around))])


def _from_local(road: Road, element: Element, place: Placement, local_m: Float64Array) -> Float64Array:
    """(N, 3) map frame positions of points in the frame of an object."""
    yaw_rad = heading_rad(road, element, place.s_m)
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    map_from_local = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    origin_m = points_m(road, np.array([place.s_m]), np.array([place.t_m]))
    return origin_m + [0.0, 0.0, place.bottom_m] + local_m @ map_from_local.T


def _along(road: Road, repeat: Element, own: Placement, offsets_m: Float64Array, length_m: float) -> list[Placement]:
    """Copies of an object at (N,) distances from the start of a repetition, which may change its position and size."""
    share = offsets_m / max(length_m, 1e-9)

    def values(name: str, default: float) -> Float64Array:
        start = number(repeat, f"{name}Start", default)
        return start + share * (number(repeat, f"{name}End", start) - start)

    s_m = number(repeat, "s", own.s_m) + offsets_m
    radius = own.is_round or repeat.get("radiusStart") is not None
    across = [2.0 * values("radius", own.width_m / 2.0)] * 2 if radius else []
    length, width = across or (values("length", own.length_m), values("width", own.width_m))
    columns = (
        s_m,
        values("t", own.t_m),
        values("zOffset", own.bottom_m),
        length,
        width,
        values("height", own.height_m),
    )
    rows = np.column_stack(columns)
    return [
        _checked(Placement(at_s, at_t, bottom, long, wide, high, radius), repeat)
        for at_s, at_t, bottom, long, wide, high in rows.tolist()
    ]


def _band_m(road: Road, places: list[Placement]) -> Float64Array:
    """(N, 3) closed outline of a band through placements, as wide as they are, on the road's surface."""
    s_m = np.array([place.s_m for place in places])
    t_m = np.array([place.t_m for place in places])
    half_m = np.array([place.width_m for place in places]) / 2.0
    right_m, left_m = points_m(road, s_m, t_m - half_m), points_m(road, s_m, t_m + half_m)
    return np.concatenate([right_m, left_m[::-1], right_m[:1]])


def _checked(place: Placement, element: Element) -> Placement:
    """The placement itself; sizes that are not positive are unknown."""
    if abs(place.t_m) > _MAX_T_M:
        raise Malformed(element, f"it is more than {_MAX_T_M:.0f} m from its road")
    sizes_m = (place.length_m, place.width_m, place.height_m)
    if max(*sizes_m, abs(place.bottom_m)) > _MAX_SIZE_M:
        raise Malformed(element, f"it is larger than {_MAX_SIZE_M:.0f} m")
    length_m, width_m, height_m = (max(size_m, 0.0) for size_m in sizes_m)
    return replace(place, length_m=length_m, width_m=width_m, height_m=height_m)
