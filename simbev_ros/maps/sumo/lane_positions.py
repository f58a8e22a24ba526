"""Keeps the lanes of a user's net where they are while netconvert adds sidewalks, crossings and walking areas.

netconvert cuts every lane, with its first and last segment extended, at the outlines of the junctions at its ends, and
enlarges outlines for what it adds. It cuts nothing where a lane with a shape of its own misses an outline. Therefore
each junction is given a tiny outline between its lanes for the duration of the conversion.
"""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import count
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import shapely

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.polylines import Polylines

_SIDEWALK_WIDTH_M = 2.0
_MIN_SPEED_MPS, _MAX_SPEED_MPS = 1.0, 14.0  # of streets with sidewalks
_DEFAULT_WIDTH_M, _DEFAULT_SPEED_MPS = 3.2, 13.89
_EXTENSION_M = 110.0  # netconvert extends lanes by 100 m
_CLEARANCE_M = 0.04
_TINY_M = 0.01
_RING_M = 0.1
_ANGLES_RAD = 2.0 * np.pi * (np.arange(12) + 0.4) / 12.0
_DIRECTIONS = np.column_stack([np.cos(_ANGLES_RAD), np.sin(_ANGLES_RAD)])
_PEDESTRIANS = {"pedestrian", "wheelchair"}


def add_sidewalks(root: Element) -> None:
    """Add a sidewalk beside the outermost lane of every street of up to 50 km/h that has none.

    Args:
        root: The net, checked by ``NetFile``; changed in place.
    """
    left_hand = root.get("lefthand") in ("true", "1")
    edges = {edge.attrib["id"]: edge for edge in _streets(root) if _lacks_sidewalk(edge)}
    outer = [edge.findall("lane")[0] for edge in edges.values()]
    lines = Polylines.from_lines([_points_m(lane) for lane in outer])
    offset_m = np.array([(float(lane.get("width", _DEFAULT_WIDTH_M)) + _SIDEWALK_WIDTH_M) / 2.0 for lane in outer])
    shapes_m = lines.split(lines.offset_to_left((1.0 if left_hand else -1.0) * offset_m[lines.row])) if outer else []
    for (name, edge), shape_m in zip(edges.items(), shapes_m, strict=True):
        for number, lane in enumerate(edge.findall("lane"), start=1):
            allowed = " ".join(kind for kind in lane.get("allow", "").split() if kind not in _PEDESTRIANS)
            lane.attrib.update(id=f"{name}_{number}", index=str(number), allow=allowed)
            lane.set("disallow", f"{lane.get('disallow', '')} pedestrian".strip())
        attributes = {key: value for key, value in edge.findall("lane")[0].items() if key in ("speed", "length")}
        attributes |= {"id": f"{name}_0", "index": "0", "width": f"{_SIDEWALK_WIDTH_M:.2f}", "shape": _text(shape_m)}
        edge.insert([child.tag for child in edge].index("lane"), Element("lane", attributes, allow="pedestrian"))
    for connection in root.iter("connection"):
        for end in ("from", "to"):
            if connection.get(end) in edges:
                connection.set(f"{end}Lane", str(int(connection.get(f"{end}Lane", "0")) + 1))
    for opposite in root.iter("neigh"):
        name, _, index = opposite.get("lane", "").rpartition("_")
        if name in edges and index.isdecimal():
            opposite.set("lane", f"{name}_{int(index) + 1}")


def fix_lanes(root: Element) -> dict[str, str]:
    """Make netconvert keep the shapes of all lanes outside junctions.

    Args:
        root: The net, checked by ``NetFile``; changed in place.

    Returns:
        Junction → its outline, which it lost, for ``restore_outlines``; without those that had none.
    """
    lines: dict[str | None, list[shapely.LineString]] = defaultdict(list)
    for edge in _streets(root):
        for lane in edge.iter("lane"):
            lane.set("customShape", "1")
            line = shapely.LineString(_extended(_points_m(lane)))
            for end in ("from", "to"):
                lines[edge.get(end)].append(line)
    outlines = {}
    for junction in root.iterfind("junction"):
        if junction.get("type") == "internal":
            continue
        outline_m = _points_m(junction)
        x, y, z = (float(junction.get(axis, 0.0)) for axis in "xyz")
        if len(outline_m) > 2:
            outlines[junction.attrib["id"]] = junction.attrib["shape"]
            x, y = shapely.centroid(shapely.Polygon(outline_m)).coords[0]
        corner_m = np.array([*_free_position(np.array([x, y]), lines[junction.get("id")]), z])
        tiny_m = corner_m + _TINY_M * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
        junction.attrib.update(shape=_text(tiny_m), customShape="1")
    return outlines


