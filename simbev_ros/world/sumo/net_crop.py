"""The part of a SUMO net that a scene needs: the streets that somebody uses, their junctions, and all that these join.

SUMO takes long to read a big map, and its steps take longer on it. Everything keeps its id and shape; where a kept
street leads to a junction that nobody passes, it ends.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Set
from typing import NamedTuple

# As netconvert writes nets: none of these elements contains another of the same name.
_ELEMENT = re.compile(r"<(location|type|edge|tlLogic|junction|connection|roundabout)\s(?:[^<>]*/>|.*?</\1>)", re.DOTALL)
_ATTRIBUTE = re.compile(r'([\w:]+)="([^"]*)"')


class _Element(NamedTuple):
    """An element of the net and its attributes."""

    text: str
    attributes: Mapping[str, str]


class CroppedNet(NamedTuple):
    """A part of a net: its XML, and the ids of its edges and of its traffic lights."""

    xml: str
    edges: Set[str]
    lights: Set[str]


def cropped_net(net: str, used: Iterable[str]) -> CroppedNet:
    """The net with the edges ``used``, those inside junctions (``:…``) among them, and what belongs to them."""
    elements = _elements(net)
    ends = {edge["id"]: (edge["from"], edge["to"]) for _, edge in elements["edge"] if not edge["id"].startswith(":")}
    passed = {junction for edge in used for junction in ends.get(edge, (_around(edge),))}
    kept = {
        edge["id"] for _, edge in elements["edge"] if passed.intersection(ends.get(edge["id"], (_around(edge["id"]),)))
    }
    connections = [
        each
        for each in elements["connection"]
        if {each.attributes["from"], each.attributes["to"]} <= kept and _joined_at(each, ends) in passed
    ]
    lights = {each.attributes["tl"] for each in connections if "tl" in each.attributes}
    parts = (
        *elements["location"],
        *elements["type"],
        *(each for each in elements["edge"] if each.attributes["id"] in kept),
        *(each for each in elements["tlLogic"] if each.attributes["id"] in lights),
        *_junctions(elements["junction"], passed, {end for edge in kept for end in ends.get(edge, ())}, kept),
        *connections,
        *(each for each in elements["roundabout"] if kept.issuperset(each.attributes["edges"].split())),
    )
    xml = "\n".join((net[: net.index("<location")], *(part.text for part in parts), "</net>"))
    return CroppedNet(xml, kept, lights)


def _elements(net: str) -> dict[str, list[_Element]]:
    """The elements of a net by name, in order."""
    elements: dict[str, list[_Element]] = defaultdict(list)
    for match in _ELEMENT.finditer(net):
        text = match[0]
        elements[match[1]].append(_Element(text, dict(_ATTRIBUTE.findall(text, 0, text.index(">")))))
    return elements


def _around(edge: str) -> str:
    """The junction that an edge, or a junction inside of it, with an id like ``:junction_3`` is inside of."""
    return edge[1:].rsplit("_", 1)[0]


def _joined_at(connection: _Element, ends: Mapping[str, tuple[str, str]]) -> str:
    """The junction that a connection is in."""
    start = connection.attributes["from"]
    return ends[start][1] if start in ends else _around(start)


def _junctions(
    junctions: Iterable[_Element], passed: Set[str], reached: Set[str], kept: Set[str]
) -> Iterator[_Element]:
    """Junctions that are passed as they are, with those inside of them; others that are reached as dead ends."""
    for junction in junctions:
        name = junction.attributes["id"]
        # Those inside are called like the lane that they interrupt, ``:junction_3_0``.
        if name in passed or (name.startswith(":") and _around(name.rsplit("_", 1)[0]) in passed):
            yield junction
        elif name in reached:
            lanes = junction.attributes.get("incLanes", "").split()
            own = {key: value for key, value in junction.attributes.items() if key in ("id", "x", "y", "z", "shape")}
            leading = " ".join(lane for lane in lanes if lane.rsplit("_", 1)[0] in kept)
            dead_end = {**own, "type": "dead_end", "incLanes": leading, "intLanes": ""}
            text = " ".join(f'{key}="{value}"' for key, value in dead_end.items())
            yield _Element(f"<junction {text}/>", dead_end)
