"""Writes data/riverside.osm: a small fictional town with a river, two bridges, a motorway, buildings and land use.

Run ``python test/maps/osm_sample.py`` to write it again.
"""

import math
import random
from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

from simbev_ros.foundation.geometry.geodesy import MapDatum

SAMPLE = Path(__file__).parent / "data" / "riverside.osm"
DATUM = MapDatum(52.25, 7.5, 0.0)
"""Position of (0, 0) of the coordinates below on Earth; not the center of the data."""

Point = tuple[float, float]

_STREETS: tuple[tuple[str, Sequence[Point], dict[str, str]], ...] = (
    ("Main Street", [(0, 0), (0, 120), (0, 220), (0, 300)], {"highway": "secondary", "lanes": "2"}),
    ("Main Street", [(0, 300), (0, 335)], {"highway": "secondary", "lanes": "2"}),
    ("Main Street", [(0, 335), (0, 465)], {"highway": "secondary", "lanes": "2", "bridge": "yes", "layer": "1"}),
    ("Main Street", [(0, 465), (0, 500), (10, 560), (40, 620)], {"highway": "secondary", "lanes": "2"}),
    ("Main Street", [(0, 0), (0, -75)], {"highway": "secondary", "lanes": "2", "cycleway": "lane"}),
    ("Old Bridge", [(0, -75), (0, -165)], {"highway": "secondary", "lanes": "2", "bridge": "yes", "layer": "1"}),
    ("Main Street", [(0, -165), (0, -232)], {"highway": "secondary", "lanes": "2"}),
    ("High Street", [(-460, -12), (-380, -4), (-300, 0), (-150, 0)], {"highway": "secondary", "lanes": "2"}),
    (
        "High Street",
        [(-150, 0), (0, 0)],
        {"highway": "secondary", "lanes": "4", "turn:lanes:forward": "left|through;right"},
    ),
    (
        "High Street",
        [(0, 0), (150, 0)],
        {"highway": "secondary", "lanes": "4", "turn:lanes:backward": "left|through;right"},
    ),
    ("High Street", [(150, 0), (300, 0), (380, 8), (460, 24)], {"highway": "secondary", "lanes": "2"}),
    ("Church Lane", [(-300, 120), (-150, 120), (0, 120), (150, 120), (300, 120)], {"oneway": "yes"}),
    ("Mill Lane", [(300, 220), (150, 220), (0, 220), (-150, 220), (-300, 220)], {"oneway": "yes"}),
    ("West Street", [(-150, 220), (-150, 120), (-150, 0), (-150, -62)], {}),
    ("East Street", [(150, 220), (150, 120), (150, 0), (150, -62)], {}),
    ("Station Road", [(-300, 220), (-300, 120), (-300, 0), (-296, -70)], {"highway": "tertiary"}),
    ("Park Road", [(300, 220), (300, 120), (300, 0), (300, -55)], {"highway": "tertiary", "maxspeed": "30"}),
    ("River Walk", [(-296, -70), (-220, -68), (-150, -62)], {"sidewalk": "right"}),
    ("River Walk", [(-150, -62), (-70, -64), (0, -75)], {"sidewalk": "right"}),
    ("River Walk", [(0, -75), (70, -66), (150, -62)], {"sidewalk": "right"}),
    ("River Walk", [(150, -62), (230, -56), (300, -55)], {"sidewalk": "right"}),
    (
        "Southern Circle",
        [(0, -232), (-13, -237), (-18, -250), (-13, -263), (0, -268), (13, -263), (18, -250), (13, -237), (0, -232)],
        {"highway": "secondary", "junction": "roundabout", "oneway": "yes", "lanes": "1"},
    ),
    ("Works Road", [(-18, -250), (-120, -250), (-240, -246), (-400, -240)], {"highway": "tertiary"}),
    ("Works Gate", [(-240, -246), (-240, -330)], {"highway": "service"}),
    ("Field Road", [(18, -250), (140, -256), (280, -270), (420, -300)], {"highway": "tertiary", "sidewalk": "none"}),
    ("A 1", [(520, 408), (0, 409), (-520, 415)], {"highway": "motorway", "lanes": "2", "maxspeed": "120"}),
    ("A 1", [(-520, 399), (0, 393), (520, 392)], {"highway": "motorway", "lanes": "2", "maxspeed": "120"}),
    ("", [(-330, 396.8), (-200, 382), (-60, 320), (0, 300)], {"highway": "motorway_link", "oneway": "yes"}),
    ("", [(0, 300), (60, 320), (200, 380), (330, 392.4)], {"highway": "motorway_link", "oneway": "yes"}),
    ("", [(330, 408.4), (200, 420), (60, 480), (0, 500)], {"highway": "motorway_link", "oneway": "yes"}),
    ("", [(0, 500), (-60, 480), (-200, 424), (-330, 412.8)], {"highway": "motorway_link", "oneway": "yes"}),
    ("", [(300, 120), (250, 90), (210, 60), (150, 0)], {"highway": "footway"}),
    ("", [(-460, -330), (-300, -340), (200, -360), (460, -350)], {"railway": "rail"}),
)
_ON_MOTORWAY: tuple[Point, ...] = ((-330, 396.8), (330, 392.4), (330, 408.4), (-330, 412.8))
_NODE_TAGS: dict[Point, dict[str, str]] = {
    (0, 0): {"highway": "traffic_signals"},
    (0, 300): {"highway": "traffic_signals"},
    (0, 120): {"highway": "crossing", "crossing": "zebra"},
    (-300, 0): {"highway": "traffic_signals"},
}
_RIVER: tuple[Point, ...] = (
    (-520, -128), (-380, -112), (-240, -118), (-110, -128), (0, -120), (120, -108), (250, -112),
    (390, -104), (520, -84),
)  # fmt: skip
_AREAS: tuple[tuple[Sequence[Point], dict[str, str]], ...] = (
    ([(-380, -60), (-150, -55), (-150, 270), (-380, 270)], {"landuse": "residential"}),
    ([(150, -50), (380, -50), (380, 270), (150, 270)], {"landuse": "residential"}),
    ([(-150, -60), (150, -60), (150, 270), (-150, 270)], {"landuse": "retail"}),
    ([(-430, -345), (-30, -325), (-30, -165), (-430, -165)], {"landuse": "industrial"}),
    ([(40, -340), (460, -350), (460, -165), (40, -165)], {"landuse": "farmland"}),
    ([(-480, 440), (-110, 440), (-60, 500), (-30, 620), (-480, 620)], {"natural": "wood"}),
    ([(158, 10), (292, 10), (292, 112), (158, 112)], {"leisure": "park", "name": "Town Park"}),
)
_ROWS: tuple[tuple[Point, Point, str], ...] = (
    ((-140, 0), (-10, 0), "retail"), ((10, 0), (140, 0), "retail"), ((140, 0), (10, 0), "office"),
    ((-10, 0), (-140, 0), "retail"), ((-140, 120), (-10, 120), "apartments"), ((10, 120), (140, 120), "apartments"),
    ((140, 120), (10, 120), "retail"), ((-10, 120), (-140, 120), "retail"), ((140, 220), (10, 220), "apartments"),
    ((-10, 220), (-140, 220), "apartments"), ((-140, 220), (-10, 220), "house"), ((10, 220), (140, 220), "house"),
    ((-290, 0), (-160, 0), "house"), ((-160, 0), (-290, 0), "house"), ((-290, 120), (-160, 120), "house"),
    ((-160, 120), (-290, 120), "house"), ((-160, 220), (-290, 220), "house"), ((-290, 220), (-160, 220), "house"),
    ((-300, 10), (-300, 110), "house"), ((-300, 130), (-300, 210), "house"), ((-300, 215), (-300, 15), "house"),
    ((160, 120), (290, 120), "terrace"), ((290, 220), (160, 220), "terrace"), ((160, 220), (290, 220), "house"),
    ((300, 215), (300, 15), "house"), ((290, 0), (160, 0), "house"), ((0, 165), (0, 205), "apartments"),
    ((-260, -69), (-160, -64), "house"), ((160, -61), (290, -56), "house"), ((0, 60), (0, 100), "retail"),
)  # fmt: skip
"""Buildings on the left side of a street, from one point of it to another."""