def restore_outlines(net: Path, outlines: Mapping[str, str]) -> None:
    """Give the junctions of a net that netconvert made their outlines back; walking areas that are outlines, too."""
    text = net.read_text(encoding="utf-8").replace(' customShape="1"', "")

    def with_outline(match: re.Match[str]) -> str:
        return f'{match[1]}{outlines.get(match[2], match[3])}"'

    def with_area(match: re.Match[str]) -> str:
        extent_m = np.ptp([[*map(float, point.split(",")[:2])] for point in match[3].split()], axis=0)
        return match[0] if extent_m.max() > 2.0 * _TINY_M else with_outline(match)

    text = re.sub(r'(<junction id="([^"]*)" [^>]*shape=")([^"]*)"', with_outline, text)
    net.write_text(re.sub(r'(<lane id=":([^"]*)_w0_0" [^>]*shape=")([^"]*)"', with_area, text), encoding="utf-8")


def _free_position(middle_m: Float64Array, lines: list[shapely.LineString]) -> Float64Array:
    """(2,) position close to the middle of a junction, clear of the lines through it."""
    tree = shapely.STRtree(lines)
    for radius in count():
        ring_m = middle_m + radius * _RING_M * _DIRECTIONS
        near, _ = tree.query(shapely.points(ring_m), predicate="dwithin", distance=_CLEARANCE_M)
        free = np.setdiff1d(np.arange(len(ring_m)), near)
        if len(free):
            return np.asarray(ring_m[free[0]])
    raise AssertionError("lines have no area")


def _extended(line_m: Float64Array) -> Float64Array:
    """(N + 2, 2) line in plan view with its first and last segment extended."""
    plan_m = line_m[:, :2]
    distinct_m = plan_m[np.concatenate([[True], np.linalg.norm(np.diff(plan_m, axis=0), axis=1) > 0.0])]
    if len(distinct_m) < 2:
        return plan_m
    out_m = distinct_m[[0, -1]] - distinct_m[[1, -2]]
    far_m = plan_m[[0, -1]] + _EXTENSION_M * out_m / np.linalg.norm(out_m, axis=1, keepdims=True)
    return np.concatenate([far_m[:1], plan_m, far_m[1:]])


def _streets(root: Element) -> Iterator[Element]:
    """Edges outside junctions."""
    return (edge for edge in root.iterfind("edge") if edge.get("function") in (None, "normal", "connector"))


def _lacks_sidewalk(edge: Element) -> bool:
    """Whether an edge is a street with a sidewalk by rule that has no lane for pedestrians only."""
    lanes = edge.findall("lane")
    speed_mps = max(float(lane.get("speed", _DEFAULT_SPEED_MPS)) for lane in lanes)
    walked = any(lane.get("allow", "") and _PEDESTRIANS.issuperset(lane.get("allow", "").split()) for lane in lanes)
    return _MIN_SPEED_MPS < speed_mps <= _MAX_SPEED_MPS and not walked


def _points_m(element: Element) -> Float64Array:
    """(N, 3) points of the shape of an element."""
    points = [[float(value) for value in point.split(",")] for point in element.get("shape", "").split()]
    return np.array(points).reshape(-1, 3)


def _text(line_m: Float64Array) -> str:
    """SUMO's notation of an (N, 3) line."""
    return " ".join(f"{x:.4f},{y:.4f},{z:.4f}" for x, y, z in line_m.tolist())
