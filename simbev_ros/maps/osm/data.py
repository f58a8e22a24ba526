"""Reads OpenStreetMap XML: nodes, ways and multipolygons with their tags, in geographic coordinates."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.errors import InputError
from simbev_ros.maps.safe_xml import parse, place_of
from simbev_ros.types import Float64Array

Tags = Mapping[str, str]
_MAX_TAG = 255
"""Longest key or value that OpenStreetMap itself accepts."""
_FOOT_M = 0.3048


class Way(NamedTuple):
    """A way: node indices, at least two; an outline if it ends at its first node."""

    id: str
    nodes: tuple[int, ...]
    tags: Tags

    @property
    def closed(self) -> bool:
        """Whether it is an outline."""
        return len(self.nodes) > 3 and self.nodes[0] == self.nodes[-1]


class Multipolygon(NamedTuple):
    """An area made of several ways: parts of its outer and inner outlines in any order."""

    outer: tuple[Way, ...]
    inner: tuple[Way, ...]
    tags: Tags


@dataclass(frozen=True, slots=True)
class OsmData:
    """The content of an OpenStreetMap file.

    Attributes:
        longitude_latitude_deg: (N, 2) coordinates of the nodes.
        node_tags: Tags by node index, for nodes that have any.
        ways: In the order of the file.
        multipolygons: In the order of the file, without incomplete ones.
        notes: Repairs.
        left_hand: Traffic keeps to the left, according to ``driving_side`` of the boundaries in the file, or of most of
            its roads. A file has no other information about it; without this tag, right-hand traffic is assumed in
            every country.
    """

    longitude_latitude_deg: Float64Array
    node_tags: Mapping[int, Tags]
    ways: tuple[Way, ...]
    multipolygons: tuple[Multipolygon, ...]
    notes: tuple[str, ...]
    left_hand: bool = False


def read_osm(path: Path) -> OsmData:
    """Read an OpenStreetMap XML file.

    Raises:
        InputError: It is not OpenStreetMap XML, or an id or coordinate in it is invalid.
    """
    root = parse(path, "osm")
    nodes = _by_id(path, root, "node")
    index = {identifier: number for number, identifier in enumerate(nodes)}
    degrees = [(_degrees(path, node, "lon", 180.0), _degrees(path, node, "lat", 90.0)) for node in nodes.values()]
    tags = {number: _tags(node) for number, node in enumerate(nodes.values()) if len(node)}
    ways, num_missing = {}, 0
    for identifier, element in _by_id(path, root, "way").items():
        references = [reference.get("ref", "") for reference in element.findall("nd")]
        known = [index[reference] for reference in references if reference in index]
        num_missing += len(references) - len(known)
        # Consecutive duplicates of a node do not make a line.
        line = [node for node, before in zip(known, [-1, *known], strict=False) if node != before]
        if len(line) > 1:
            ways[identifier] = Way(identifier, tuple(line), _tags(element))
    notes = (
        (f"nodes of ways that are missing from the file, so that the ways were shortened: {num_missing}",)
        if num_missing
        else ()
    )
    return OsmData(
        longitude_latitude_deg=np.array(degrees).reshape(-1, 2),
        node_tags=tags,
        ways=tuple(ways.values()),
        multipolygons=tuple(_multipolygons(path, root, ways)),
        notes=notes,
        left_hand=_left_hand(root, ways.values()),
    )


def parse_length_m(text: str) -> float:
    """Parse a length such as ``12``, ``12.5 m`` or ``40'``, in meters; 0 if it is none."""
    match = re.fullmatch(r"(\d{1,4}(?:\.\d{1,3})?) ?(m|')?", text.strip())
    return 0.0 if match is None else float(match[1]) * (_FOOT_M if match[2] == "'" else 1.0)


def _by_id(path: Path, root: Element, tag: str) -> dict[str, Element]:
    """Elements that were not deleted, by id."""
    found: dict[str, Element] = {}
    for element in root.findall(tag):
        if element.get("visible") == "false" or element.get("action") == "delete":
            continue
        identifier = element.get("id", "")
        if not identifier.lstrip("-").isdecimal():
            raise InputError(f"{place_of(path, element)}: {tag}: id: must be a whole number, not {identifier!r:.60}")
        if identifier in found:
            other = place_of(path, found[identifier])
            raise InputError(f"{place_of(path, element)}: {tag} {identifier}: appears twice; the other is {other}")
        found[identifier] = element
    return found


def _degrees(path: Path, node: Element, attribute: str, limit_deg: float) -> float:
    text = node.get(attribute, "")
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= limit_deg:
        raise InputError(
            f"{place_of(path, node)}: node {node.get('id')}: {attribute}: must be degrees between "
            f"-{limit_deg:g} and {limit_deg:g}, not {text!r:.60}"
        )
    return value


def _tags(element: Element) -> dict[str, str]:
    return {tag.get("k", "")[:_MAX_TAG]: tag.get("v", "")[:_MAX_TAG] for tag in element.findall("tag")}


def _left_hand(root: Element, ways: Iterable[Way]) -> bool:
    """Whether traffic keeps to the left, see ``OsmData.left_hand``; single roads may be exceptions."""
    boundaries = [tags for relation in root.findall("relation") if "boundary" in (tags := _tags(relation))]
    sides = {tags["driving_side"] for tags in boundaries if "driving_side" in tags}
    if sides:
        return sides == {"left"}
    roads = [way.tags.get("driving_side") for way in ways if "highway" in way.tags]
    return 2 * roads.count("left") > len(roads)


def _multipolygons(path: Path, root: Element, ways: Mapping[str, Way]) -> Sequence[Multipolygon]:
    found = []
    for relation in _by_id(path, root, "relation").values():
        tags = _tags(relation)
        members = [member for member in relation.findall("member") if member.get("type") == "way"]
        if tags.get("type") != "multipolygon" or any(member.get("ref") not in ways for member in members):
            continue
        parts = [(member.get("role"), ways[member.get("ref", "")]) for member in members]
        inner = tuple(way for role, way in parts if role == "inner")
        outer = tuple(way for role, way in parts if role != "inner")
        found.append(Multipolygon(outer, inner, tags))
    return found