class Writer:
    """Collects nodes, ways and relations; equal points are one node."""

    def __init__(self) -> None:
        self._nodes: dict[Point, int] = {}
        self._ways: list[str] = []
        self._relations: list[str] = []

    def way(self, points: Iterable[Point], tags: dict[str, str]) -> int:
        references = "".join(f'<nd ref="{self._node(point)}"/>' for point in points)
        number = 5000 + len(self._ways)
        self._ways.append(f' <way id="{number}" version="1">{references}{_tags(tags)}</way>\n')
        return number

    def ring(self, points: Sequence[Point], tags: dict[str, str]) -> int:
        return self.way([*points, points[0]], tags)

    def multipolygon(self, outer: int, inner: int, tags: dict[str, str]) -> None:
        members = f'<member type="way" ref="{outer}" role="outer"/><member type="way" ref="{inner}" role="inner"/>'
        number, tags = 9000 + len(self._relations), {"type": "multipolygon", **tags}
        self._relations.append(f' <relation id="{number}" version="1">{members}{_tags(tags)}</relation>\n')

    def text(self) -> str:
        return "".join(
            [
                '<?xml version="1.0" encoding="UTF-8"?>\n<osm version="0.6" generator="osm_sample.py">\n',
                *(_node_text(number, point) for point, number in self._nodes.items()),
                *self._ways,
                *self._relations,
                "</osm>\n",
            ]
        )

    def _node(self, point: Point) -> int:
        return self._nodes.setdefault(point, 1 + len(self._nodes))


