"""Checks a user's SUMO net and repairs it where possible, before netconvert reads it.

Every error names file, line and problem; every repair is reported as a sentence for the user.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Set
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.errors import InputError
from simbev_ros.maps.safe_xml import place_of
from simbev_ros.maps.sumo.islands import on_mainland
from simbev_ros.types import Float64Array

_MIN_WIDTH_M = 0.2
_MAX_WIDTH_M = 30.0
_MIN_LENGTH_M = 0.05
_MIN_SPEED_MPS, _MAX_SPEED_MPS = 0.5, 150.0
_DEFAULT_WIDTH_M = 3.2
_DEFAULT_SPEED_MPS = 13.89
_MAX_COORDINATE_M = 1e8


class NetFile:
    """The XML of a net, checked and changed in place.

    Attributes:
        notes: Repairs, one sentence each.
    """

    def __init__(self, path: Path, root: Element) -> None:
        self._path, self._root = path, root
        self.notes: list[str] = []
        self._edges = self._unique("edge")
        self._junctions = self._unique("junction")

    def repair(self) -> None:
        """Check everything that is read later; remove what cannot be built or reached.

        Raises:
            InputError: An id appears twice, a number is invalid, an edge has no start or end junction, a lane has no
                shape, or there is no lane for cars.
        """
        self._root.attrib.setdefault("version", "1.20")
        lines = {lane: self._points(lane, "shape") for edge in self._streets() for lane in edge.iter("lane")}
        for edge in self._streets():
            self._check_edge(edge)
        for lane, points in lines.items():
            if len(points) < 2:
                self._refuse(lane, f"lane {lane.get('id')}: shape: needs at least two points")
        self._repair_lanes(list(lines))
        if dangling := self._remove_dangling_connections():
            self.notes.append(f"connections with missing lanes were left out: {_summarize(dangling)}")
        self._leave_out(
            [edge for edge in self._streets() if not any(map(_on_land, edge.iter("lane")))], "not for roads"
        )
        if not any(for_cars(lane) for lane in self.lanes()):
            raise InputError(f"{self._path}: has no lanes that cars may drive on")
        length_m = {edge: _length_m(lines[next(edge.iter("lane"))]) for edge in self._streets()}
        self._leave_out([edge for edge, length in length_m.items() if length < _MIN_LENGTH_M], "without length")
        self._leave_out_islands(length_m)
        self._remove_dangling_connections()

    def extent_m(self) -> tuple[Float64Array, Float64Array]:
        """(3,) lowest and highest coordinates of the junctions and of the lanes outside them."""
        lanes_m = [self._points(lane, "shape") for lane in self.lanes()]
        points = np.concatenate([*lanes_m, *(self._position(junction) for junction in self._junctions.values())])
        return points.min(axis=0), points.max(axis=0)

    def transform(self, map_from_net: Callable[[Float64Array], Float64Array]) -> None:
        """Apply a function of (N, 3) points to every coordinate."""
        geometries = list(self._geometries())
        ends = np.cumsum([len(points) for _, _, points in geometries])[:-1]
        transformed = np.split(map_from_net(np.concatenate([points for _, _, points in geometries])), ends)
        for (element, attribute, _), points in zip(geometries, transformed, strict=True):
            if attribute:
                element.set(attribute, " ".join(",".join(f"{value:.4f}" for value in point) for point in points))
            else:
                element.attrib.update(zip("xyz", (f"{value:.4f}" for value in points[0]), strict=True))

    def lanes(self) -> Iterator[Element]:
        """Lanes outside junctions."""
        return (lane for edge in self._streets() for lane in edge.iter("lane"))

    def _geometries(self) -> Iterator[tuple[Element, str, Float64Array]]:
        """Elements, the attribute of a shape ("" for a position), and its (N, 3) points."""
        for junction in self._junctions.values():
            yield junction, "", self._position(junction)
        for element in (*self._junctions.values(), *self._edges.values(), *self._root.iter("lane")):
            if element.get("shape"):
                yield element, "shape", self._points(element, "shape")

    def _streets(self) -> Iterator[Element]:
        """Edges outside junctions."""
        return (edge for edge in self._edges.values() if edge.get("function") in (None, "normal", "connector"))

    def _unique(self, tag: str) -> dict[str, Element]:
        found: dict[str, Element] = {}
        for element in self._root.findall(tag):
            name = element.get("id")
            if not name:
                self._refuse(element, f"{tag}: id: is missing")
            if name in found:
                self._refuse(element, f"{tag} {name}: appears twice; the other is {place_of(self._path, found[name])}")
            found[name] = element
        return found

    def _check_edge(self, edge: Element) -> None:
        for end in ("from", "to"):
            if edge.get(end) not in self._junctions:
                self._refuse(edge, f"edge {edge.get('id')}: {end}: there is no junction {edge.get(end)!r}")
        if edge.find("lane") is None:
            self._refuse(edge, f"edge {edge.get('id')}: has no lanes")

    def _repair_lanes(self, lanes: list[Element]) -> None:
        """Replace implausible widths, speeds and lengths by SUMO's defaults."""
        narrow = [lane for lane in lanes if self._number(lane, "width", _DEFAULT_WIDTH_M) < _MIN_WIDTH_M]
        speeds_mps = {lane: self._number(lane, "speed", _DEFAULT_SPEED_MPS) for lane in lanes}
        implausible = [
            lane for lane, speed_mps in speeds_mps.items() if not _MIN_SPEED_MPS <= speed_mps <= _MAX_SPEED_MPS
        ]
        for lane in lanes:
            if self._number(lane, "width", _DEFAULT_WIDTH_M) > _MAX_WIDTH_M:
                self._refuse(lane, f"lane {lane.get('id')}: width: is above {_MAX_WIDTH_M:g} m")
            if self._number(lane, "length", _MIN_LENGTH_M) < _MIN_LENGTH_M:
                del lane.attrib["length"]
        for lane in narrow:
            del lane.attrib["width"]
        for lane in implausible:
            lane.set("speed", f"{_DEFAULT_SPEED_MPS}")
        if narrow:
            self.notes.append(f"lanes without width were made {_DEFAULT_WIDTH_M} m wide: {_summarize_ids(narrow)}")
        if implausible:
            limits = f"below {_MIN_SPEED_MPS:g} or above {_MAX_SPEED_MPS:g} m/s"
            self.notes.append(
                f"lanes with a speed limit {limits} were given {_DEFAULT_SPEED_MPS} m/s: {_summarize_ids(implausible)}"
            )

    def _leave_out_islands(self, length_m: Mapping[Element, float]) -> None:
        """Keep only the largest connected part of the net."""
        edges = list(self._streets())
        starts, ends = ([edge.attrib[end] for edge in edges] for end in ("from", "to"))
        kept = on_mainland(starts, ends, np.array([length_m[edge] for edge in edges]))
        self._leave_out(
            [edge for edge, keep in zip(edges, kept, strict=True) if not keep], "not connected with the rest"
        )
        used = {edge.get(end) for edge in self._streets() for end in ("from", "to")}
        isolated = {name: junction for name, junction in self._junctions.items() if name not in used}
        self._remove(set(isolated.values()))
        for name in isolated:
            del self._junctions[name]

    def _leave_out(self, edges: list[Element], reason: str) -> None:
        self._remove(set(edges))
        for edge in edges:
            del self._edges[edge.attrib["id"]]
        if edges:
            self.notes.append(f"edges {reason} were left out: {_summarize_ids(edges)}")

    def _remove_dangling_connections(self) -> set[str]:
        """Remove connections from or to missing lanes; return these lanes."""
        count = {name: len(edge.findall("lane")) for name, edge in self._edges.items()}
        dangling, missing_lanes = set(), set()
        for connection in self._root.findall("connection"):
            for end in ("from", "to"):
                edge, lane = connection.get(end, ""), self._number(connection, f"{end}Lane", 0.0)
                if lane >= count.get(edge, 0):
                    dangling.add(connection)
                    missing_lanes.add(f"{edge}_{lane:g}")
        self._remove(dangling)
        return missing_lanes

    def _remove(self, elements: Set[Element]) -> None:
        self._root[:] = [child for child in self._root if child not in elements]

    def _position(self, junction: Element) -> Float64Array:
        """(1, 3) position of a junction."""
        return np.array([[self._number(junction, axis, 0.0) for axis in "xyz"]])

    def _points(self, element: Element, attribute: str) -> Float64Array:
        """(N, 3) points of "x,y x,y" or "x,y,z x,y,z"; an empty array if there are none."""
        try:
            points = [[float(value) for value in point.split(",")] for point in element.get(attribute, "").split()]
            array = np.array([(*point, 0.0) if len(point) == 2 else point for point in points]).reshape(-1, 3)
        except ValueError:
            array = np.full((1, 3), np.nan)
        if not np.all(np.abs(array) < _MAX_COORDINATE_M):
            self._refuse(element, f"{_name(element)}: {attribute}: must be points x,y or x,y,z in meters")
        return array

    def _number(self, element: Element, attribute: str, default: float | None = None) -> float:
        text = element.get(attribute)
        if text is None and default is not None:
            return default
        try:
            value = float(text or "")
        except ValueError:
            value = math.nan
        if not abs(value) < _MAX_COORDINATE_M:
            self._refuse(element, f"{_name(element)}: {attribute}: must be a number, not {text!r}")
        return value

    def _refuse(self, element: Element, problem: str) -> NoReturn:
        raise InputError(f"{place_of(self._path, element)}: {problem}")


def for_cars(lane: Element) -> bool:
    """Whether cars may use a lane."""
    return _allows(lane, "passenger")


def _on_land(lane: Element) -> bool:
    """Whether a lane belongs to a road or path, not to rails or a waterway."""
    return any(_allows(lane, kind) for kind in ("passenger", "delivery", "bus", "bicycle", "pedestrian"))


def _allows(lane: Element, kind: str) -> bool:
    allowed, disallowed = lane.get("allow"), lane.get("disallow", "")
    return bool({"all", kind} & set(allowed.split())) if allowed else not {"all", kind} & set(disallowed.split())


def _length_m(points: Float64Array) -> float:
    return float(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1).sum())


def _name(element: Element) -> str:
    return f"{element.tag} {element.get('id', '')}".strip()


def _summarize_ids(elements: list[Element]) -> str:
    return _summarize(element.get("id", "") for element in elements)


def _summarize(names: Iterable[str]) -> str:
    """The number of names, and the first few in sorted order."""
    ordered = sorted(names)
    return f"{len(ordered)} ({', '.join(ordered[:4])}{', …' if len(ordered) > 4 else ''})"
