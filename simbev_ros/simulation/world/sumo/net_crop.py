"""Crop a SUMO network to the part that a scene needs: the edges in use, their junctions, and all edges joining these.

SUMO loads and steps large networks slowly. Everything kept retains its id and shape; where a kept edge leads to a
junction that no route uses, it becomes a dead end.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Set
from typing import NamedTuple

# Matches networks as netconvert writes them: no element contains another one of the same name.
_ELEMENT = re.compile(r"<(location|type|edge|tlLogic|junction|connection|roundabout)\s(?:[^<>]*/>|.*?</\1>)", re.DOTALL)
_LEFT_HAND = re.compile(r'<net\s[^>]*lefthand="(true|1)"')
_ATTRIBUTE = re.compile(r'([\w:]+)="([^"]*)"')


class _Element(NamedTuple):
    """XML text of a network element, and its attributes."""

    text: str
    attributes: Mapping[str, str]


class CroppedNet(NamedTuple):
    """Part of a network: its XML, the ids of its edges and of its traffic lights, and whether traffic keeps left."""

    xml: str
    edges: Set[str]
    lights: Set[str]
    left_hand: bool = False


def crop_net(net: str, used: Iterable[str]) -> CroppedNet:
    """Crop a network to the edges ``used``, also those inside junctions (``:…``), and all that belongs to them."""
    elements = _elements(net)
    edge_ends = {
        edge["id"]: (edge["from"], edge["to"]) for _, edge in elements["edge"] if not edge["id"].startswith(":")
    }
    used_junctions = {junction for edge in used for junction in edge_ends.get(edge, (_junction_of(edge),))}
    kept = {
        edge["id"]
        for _, edge in elements["edge"]
        if used_junctions.intersection(edge_ends.get(edge["id"], (_junction_of(edge["id"]),)))
    }
    connections = [
        each
        for each in elements["connection"]
        if {each.attributes["from"], each.attributes["to"]} <= kept
        and _connection_junction(each, edge_ends) in used_junctions
    ]
    lights = {each.attributes["tl"] for each in connections if "tl" in each.attributes}
    parts = (
        *elements["location"],
        *elements["type"],
        *(each for each in elements["edge"] if each.attributes["id"] in kept),
        *(each for each in elements["tlLogic"] if each.attributes["id"] in lights),
        *_junctions(
            elements["junction"], used_junctions, {end for edge in kept for end in edge_ends.get(edge, ())}, kept
        ),
        *connections,
        *(each for each in elements["roundabout"] if kept.issuperset(each.attributes["edges"].split())),
    )
    head = net[: net.index("<location")]
    xml = "\n".join((head, *(part.text for part in parts), "</net>"))
    return CroppedNet(xml, kept, lights, _LEFT_HAND.search(head) is not None)


def _elements(net: str) -> dict[str, list[_Element]]:
    """The elements of a network by tag, in order."""
    elements: dict[str, list[_Element]] = defaultdict(list)
    for match in _ELEMENT.finditer(net):
        text = match[0]
        elements[match[1]].append(_Element(text, dict(_ATTRIBUTE.findall(text, 0, text.index(">")))))
    return elements


def _junction_of(edge: str) -> str:
    """The junction that contains an internal edge or an internal junction, with an id like ``:junction_3``."""
    return edge[1:].rsplit("_", 1)[0]


def _connection_junction(connection: _Element, edge_ends: Mapping[str, tuple[str, str]]) -> str:
    """The junction that a connection belongs to."""
    start = connection.attributes["from"]
    return edge_ends[start][1] if start in edge_ends else _junction_of(start)


def _junctions(
    junctions: Iterable[_Element], used_junctions: Set[str], end_junctions: Set[str], kept: Set[str]
) -> Iterator[_Element]:
    """Used junctions unchanged, with their internal junctions; the other ends of kept edges as dead ends."""
    for junction in junctions:
        name = junction.attributes["id"]
        # An internal junction is named after the lane that it interrupts, ``:junction_3_0``.
        if name in used_junctions or (name.startswith(":") and _junction_of(name.rsplit("_", 1)[0]) in used_junctions):
            yield junction
        elif name in end_junctions:
            lanes = junction.attributes.get("incLanes", "").split()
            own = {key: value for key, value in junction.attributes.items() if key in ("id", "x", "y", "z", "shape")}
            incoming = " ".join(lane for lane in lanes if lane.rsplit("_", 1)[0] in kept)
            dead_end = {**own, "type": "dead_end", "incLanes": incoming, "intLanes": ""}
            text = " ".join(f'{key}="{value}"' for key, value in dead_end.items())
            yield _Element(f"<junction {text}/>", dead_end)
