"""Writes small Lanelet2 files for the tests: single lanelets, or a crossing of four roads with all its rules."""

import itertools
from collections.abc import Callable, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np
from pyproj import Transformer

Point = tuple[float, float, float]
LANE_M = 3.5
BOX_M = 12.0
SQUARE_UTM_M = (300e3, 3900e3)
"""Southwest corner of the MGRS square 54SUE."""
_TO_EARTH = Transformer.from_crs("+proj=utm +zone=54 +datum=WGS84", "EPSG:4326", always_xy=True)


class LaneletSample:
    """A Lanelet2 file under construction; ids are handed out in order."""

    def __init__(
        self, origin_m: tuple[float, float] = (5000.0, 5000.0), local: bool = True, on_earth: bool = True
    ) -> None:
        self._root = Element("osm", generator="simbev tests")
        SubElement(self._root, "MetaInfo", format_version="1", map_version="1")
        self._origin_m, self._local, self._on_earth = origin_m, local, on_earth
        self._points: dict[Point, str] = {}
        self._lines: dict[tuple[str, ...], str] = {}
        self._last = 0

    def point(self, x: float, y: float, z: float = 0.0) -> str:
        """Id of the point at a position relative to the sample's origin."""
        key = round(x, 3), round(y, 3), round(z, 3)
        if key not in self._points:
            x_m, y_m = self._origin_m[0] + key[0], self._origin_m[1] + key[1]
            longitude, latitude = _TO_EARTH.transform(SQUARE_UTM_M[0] + x_m, SQUARE_UTM_M[1] + y_m)
            position = (
                {"lat": f"{latitude:.11f}", "lon": f"{longitude:.11f}"} if self._on_earth else {"lat": "", "lon": ""}
            )
            local = {"local_x": f"{x_m:.4f}", "local_y": f"{y_m:.4f}"} if self._local else {}
            self._points[key] = self.element("node", {**local, "ele": f"{key[2]:.3f}"}, position)
        return self._points[key]

    def line(
        self, points: Sequence[Sequence[float]], kind: str = "line_thin", subtype: str = "solid", **tags: str
    ) -> str:
        """Id of the line through positions; a line through the same points, in either direction, is not repeated."""
        ids = tuple(self.point(*point) for point in points)
        for known in (ids, ids[::-1]):
            if known in self._lines:
                return self._lines[known]
        name = self.element("way", {"type": kind, "subtype": subtype, **tags})
        for node in ids:
            SubElement(self._root[-1], "nd", ref=node)
        self._lines[ids] = name
        return name

    def relation(self, tags: dict[str, str], *members: tuple[str, str, str]) -> str:
        """Id of a new relation with (type, role, reference) members."""
        name = self.element("relation", tags)
        for kind, role, reference in members:
            SubElement(self._root[-1], "member", type=kind, role=role, ref=reference)
        return name

    def lanelet(self, left: str, right: str, subtype: str = "road", rules: Sequence[str] = (), **tags: str) -> str:
        """Id of a new lanelet between two lines."""
        everything = {"type": "lanelet", "subtype": subtype, "location": "urban", "one_way": "yes", **tags}
        regulations = (("relation", "regulatory_element", rule) for rule in rules)
        return self.relation(everything, ("way", "left", left), ("way", "right", right), *regulations)

    def rule(self, subtype: str, *members: tuple[str, str, str], **tags: str) -> str:
        """Id of a new regulatory element with (type, role, reference) members."""
        return self.relation({"type": "regulatory_element", "subtype": subtype, **tags}, *members)

    def add_rule(self, lanelet: str, rule: str) -> None:
        """Let a lanelet refer to a regulatory element."""
        element = next(e for e in self._root.findall("relation") if e.get("id") == lanelet)
        SubElement(element, "member", type="relation", role="regulatory_element", ref=rule)

    def element(self, kind: str, tags: dict[str, str], attributes: dict[str, str] | None = None) -> str:
        """Id of a new element."""
        self._last += 1
        element = SubElement(self._root, kind, {"id": str(self._last), **(attributes or {})})
        for key, value in tags.items():
            SubElement(element, "tag", k=key, v=value)
        return str(self._last)

    def nodes(self) -> list[Element]:
        """The <node> elements."""
        return self._root.findall("node")

    def text(self) -> str:
        """The file."""
        indent(self._root)
        return tostring(self._root, encoding="unicode")


def straight_lane(sample: LaneletSample, xs: Sequence[float], right_y: float, left_y: float, **tags: str) -> list[str]:
    """Ids of consecutive lanelets in direction x, between positions ``xs``."""
    return [
        sample.lanelet(
            sample.line([(x0, left_y), (x1, left_y)], subtype="dashed"),
            sample.line([(x0, right_y), (x1, right_y)]),
            **tags,
        )
        for x0, x1 in itertools.pairwise(xs)
    ]