def sample() -> str:
    """The text of the file."""
    writer, rng = Writer(), random.Random(4)
    for name, points, tags in _STREETS:
        street = {"highway": "residential", "maxspeed": "50", "sidewalk": "both"} if "railway" not in tags else {}
        if tags.get("highway", "").startswith("motorway") or "footway" in tags.values():
            street = {}
        writer.way(_with_ramps(points, tags), {**street, **tags, **({"name": name} if name else {})})
    for ring, tags in _AREAS:
        writer.ring(ring, tags)
    banks = [(x, y + side * 19.0) for side, line in ((1.0, _RIVER), (-1.0, _RIVER[::-1])) for x, y in line]
    writer.ring(banks, {"natural": "water", "water": "river"})
    writer.way(_RIVER, {"waterway": "river", "name": "Long Water"})
    writer.multipolygon(
        writer.ring([(180, 25), (240, 22), (255, 40), (235, 62), (190, 58)], {}),
        writer.ring([(205, 38), (220, 38), (220, 48), (205, 48)], {}),
        {"natural": "water", "water": "pond"},
    )
    writer.way([(60, -130), (90, -180), (160, -206), (300, -215), (460, -210)], {"waterway": "canal", "width": "7"})
    for start, end, kind in _ROWS:
        _row(writer, rng, start, end, kind)
    for x in range(-395, -60, 75):
        _house(writer, (x, -207), (1, 0), 50, 36, {"building": "industrial", "height": f"{rng.randint(7, 12)}"})
        if abs(x + 240) > 30:
            _house(writer, (x, -290), (1, 0), 52, 40, {"building": "warehouse", "building:levels": "2"})
    _house(writer, (330, -245), (1, -0.1), 26, 14, {"building": "barn", "height": "7.5", "roof:shape": "gabled"})
    _house(writer, (66, 62), (1, 0.1), 34, 15, {"building": "church", "height": "16", "roof:shape": "gabled"})
    writer.multipolygon(
        writer.ring([(-105, 46), (-50, 46), (-50, 88), (-105, 88)], {}),
        writer.ring([(-92, 57), (-64, 57), (-64, 77), (-92, 77)], {}),
        {"building": "school", "building:levels": "3"},
    )
    return writer.text()


# Width from, to; depth; distance from the street's middle to the facade; storeys from, to; gap.
_SIZES = {
    "retail": (14, 24, 14, 10.5, 3, 5, 0),
    "office": (18, 26, 15, 10.5, 4, 6, 0),
    "apartments": (16, 24, 13, 10.0, 3, 4, 5),
    "house": (9, 12, 10, 11.0, 1, 2, 7),
    "terrace": (7, 8, 11, 9.5, 2, 2, 0),
}


def _row(writer: Writer, rng: random.Random, start: Point, end: Point, kind: str) -> None:
    """Add buildings along the left side of a street."""
    narrowest, widest, depth, setback, low, high, gap = _SIZES[kind]
    length = math.dist(start, end)
    along = ((end[0] - start[0]) / length, (end[1] - start[1]) / length)
    position, offset = 8.0, setback + depth / 2
    while (width := rng.randint(narrowest, widest)) < length - 4.0 - position:
        s = position + width / 2
        center = (start[0] + s * along[0] - offset * along[1], start[1] + s * along[1] + offset * along[0])
        tags = {"building": kind, "building:levels": str(rng.randint(low, high))}
        if kind in ("house", "terrace"):
            tags["roof:shape"] = "gabled"
        _house(writer, center, along, width, depth, tags)
        position += width + gap


def _house(writer: Writer, center: Point, along: Point, width: float, depth: float, tags: dict[str, str]) -> None:
    """Add a rectangular building whose front of length ``width`` runs along a direction."""
    scale = math.hypot(*along)
    x, y = along[0] / scale, along[1] / scale
    corners = [(u * width / 2, v * depth / 2) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    writer.ring([(round(center[0] + x * u - y * v, 2), round(center[1] + y * u + x * v, 2)) for u, v in corners], tags)


def _with_ramps(points: Sequence[Point], tags: dict[str, str]) -> list[Point]:
    """A motorway's points, including those at which links begin and end."""
    if tags.get("highway") != "motorway":
        return list(points)
    westbound = points[0][0] > 0
    ramp_points = [point for point in _ON_MOTORWAY if (point[1] > 400) == westbound]
    return sorted({*points, *ramp_points}, reverse=westbound)


def _node_text(number: int, point: Point) -> str:
    latitude, longitude, _ = DATUM.geodetic_from_map((*point, 0.0))  # type: ignore[arg-type]
    tags = _tags(_NODE_TAGS.get(point, {}))
    end = f">{tags}</node>" if tags else "/>"
    return f' <node id="{number}" version="1" lat="{latitude:.8f}" lon="{longitude:.8f}"{end}\n'


def _tags(tags: dict[str, str]) -> str:
    return "".join(f"<tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in tags.items())


if __name__ == "__main__":
    SAMPLE.parent.mkdir(exist_ok=True)
    SAMPLE.write_text(sample(), encoding="utf-8")
