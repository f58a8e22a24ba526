"""Reads a Lanelet2 file; elements that cannot be used are left out, with a note."""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_LANELET_POINTS, MAX_LANELETS, MAX_OSM_BYTES
from simbev_ros.foundation.files.unpacking import read_unpacked
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.lanelet2.document import Area, Lanelet, LaneletMap, Linestring, Regulation
from simbev_ros.maps.lanelet2.elements import elements_by_id, tags_of
from simbev_ros.maps.lanelet2.frame import map_frame
from simbev_ros.maps.lanelet2.shapes import place_of_loss
from simbev_ros.maps.lanelet2.tags import lane_kind
from simbev_ros.maps.osm.data import Tags
from simbev_ros.maps.safe_xml import parse

_LANELET = re.compile(rb"""\bv\s*=\s*["']lanelet["']""")
_HIGHWAY = re.compile(rb"""\bk\s*=\s*["']highway["']""")
_OVERLAP_BYTES = 64
_SAME_POINT_M = 0.01
_MAX_MEMBERS = 400
_AREA_TYPES = ("multipolygon", "area")


def has_lanelets(path: Path, suffix: str) -> bool:
    """Whether the roads of a map's file are lanelets: it is OSM XML with more of them than streets of OpenStreetMap.

    Raises:
        InputError: The file cannot be read, or is damaged.
    """
    if not suffix.startswith(".osm") or suffix.endswith(".pbf"):
        return False
    lanelets = streets = 0
    tail = b""
    for piece in read_unpacked(path, MAX_OSM_BYTES):
        text = tail + piece
        lanelets += sum(match.end() > len(tail) for match in _LANELET.finditer(text))
        streets += sum(match.end() > len(tail) for match in _HIGHWAY.finditer(text))
        tail = text[-_OVERLAP_BYTES:]
    return lanelets > streets


def read_lanelet_map(path: Path, notes: Findings, mirrored: bool = False) -> tuple[LaneletMap, MapDatum]:
    """Read a Lanelet2 file.

    Args:
        path: The .osm file.
        notes: Receives repairs and omissions.
        mirrored: Whether northward coordinates get the opposite sign.

    Returns:
        The map, and the datum of its frame, which stays that of the file.

    Raises:
        InputError: The file is not OSM XML, it has no usable positions, or its lanelets are too many or span too far.
    """
    root = parse(path, "osm")
    relations = elements_by_id(root, "relation", notes)
    ways = elements_by_id(root, "way", notes)
    xyz_m, datum, index = map_frame(path, elements_by_id(root, "node", notes), notes)
    lines = dict(_iter_lines(ways, index, xyz_m * (1.0, -1.0 if mirrored else 1.0, 1.0), notes))
    tags = {name: tags_of(element) for name, element in relations.items()}
    lanelets = {name: relations[name] for name in relations if tags[name].get("type") == "lanelet"}
    if len(lanelets) > MAX_LANELETS:
        raise InputError(f"{path}: has {len(lanelets)} lanelets; at most {MAX_LANELETS} are read")
    regulations = {
        name: _regulation(element, tags[name], lines, notes)
        for name, element in relations.items()
        if tags[name].get("type") == "regulatory_element"
    }
    areas = [element for name, element in relations.items() if tags[name].get("type") in _AREA_TYPES]
    bounded = dict(_iter_lanelets(lanelets, tags, lines, notes))
    count = sum(len(lanelet.left.nodes) + len(lanelet.right.nodes) for lanelet in bounded.values())
    if count > MAX_LANELET_POINTS:
        raise InputError(f"{path}: its lanelets have {count} points; at most {MAX_LANELET_POINTS} are read")
    return LaneletMap(lines, bounded, regulations, tuple(_areas(areas, lines))), datum


def _iter_lines(
    ways: Mapping[str, Element], index: Mapping[str, int], xyz_m: Float64Array, notes: Findings
) -> Iterator[tuple[str, Linestring]]:
    """Yield lines by id; points that are missing are left out, and points in the same position count as one."""
    position = np.unique(np.round(xyz_m / _SAME_POINT_M), axis=0, return_inverse=True)[1].ravel().tolist()
    for name, element in ways.items():
        references = [reference.get("ref", "") for reference in element.findall("nd")]
        known = [index[reference] for reference in references if reference in index]
        if len(known) < len(references):
            notes.left_out("a line refers to points that are missing", element, f"way {name}")
        numbers = [position[node] for node in known]
        distinct = [k for k in range(len(known)) if k == 0 or numbers[k] != numbers[k - 1]]
        if len(distinct) > 1:
            nodes = tuple(numbers[k] for k in distinct)
            yield name, Linestring(name, nodes, xyz_m[[known[k] for k in distinct]], tags_of(element))


