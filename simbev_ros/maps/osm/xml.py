"""Reads OpenStreetMap XML, element by element; also the answers of Overpass with coordinates inside ways."""

from array import array
from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_OSM_BYTES, MAX_OSM_ELEMENTS, MAX_OSM_NODES
from simbev_ros.maps.osm.elements import OsmElements, Relation
from simbev_ros.maps.safe_xml import read_elements

MAX_TAG = 255
"""Longest key or value that OpenStreetMap itself accepts."""
_KINDS = ("node", "way", "relation")
_ID_LIMIT = 1 << 63
_MAX_ID_CHARS = 20
_FIRST_UNNAMED = -_ID_LIMIT


def read_xml(path: Path) -> OsmElements:
    """Read an OpenStreetMap XML file, plain or compressed.

    Raises:
        InputError: It is not OpenStreetMap XML, or an id or coordinate in it is invalid.
    """
    target = _OsmTarget(path)
    read_elements(path, "osm", target, MAX_OSM_BYTES, MAX_OSM_ELEMENTS)
    return target.finish()


class _OsmTarget:
    """Adds the elements of an XML file to ``OsmElements`` as they end."""

    def __init__(self, path: Path) -> None:
        self._path, self._elements = path, OsmElements(path, MAX_OSM_NODES)
        self._ids, self._lines = ({kind: array("q") for kind in _KINDS} for _ in range(2))
        self._depth, self._kind = 0, ""
        self._identifier = 0
        self._tags: dict[str, str] = {}
        self._nodes: list[int] = []
        self._members: list[tuple[str, int]] = []
        self._member, self._member_nodes = 0, list[int]()
        self._geometries: dict[int, list[int]] = {}
        self._located: dict[int, tuple[str, str]] = {}
        self._at_position: dict[tuple[str, str], int] = {}

    def start(self, tag: str, attributes: dict[str, str], line: int) -> None:
        """Receive an element: at depth 1 one of the map's, at depth 2 a part of it, at depth 3 a part of a member."""
        self._depth += 1
        if self._depth == 2:
            self._kind = tag if tag in _KINDS and not _is_deleted(attributes) else ""
            if self._kind:
                self._begin(attributes, line)
        elif not self._kind:
            return
        elif tag == "tag" and self._depth == 3:
            self._tags[attributes.get("k", "")[:MAX_TAG]] = attributes.get("v", "")[:MAX_TAG]
        elif tag == "nd" and self._depth == 3:
            self._nodes.append(self._reference(attributes, line))
        elif tag == "member" and self._depth == 3:
            self._member, self._member_nodes = _number(attributes.get("ref", "")), []
            if attributes.get("type") == "way":
                self._members.append((attributes.get("role", ""), self._member))
        elif tag == "nd" and self._depth == 4 and "lat" in attributes:
            self._member_nodes.append(self._reference(attributes, line))

    def end(self, tag: str) -> None:
        """Add the element that ends."""
        self._depth -= 1
        if not self._kind:
            return
        if self._depth == 2 and tag == "member" and self._member_nodes:
            self._geometries.setdefault(self._member, self._member_nodes)
        elif self._depth == 1:
            if self._kind == "way":
                self._elements.add_way(self._identifier, self._nodes, self._tags)
            elif self._kind == "relation":
                self._elements.relations.append(Relation(self._tags, self._members))
            elif self._tags:
                self._elements.node_tags[self._identifier] = self._tags

    def data(self, text: str) -> None:
        """Ignore text, which has no meaning in OpenStreetMap XML."""

    def finish(self) -> OsmElements:
        """All elements, and the ways and nodes of which there are only coordinates, inside of others."""
        for kind in _KINDS:
            self._refuse_duplicates(kind)
        ways, nodes = (set(self._ids[kind]) if self._located else set() for kind in ("way", "node"))
        for way, line in self._geometries.items():
            if way not in ways:
                self._elements.add_way(way, line, {})
        for node, (longitude, latitude) in self._located.items():
            if node not in nodes:
                place = {"lon": longitude, "lat": latitude}
                self._elements.add_node(node, *(self._degrees(place, node, key, 0) for key in place))
        return self._elements

    def _begin(self, attributes: Mapping[str, str], line: int) -> None:
        text = attributes.get("id", "")
        if not _is_number(text):
            self._refuse(line, f"{self._kind}: id: must be a whole number of at most 64 bits, not {text!r:.60}")
        self._identifier = identifier = int(text)
        self._ids[self._kind].append(identifier)
        self._lines[self._kind].append(line)
        self._tags, self._nodes, self._members = {}, [], []
        if self._kind == "node":
            degrees = (self._degrees(attributes, identifier, key, line) for key in ("lon", "lat"))
            self._elements.add_node(identifier, *degrees)

    def _refuse_duplicates(self, kind: str) -> None:
        ids, lines = np.array(self._ids[kind], np.int64), self._lines[kind]
        order = np.argsort(ids, kind="stable")
        again = np.flatnonzero(np.diff(ids[order]) == 0)
        if len(again):
            first, second = order[again[0]], order[again[0] + 1]
            other = f"{self._path}:{lines[first]}"
            self._refuse(lines[second], f"{kind} {ids[first]}: appears twice; the other is {other}")

    def _reference(self, attributes: Mapping[str, str], line: int) -> int:
        """Id of a referenced node; one that has only coordinates gets an id below those of any editor."""
        latitude, longitude = attributes.get("lat"), attributes.get("lon")
        if latitude is None or longitude is None:
            return _number(attributes.get("ref", ""))
        for key in ("lon", "lat"):
            self._degrees(attributes, attributes.get("ref", ""), key, line)
        place = longitude, latitude
        if "ref" not in attributes:
            node = self._at_position.setdefault(place, _FIRST_UNNAMED + len(self._at_position))
        else:
            node = _number(attributes["ref"])
        self._located.setdefault(node, place)
        return node

    def _degrees(self, attributes: Mapping[str, str], node: object, key: str, line: int) -> float:
        text, limit_deg = attributes.get(key, ""), 180.0 if key == "lon" else 90.0
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not abs(value) <= limit_deg:
            problem = f"must be degrees between -{limit_deg:g} and {limit_deg:g}, not {text!r:.60}"
            self._refuse(line, f"node {node}: {key}: {problem}")
        return value

    def _refuse(self, line: int, problem: str) -> NoReturn:
        raise InputError(f"{self._path}:{line}: {problem}")


def _is_deleted(attributes: Mapping[str, str]) -> bool:
    return attributes.get("visible") == "false" or attributes.get("action") == "delete"


def _is_number(text: str) -> bool:
    is_whole = text.removeprefix("-").isdecimal() and len(text) <= _MAX_ID_CHARS
    return is_whole and -_ID_LIMIT <= int(text) < _ID_LIMIT


def _number(text: str) -> int:
    """Id in a reference; 0, which nothing has, if it is none."""
    return int(text) if _is_number(text) else 0
