"""Checks a user's SUMO net and repairs it where possible, before netconvert reads it.

What cannot be used is left out; every repair and omission is reported as a sentence for the user.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Set
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_LANES_PER_EDGE
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.sumo.islands import driven_parts
from simbev_ros.maps.sumo.signal_programs import join_partial_programs

_MIN_WIDTH_M = 0.2
_MAX_WIDTH_M = 30.0
_MIN_LENGTH_M = 0.05
_MIN_SPEED_MPS, _MAX_SPEED_MPS = 0.1, 150.0
_DEFAULT_WIDTH_M = 3.2
_DEFAULT_SPEED_MPS = 13.89
_MAX_COORDINATE_M = 1e8
_SPECIAL_CLASSES = frozenset(
    ("private", "authority", "army", "vip", "hov", "taxi", "evehicle", "emergency", "custom1", "custom2")
)
_ARTICLES = {"edge": "an edge", "junction": "a junction"}
_CAR_CLASSES = "passenger delivery truck bus motorcycle"


class NetFile:
    """The XML of a net, checked and changed in place.

    Attributes:
        findings: What was left out or repaired.
    """

    def __init__(self, path: Path, root: Element) -> None:
        self._path, self._root = path, root
        self.findings = Findings(path)
        self._edges = self._unique("edge")
        self._junctions = self._unique("junction")

    def repair(self) -> None:
        """Check everything that is read later; remove what cannot be built or reached, with a note.

        Raises:
            InputError: No lane for cars is left.
        """
        self._root.attrib.setdefault("version", "1.20")
        self._leave_out_junctions()
        faults: dict[str, list[Element]] = defaultdict(list)
        for edge in self._streets():
            if fault := self._fault_of(edge):
                faults[fault].append(edge)
        for fault, edges in faults.items():
            self._leave_out(edges, fault)
        self._repair_lanes(list(self.lanes()))
        for element, lane in self._remove_dangling_connections():
            self.findings.left_out("a connection of a missing lane is left out", element, lane)
        self._open_to_cars()
        self._leave_out(
            [edge for edge in self._streets() if not any(map(_on_land, edge.iter("lane")))], "not for roads"
        )
        self._require_lanes_for_cars()
        length_m = {edge: _length_m(self._points(next(edge.iter("lane")), "shape")) for edge in self._streets()}
        self._leave_out([edge for edge, length in length_m.items() if length < _MIN_LENGTH_M], "without length")
        self._require_lanes_for_cars()
        self._leave_out_lone_paths()
        self._remove_dangling_connections()
        join_partial_programs(self._root, self.findings)

    def extent_m(self) -> tuple[Float64Array, Float64Array]:
        """(3,) lowest and highest coordinates of the junctions and of the lanes outside them."""
        lanes_m = [self._points(lane, "shape") for lane in self.lanes()]
        points = np.concatenate([*lanes_m, *(self._position(junction) for junction in self._junctions.values())])
        return points.min(axis=0), points.max(axis=0)

    def transform(self, map_from_net: Callable[[Float64Array], Float64Array]) -> None:
        """Apply a function of (N, 3) points to every coordinate, also of the findings."""
        self.findings.transform(map_from_net)
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
                points_m = self._points(element, "shape")
                if np.isfinite(points_m).all():
                    yield element, "shape", points_m
                else:
                    del element.attrib["shape"]  # of a junction or a lane inside one: netconvert makes its own

    def _streets(self) -> Iterator[Element]:
        """Edges outside junctions."""
        return (edge for edge in self._edges.values() if edge.get("function") in (None, "normal", "connector"))

    def _unique(self, tag: str) -> dict[str, Element]:
        """Elements by id; those without an id, or with one that is taken, are removed."""
        found: dict[str, Element] = {}
        superfluous: list[Element] = []
        for element in self._root.findall(tag):
            name = element.get("id")
            if not name or name in found:
                superfluous.append(element)
            else:
                found[name] = element
        self._remove(set(superfluous))
        for element in superfluous:
            rule = f"{_ARTICLES[tag]} without an id of its own is left out"
            self.findings.left_out(rule, element, element.get("id", ""))
        return found

    def _leave_out_junctions(self) -> None:
        """Remove the junctions without a position."""
        lost = {name for name, junction in self._junctions.items() if not np.isfinite(self._position(junction)).all()}
        self._remove({self._junctions[name] for name in lost})
        for name in sorted(lost):
            self.findings.left_out("a junction without a position is left out", self._junctions.pop(name), name)

    def _fault_of(self, edge: Element) -> str:
        """The reason why an edge is unusable, or ""."""
        lanes = edge.findall("lane")
        if any(edge.get(end) not in self._junctions for end in ("from", "to")):
            return "from or to missing junctions"
        if not lanes:
            return "without lanes"
        if len(lanes) > MAX_LANES_PER_EDGE:
            return f"with more than {MAX_LANES_PER_EDGE} lanes"
        shapes_m = [self._points(lane, "shape") for lane in lanes]
        if any(len(points_m) < 2 or not np.isfinite(points_m).all() for points_m in shapes_m):
            return "with a lane shape that is not at least two points x,y or x,y,z in meters"
        if any(self._number(lane, "width", _DEFAULT_WIDTH_M) > _MAX_WIDTH_M for lane in lanes):
            return f"with a lane wider than {_MAX_WIDTH_M:g} m"
        return ""

    def _repair_lanes(self, lanes: list[Element]) -> None:
        """Replace implausible widths, speeds and lengths by SUMO's defaults."""
        narrow = [lane for lane in lanes if not self._number(lane, "width", _DEFAULT_WIDTH_M) >= _MIN_WIDTH_M]
        speeds_mps = {lane: self._number(lane, "speed", _DEFAULT_SPEED_MPS) for lane in lanes}
        implausible = [
            lane for lane, speed_mps in speeds_mps.items() if not _MIN_SPEED_MPS <= speed_mps <= _MAX_SPEED_MPS
        ]
        for lane in lanes:
            if not self._number(lane, "length", _MIN_LENGTH_M) >= _MIN_LENGTH_M:
                del lane.attrib["length"]
        for lane in narrow:
            del lane.attrib["width"]
        for lane in implausible:
            lane.set("speed", f"{_DEFAULT_SPEED_MPS}")
        for lane in narrow:
            rule = f"a lane without width is made {_DEFAULT_WIDTH_M} m wide"
            self.findings.repaired(rule, lane, lane.get("id", ""), self._middle_m(lane))
        limits = f"below {_MIN_SPEED_MPS:g} or above {_MAX_SPEED_MPS:g} m/s"
        for lane in implausible:
            rule = f"a speed limit {limits} is replaced by {_DEFAULT_SPEED_MPS} m/s"
            self.findings.repaired(rule, lane, lane.get("id", ""), self._middle_m(lane))

    def _open_to_cars(self) -> None:
        """If no lane is for cars, open lanes for special vehicles (race tracks, for example) to them."""
        if any(for_cars(lane) for lane in self.lanes()):
            return
        special = [lane for lane in self.lanes() if _SPECIAL_CLASSES & set(lane.get("allow", "").split())]
        for lane in special:
            lane.set("allow", f"{lane.get('allow')} {_CAR_CLASSES}")
        for lane in special:
            rule = "no lane is for cars: a lane for special vehicles is opened to them"
            self.findings.repaired(rule, lane, lane.get("id", ""), self._middle_m(lane))

    def _require_lanes_for_cars(self) -> None:
        if not any(for_cars(lane) for lane in self.lanes()):
            reasons = "".join(f"; {sentence}" for sentence in self.findings.sentences()[:3])
            raise InputError(f"{self._path}: has no lanes that cars may drive on{reasons}")

    def _leave_out_lone_paths(self) -> None:
        """Keep the connected parts of the net that cars may drive on."""
        edges = list(self._streets())
        starts, ends = ([edge.attrib[end] for edge in edges] for end in ("from", "to"))
        kept, parts = driven_parts(starts, ends, np.array([self._driven_m(edge) for edge in edges]))
        self.findings.add(*parts)
        self._leave_out([edge for edge, keep in zip(edges, kept, strict=True) if not keep], "that no road reaches")
        used = {edge.get(end) for edge in self._streets() for end in ("from", "to")}
        isolated = {name: junction for name, junction in self._junctions.items() if name not in used}
        self._remove(set(isolated.values()))
        for name in isolated:
            del self._junctions[name]

    def _leave_out(self, edges: list[Element], reason: str) -> None:
        self._remove(set(edges))
        for edge in edges:
            driven = [lane for lane in edge.iter("lane") if for_cars(lane)]
            middle_m = self._middle_m(driven[0]) if driven else None
            lost_m = np.nan_to_num(self._driven_m(edge))
            name = self._edges.pop(edge.attrib["id"]).attrib["id"]
            self.findings.left_out(f"an edge {reason} is left out", edge, name, middle_m, lost_m)

    def _driven_m(self, edge: Element) -> float:
        """Total length of an edge's lanes for cars."""
        return sum(_length_m(self._points(lane, "shape")) for lane in edge.iter("lane") if for_cars(lane))

    def _middle_m(self, lane: Element) -> Float64Array | None:
        """(2,) middle of a lane in the net's coordinates; None if it has no usable shape."""
        points_m = self._points(lane, "shape")
        return points_m[len(points_m) // 2, :2] if len(points_m) and np.isfinite(points_m).all() else None

    def _remove_dangling_connections(self) -> list[tuple[Element, str]]:
        """Remove connections from or to missing lanes; return each with the first such lane."""
        count = {name: len(edge.findall("lane")) for name, edge in self._edges.items()}
        dangling: dict[Element, str] = {}
        for connection in self._root.findall("connection"):
            for end in ("from", "to"):
                edge, lane = connection.get(end, ""), connection.get(f"{end}Lane", "0")
                if not (lane.isdecimal() and int(lane) < count.get(edge, 0)):
                    dangling.setdefault(connection, f"{edge}_{lane}")
        self._remove(set(dangling))
        return list(dangling.items())

    def _remove(self, elements: Set[Element]) -> None:
        self._root[:] = [child for child in self._root if child not in elements]

    def _position(self, junction: Element) -> Float64Array:
        """(1, 3) position of a junction; NaN where it is not a number."""
        return np.array([[self._number(junction, axis, 0.0) for axis in "xyz"]])

    def _points(self, element: Element, attribute: str) -> Float64Array:
        """(N, 3) points of "x,y x,y" or "x,y,z x,y,z"; empty if there are none, one of NaN if they are invalid."""
        try:
            points = [[float(value) for value in point.split(",")] for point in element.get(attribute, "").split()]
            array = np.array([(*point, 0.0) if len(point) == 2 else point for point in points]).reshape(-1, 3)
        except ValueError:
            return np.full((1, 3), np.nan)
        return array if np.all(np.abs(array) < _MAX_COORDINATE_M) else np.full((1, 3), np.nan)

    def _number(self, element: Element, attribute: str, default: float) -> float:
        """A number of an element, or NaN if it is invalid."""
        try:
            value = float(element.get(attribute, default))
        except ValueError:
            return math.nan
        return value if abs(value) < _MAX_COORDINATE_M else math.nan


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