def _members(relation: Element, kind: str) -> Iterator[tuple[str, str]]:
    """Yield role and id of each member of one kind, of the first few hundred members."""
    for member in relation.findall("member")[:_MAX_MEMBERS]:
        if member.get("type") == kind:
            yield member.get("role", ""), member.get("ref", "")


def _iter_lanelets(
    relations: Mapping[str, Element], tags: Mapping[str, Tags], lines: Mapping[str, Linestring], notes: Findings
) -> Iterator[tuple[str, Lanelet]]:
    """Yield lanelets by id; those without both bounds are left out."""
    for name, element in relations.items():
        members = list(_members(element, "way"))
        bounds = [[ref for role, ref in members if role == side] for side in ("left", "right", "centerline")]
        left, right, center = (_joined(references, lines) for references in bounds)
        if left is None or right is None:
            detail = f"lanelet {name} has no {'left' if left is None else 'right'} bound"
            lost = place_of_loss(right if left is None else left, lane_kind(tags[name]))
            notes.left_out("a lanelet without both bounds is left out", element, detail, *lost)
            continue
        regulations = tuple(ref for role, ref in _members(element, "relation") if role == "regulatory_element")
        yield name, Lanelet(name, left, right, center, tags[name], regulations, element)


def _joined(references: Sequence[str], lines: Mapping[str, Linestring]) -> Linestring | None:
    """The line of a bound, joined from the lines of its members; None if one is missing or they do not meet."""
    if not references or any(reference not in lines for reference in references):
        return None
    joined = lines[references[0]]
    for reference in references[1:]:
        after = lines[reference]
        nodes, points_m = after.nodes, after.points_m
        if joined.nodes[-1] not in (nodes[0], nodes[-1]):
            joined = Linestring(joined.id, joined.nodes[::-1], joined.points_m[::-1], joined.tags)
        if joined.nodes[-1] == nodes[-1]:
            nodes, points_m = nodes[::-1], points_m[::-1]
        if joined.nodes[-1] != nodes[0]:
            return None
        points_m = np.concatenate([joined.points_m, points_m[1:]])
        joined = Linestring(joined.id, (*joined.nodes, *nodes[1:]), points_m, joined.tags)
    return joined


def _regulation(element: Element, tags: Tags, lines: Mapping[str, Linestring], notes: Findings) -> Regulation:
    """Read one regulatory element; members that are missing are left out."""
    ways: dict[str, list[Linestring]] = defaultdict(list)
    for role, reference in _members(element, "way"):
        if reference in lines:
            ways[role].append(lines[reference])
        else:
            notes.left_out("a regulatory element refers to a line that is missing", element, f"way {reference}")
    lanelets: dict[str, list[str]] = defaultdict(list)
    for role, reference in _members(element, "relation"):
        lanelets[role].append(reference)
    return Regulation(
        tags.get("subtype", ""),
        tags,
        {role: tuple(found) for role, found in ways.items()},
        {role: tuple(found) for role, found in lanelets.items()},
        element,
    )


def _areas(relations: Sequence[Element], lines: Mapping[str, Linestring]) -> Iterator[Area]:
    """Yield the areas: multipolygons by their outer outline, and closed lines that are tagged as areas."""
    for relation in relations:
        outer = _joined([ref for role, ref in _members(relation, "way") if role == "outer"], lines)
        if outer is not None and len(set(outer.nodes)) > 2:
            yield Area(_corners_m(outer), tags_of(relation))
    for line in lines.values():
        if line.tags.get("area") == "yes" and len(set(line.nodes)) > 2:
            yield Area(_corners_m(line), line.tags)


def _corners_m(line: Linestring) -> Float64Array:
    """(N, 3) corners of an outline."""
    return line.points_m[:-1] if line.nodes[0] == line.nodes[-1] else line.points_m