class Crossing:
    """Four roads that meet at the sample's origin: two lanes a direction to the east and west, else one.

    Attributes:
        incoming: Arm (0 east, 1 north, 2 west, 3 south) → lanelets towards the crossing, from the middle outward.
        outgoing: Arm → lanelets that lead away, likewise.
        turns: (arm, lane, next arm, next lane) → lanelet through the crossing.
    """

    def __init__(
        self, sample: LaneletSample, length_m: float = 80.0, height: Callable[[float, float], float] | None = None
    ) -> None:
        self.sample, self._length_m = sample, length_m
        self._height = height or (lambda x, y: 0.0)
        self.lanes = (2, 1, 2, 1)
        self.incoming = {arm: [self._arm_lane(arm, lane, 1.0) for lane in range(self.lanes[arm])] for arm in range(4)}
        self.outgoing = {arm: [self._arm_lane(arm, lane, -1.0) for lane in range(self.lanes[arm])] for arm in range(4)}
        self.turns: dict[tuple[int, int, int, int], str] = {}
        for arm in range(4):
            last, onward = self.lanes[arm] - 1, (arm + 2) % 4
            for lane in range(self.lanes[arm]):
                self._turn(arm, lane, onward, lane, "straight")
            self._turn(arm, 0, (arm + 3) % 4, 0, "left")
            self._turn(arm, last, (arm + 1) % 4, self.lanes[(arm + 1) % 4] - 1, "right")

    def at(self, arm: int, out_m: float, offset_m: float) -> Point:
        """Position on an arm: distance from the center, and offset to the left of the outward direction."""
        x, y = ((out_m, offset_m), (-offset_m, out_m), (-out_m, -offset_m), (offset_m, -out_m))[arm]
        return x, y, self._height(x, y)

    def stop_line(self, arm: int, out_m: float = BOX_M + 0.5) -> str:
        """Id of a stop line across the incoming lanes of an arm."""
        ends = [self.at(arm, out_m, offset_m) for offset_m in (0.2, self.lanes[arm] * LANE_M - 0.2)]
        return self.sample.line(ends, "stop_line", "")

    def lights(self, arm: int) -> str:
        """Id of the rule of a light beyond the crossing, to which the paths from an arm refer, as in Autoware."""
        light = self.sample.line(
            [(x, y, 5.0) for x, y, _ in (self.at((arm + 2) % 4, BOX_M + 2.0, -1.0 - side) for side in (1.2, 0.0))],
            "traffic_light",
            "red_yellow_green",
            height="0.8",
        )
        rule = self.sample.rule("traffic_light", ("way", "refers", light), ("way", "ref_line", self.stop_line(arm)))
        for start, turn in self.turns.items():
            if start[0] == arm:
                self.sample.add_rule(turn, rule)
        return rule

    def crosswalk(self, arm: int, near_m: float = BOX_M + 2.0, width_m: float = 4.0) -> str:
        """Id of a crosswalk over an arm, which begins ``near_m`` from the center."""
        reach_m = self.lanes[arm] * LANE_M
        sides = [
            self.sample.line([self.at(arm, out_m, -reach_m), self.at(arm, out_m, reach_m)], "pedestrian_marking", "")
            for out_m in (near_m, near_m + width_m)
        ]
        return self.sample.lanelet(*sides, subtype="crosswalk", one_way="no")

    def walkways(self, arm: int) -> list[str]:
        """Ids of walkways on both sides of an arm, both away from the crossing."""
        at_m = np.linspace(BOX_M, BOX_M + self._length_m, 5)
        found = []
        for side in (1.0, -1.0):
            inner, outer = (
                self.sample.line(
                    [self.at(arm, float(out_m), side * (self.lanes[arm] * LANE_M + beyond_m)) for out_m in at_m],
                    "curbstone",
                    "high",
                )
                for beyond_m in (0.0, 2.0)
            )
            found.append(self.sample.lanelet(*((outer, inner) if side > 0.0 else (inner, outer)), subtype="walkway"))
        return found

    def _arm_lane(self, arm: int, lane: int, side: float) -> str:
        at_m = np.linspace(BOX_M, BOX_M + self._length_m, 5)[:: -1 if side > 0.0 else 1]
        lines = []
        for border in (lane, lane + 1):
            points = [self.at(arm, float(out_m), side * border * LANE_M) for out_m in at_m]
            if border == 0:
                lines.append(self.sample.line(points, "line_thin", "solid_solid", color="yellow"))
            elif border == self.lanes[arm]:
                lines.append(self.sample.line(points, "road_border", ""))
            else:
                lines.append(self.sample.line(points, "line_thin", "dashed"))
        return self.sample.lanelet(*lines, speed_limit="50")

    def _turn(self, arm: int, lane: int, onward: int, target: int, direction: str) -> None:
        lines = []
        for before, after in ((lane, target), (lane + 1, target + 1)):
            start, end = self.at(arm, BOX_M, before * LANE_M), self.at(onward, BOX_M, -after * LANE_M)
            lines.append(self.sample.line(_curve(start, end, arm, onward, self._height), "virtual", ""))
        tags = {"turn_direction": direction}
        self.turns[arm, lane, onward, target] = self.sample.lanelet(*lines, speed_limit="30", **tags)


_OUT = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])


def _curve(start: Point, end: Point, arm: int, onward: int, height: Callable[[float, float], float]) -> list[Point]:
    """Points of a smooth path through the crossing."""
    p0, p3 = np.array(start[:2]), np.array(end[:2])
    reach = 0.4 * float(np.linalg.norm(p3 - p0))
    p1, p2 = p0 - reach * _OUT[arm], p3 - reach * _OUT[onward]
    t = np.linspace(0.0, 1.0, 2 if abs(arm - onward) == 2 else 9)[:, None]
    points = (1 - t) ** 3 * p0 + 3 * (1 - t) ** 2 * t * p1 + 3 * (1 - t) * t**2 * p2 + t**3 * p3
    return [(float(x), float(y), height(float(x), float(y))) for x, y in points]
