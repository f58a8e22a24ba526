"""Redraws the roads of netconvert's OpenDRIVE file along the exact center lines of their lanes.

netconvert draws a road along the leftmost border of its lanes, which turns back on itself in bends that are tighter
than half the lane's width. It also puts roads of a decimeter between the halves of a loop that was split.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import cast
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import Lane, RoadNetwork

_SPACING_M = 0.1
_MAX_END_TURN_RAD = 0.3
_MEET_M = 0.1
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


def exact_opendrive(network: RoadNetwork) -> bytes:
    """The content of the map's OpenDRIVE file with the lanes of the net in their exact positions, in UTF-8."""
    root = ElementTree.parse(network.opendrive_path).getroot()
    edges: dict[str, list[Lane]] = defaultdict(list)
    for lane in sorted(network.lanes.values(), key=lambda lane: lane.index):
        edges[lane.edge].append(lane)
    ends_m: dict[str, Float64Array] = {}
    is_left_hand = 'lefthand="true"' in network.net_path.read_text(encoding="utf-8").partition("<location")[0]
    for road in root.iterfind("road"):
        for side in road.iterfind("lanes/laneSection/left"):
            side.tag = "right"  # netconvert's lanes in left-hand traffic, with negative ids
        edge = road.find("userData[@code='sumoId']")
        lanes = edges.get("" if edge is None else edge.get("value", ""), ())
        if lanes and len(lanes) == len(road.findall("lanes/laneSection/right/lane")):
            ends_m[road.get("id", "")] = _redraw(road, lanes if is_left_hand else lanes[::-1])
    _join_halves(root, ends_m)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{text}\n'.encode()


def _redraw(road: Element, lanes: Sequence[Lane]) -> Float64Array:
    """Draw a road along its widest lane, of lanes from left to right; return the (2, 3) ends of that."""
    middle = max(range(len(lanes)), key=lambda k: lanes[k].width_m)
    line_m = lanes[middle].centerline_m
    at_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1))])
    kept = np.unique(np.floor(at_m / _SPACING_M), return_index=True)[1]
    kept = np.append(kept[(kept == 0) | (at_m[-1] - at_m[kept] > _SPACING_M / 2.0)], len(at_m) - 1)
    points_m = line_m[kept]
    heading_rad, cubics = _smooth(points_m[:, :2])
    slopes = np.polynomial.polynomial.polyval((_NODES + 1.0) / 2.0, np.moveaxis(cubics[..., 1:] * [1, 2, 3], -1, 0))
    s_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(slopes, axis=1) @ _WEIGHTS / 2.0)])
    for name in ("object", "signal"):
        for element in road.iterfind(f"{name}s/{name}"):
            _move(element, road, points_m, heading_rad, s_m)
    road.set("length", f"{s_m[-1]:.8f}")
    names = ("planView", "elevationProfile", "lanes")
    plan, heights, sections = (cast(Element, road.find(name)) for name in names)
    plan[:] = [_piece(*row) for row in zip(s_m, points_m, heading_rad, np.diff(s_m), cubics, strict=False)]
    slopes = np.diff(points_m[:, 2]) / np.diff(s_m)
    heights[:] = [_record("elevation", *row) for row in zip(s_m, points_m[:, 2], slopes, strict=False)]
    left_m = sum(lane.width_m for lane in lanes[:middle]) + lanes[middle].width_m / 2.0
    sections.insert(0, _record("laneOffset", 0.0, left_m, 0.0))
    return points_m[[0, -1]]


def _smooth(points_m: Float64Array) -> tuple[Float64Array, Float64Array]:
    """(N,) directions at (N, 2) points, as of arcs through them, and the Hermite cubics between them.

    The (N - 1, 2, 4) coefficients are those of u and v, by a parameter from 0 to 1.
    """
    steps_m = np.diff(points_m, axis=0)
    chord_m = np.linalg.norm(steps_m, axis=1)
    chord_rad = np.unwrap(np.arctan2(steps_m[:, 1], steps_m[:, 0]))
    inner_rad = chord_rad[:-1] + np.diff(chord_rad) * chord_m[:-1] / (chord_m[:-1] + chord_m[1:])
    turns_rad = np.array([inner_rad[0] - chord_rad[0], inner_rad[-1] - chord_rad[-1]] if len(inner_rad) else [0.0, 0.0])
    ends_rad = chord_rad[[0, -1]] - np.clip(turns_rad, -_MAX_END_TURN_RAD, _MAX_END_TURN_RAD)
    heading_rad = np.concatenate([ends_rad[:1], inner_rad, ends_rad[1:]])
    chord = chord_m * np.exp(1j * (chord_rad - heading_rad[:-1]))
    start, end = chord_m + 0j, chord_m * np.exp(1j * np.diff(heading_rad))
    curve = np.stack([0.0 * start, start, 3.0 * chord - 2.0 * start - end, start + end - 2.0 * chord], axis=1)
    return heading_rad, np.stack([curve.real, curve.imag], axis=1)


def _piece(s_m: float, point_m: Float64Array, heading_rad: float, length_m: float, cubic: Float64Array) -> Element:
    """One <geometry> of a reference line."""
    numbers = {"s": s_m, "x": point_m[0], "y": point_m[1], "hdg": heading_rad, "length": length_m}
    piece = Element("geometry", {name: f"{value:.8f}" for name, value in numbers.items()})
    names = [f"{letter}{axis}" for axis in "UV" for letter in "abcd"]
    coefficients = {name: f"{value:.8f}" for name, value in zip(names, cubic.ravel().tolist(), strict=True)}
    SubElement(piece, "paramPoly3", coefficients, pRange="normalized")
    return piece


def _record(tag: str, s_m: float, value: float, slope: float) -> Element:
    """A linear record from a distance along a road on."""
    numbers = {"s": s_m, "a": value, "b": slope, "c": 0.0, "d": 0.0}
    return Element(tag, {name: f"{number:.6f}" for name, number in numbers.items()})


def _move(
    element: Element, road: Element, points_m: Float64Array, heading_rad: Float64Array, s_m: Float64Array
) -> None:
    """Give an object or signal its coordinates along a road's new reference line."""
    pieces = [[float(p.get(key, 0.0)) for key in ("s", "x", "y", "hdg")] for p in road.iterfind("planView/geometry")]
    s, t = float(element.get("s", 0.0)), float(element.get("t", 0.0))
    start_m, x_m, y_m, old_rad = [piece for piece in pieces if piece[0] <= s][-1]
    position = complex(x_m, y_m) + complex(s - start_m, t) * np.exp(1j * old_rad)
    offsets = position - (points_m[:, 0] + 1j * points_m[:, 1])
    nearest = int(np.argmin(np.abs(offsets)))
    local = offsets[nearest] * np.exp(-1j * heading_rad[nearest])
    new_s_m = float(np.clip(s_m[nearest] + local.real, 0.0, s_m[-1]))
    element.attrib.update(s=f"{new_s_m:.8f}", t=f"{local.imag:.8f}")
    if element.get("hdg"):
        element.set("hdg", f"{float(element.get('hdg', 0.0)) + old_rad - heading_rad[nearest]:.8f}")


def _join_halves(root: Element, ends_m: Mapping[str, Float64Array]) -> None:
    """Link two roads that alone meet to each other, without a junction and a road between; (2, 3) ends of roads."""
    roads = {road.get("id"): road for road in root.iterfind("road")}
    for junction in root.findall("junction"):
        inside = {connection.get("connectingRoad") for connection in junction.iterfind("connection")}
        if len(inside) != 1:
            continue
        road = roads[inside.pop()]
        ends = {tag: road.find(f"link/{tag}") for tag in ("predecessor", "successor")}
        names = ["" if end is None else end.get("elementId", "") for end in ends.values()]
        if not ends_m.keys() >= set(names) or np.linalg.norm(ends_m[names[1]][0] - ends_m[names[0]][1]) > _MEET_M:
            continue
        before, after = map(roads.__getitem__, names)
        for own, tag, back in ((before, "successor", "predecessor"), (after, "predecessor", "successor")):
            link = cast(Element, own.find(f"link/{tag}"))
            link.attrib.clear()
            link.attrib.update(cast(Element, ends[tag]).attrib)
            for through in road.iterfind("lanes/laneSection/right/lane/link"):
                number, target = (cast(Element, through.find(name)).attrib["id"] for name in (back, tag))
                lane = own.find(f"lanes/laneSection/right/lane[@id='{number}']/link")
                SubElement(cast(Element, lane), tag, id=target)
        root.remove(road)
        root.remove(junction)
