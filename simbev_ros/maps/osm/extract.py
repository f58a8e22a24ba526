"""Cuts a part out of an OpenStreetMap file: roads end at its border, everything else stays complete."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.findings import Finding, Outcome
from simbev_ros.maps.osm.box import Box
from simbev_ros.maps.osm.data import Multipolygon, OsmData, Way, add_tags
from simbev_ros.maps.osm.road_rules import road_tags

SURROUNDINGS_M = 200.0
"""Distance around a box up to which buildings and land are part of it."""
_MIN_PIECE = 1e-9


def cut(data: OsmData, box: Box, reason: str = "") -> OsmData:
    """The part of a file in a box: roads cut at its border, other ways and areas near it complete.

    Args:
        data: The file.
        box: The part.
        reason: Why the box was chosen, if users did not choose it, for a note on how to choose it.
    """
    cutter = _Cutter(data, box)
    near = cutter.touches(box.grow(SURROUNDINGS_M))
    multipolygons = [area for area in data.multipolygons if any(near.get(way.id) for way in area.outer + area.inner)]
    members = {way.id: way for area in multipolygons for way in area.outer + area.inner}
    ways: list[Way] = []
    for way in data.ways:
        if road_tags(way.tags) is None:
            ways += [way] if near[way.id] or way.id in members else []
            continue
        pieces = cutter.pieces(way)
        if way.id in members and pieces != [way.nodes]:  # the outline of an area along a road stays complete
            members[way.id] = outline = way._replace(tags={})
            ways.append(outline)
            ways += [Way(cutter.new_id(), piece, way.tags) for piece in pieces]
        else:
            ways += [Way(cutter.new_id() if k else way.id, piece, way.tags) for k, piece in enumerate(pieces)]
    note = f"{reason}: only the densest part is, with bounds {box}; others can be chosen"
    part = replace(
        data,
        longitude_latitude_deg=cutter.longitude_latitude_deg(),
        ways=tuple(ways),
        multipolygons=tuple(_with_ways(area, members) for area in multipolygons),
        findings=(*data.findings, Finding(note, Outcome.LEFT_OUT)) if reason else data.findings,
        is_part=True,
    )
    return _without_unused_nodes(part, box.grow(SURROUNDINGS_M))


def _with_ways(area: Multipolygon, ways: Mapping[str, Way]) -> Multipolygon:
    """The area with other ways of the same ids."""
    outer, inner = (tuple(ways[way.id] for way in part) for part in (area.outer, area.inner))
    return Multipolygon(outer, inner, area.tags)


def write_osm(path: Path, data: OsmData) -> None:
    """Write the content of a file as OpenStreetMap XML, with the driving side; ``read_osm`` reads the same from it."""
    root = Element("osm", version="0.6", generator="simbev")
    for index, (longitude, latitude) in enumerate(data.longitude_latitude_deg.tolist()):
        node = SubElement(root, "node", id=str(index + 1), lat=repr(latitude), lon=repr(longitude))
        add_tags(node, data.node_tags.get(index, {}))
    for way in data.ways:
        element = SubElement(root, "way", id=way.id)
        for node_index in way.nodes:
            SubElement(element, "nd", ref=str(node_index + 1))
        add_tags(element, way.tags)
    for index, area in enumerate(data.multipolygons):
        relation = SubElement(root, "relation", id=str(index + 1))
        for role, ways in (("outer", area.outer), ("inner", area.inner)):
            for way in ways:
                SubElement(relation, "member", type="way", ref=way.id, role=role)
        add_tags(relation, area.tags)
    boundary = SubElement(root, "relation", id=str(len(data.multipolygons) + 1))
    side = "left" if data.left_hand else "right"
    add_tags(boundary, {"type": "boundary", "boundary": "administrative", "driving_side": side})
    ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)


class _Cutter:
    """Cuts lines at the border of a box and collects the nodes there."""

    def __init__(self, data: OsmData, box: Box) -> None:
        self._data, self._box = data, box
        self._degrees = box.unwrap(data.longitude_latitude_deg)
        self._inside = box.contains(data.longitude_latitude_deg)
        self._new_nodes: list[Float64Array] = []
        self._new_id = min([0, *(int(way.id) for way in data.ways)])

    def new_id(self) -> str:
        """Id of a way that the file does not have."""
        self._new_id -= 1
        return str(self._new_id)

    def touches(self, box: Box) -> dict[str, bool]:
        """For each way by id, whether its bounding box touches a box."""
        ways = self._data.ways
        if not ways:
            return {}
        degrees = self._degrees[[node for way in ways for node in way.nodes]]
        starts = np.cumsum([0, *(len(way.nodes) for way in ways[:-1])])
        low, high = np.minimum.reduceat(degrees, starts), np.maximum.reduceat(degrees, starts)
        touching: BoolArray = np.asarray(((low <= box[2:]) & (high >= box[:2])).all(axis=1))
        return dict(zip((way.id for way in ways), touching.tolist(), strict=True))

    def pieces(self, way: Way) -> list[tuple[int, ...]]:
        """Nodes of each piece of a way inside the box, with new nodes at the border."""
        if self._inside[list(way.nodes)].all():
            return [way.nodes]
        pieces: list[list[int]] = [[]]
        for start, end in zip(way.nodes, way.nodes[1:], strict=False):
            clipped = _clip(self._degrees[start], self._degrees[end], self._box)
            if clipped is None:
                pieces.append([])
                continue
            enter, leave = clipped
            if enter > 0.0 or not pieces[-1]:
                pieces.append([start if enter == 0.0 else self._node_between(start, end, enter)])
            pieces[-1].append(end if leave == 1.0 else self._node_between(start, end, leave))
            if leave < 1.0:
                pieces.append([])
        return [tuple(piece) for piece in pieces if len(piece) > 1]

    def longitude_latitude_deg(self) -> Float64Array:
        """(N, 2) coordinates of all nodes, new ones last."""
        old, new = self._data.longitude_latitude_deg, np.array(self._new_nodes).reshape(-1, 2)
        new[:, 0] = (new[:, 0] + 180.0) % 360.0 - 180.0
        return np.concatenate([old, np.round(new, 9)])

    def _node_between(self, start: int, end: int, share: float) -> int:
        self._new_nodes.append(self._degrees[start] * (1.0 - share) + self._degrees[end] * share)
        return len(self._degrees) + len(self._new_nodes) - 1


def _clip(start: Float64Array, end: Float64Array, box: Box) -> tuple[float, float] | None:
    """Where a segment enters and leaves a box, as shares of its length; None if it passes (Liang and Barsky, 1984)."""
    enter, leave = 0.0, 1.0
    for axis in (0, 1):
        step, low, high = float(end[axis] - start[axis]), box[axis] - start[axis], box[axis + 2] - start[axis]
        if step == 0.0:
            if not low <= 0.0 <= high:
                return None
            continue
        first, last = sorted((float(low) / step, float(high) / step))
        enter, leave = max(enter, first), min(leave, last)
    return (enter, leave) if leave - enter > _MIN_PIECE else None


def _without_unused_nodes(data: OsmData, box: Box) -> OsmData:
    """Leave out the nodes of no way, except those with tags in the box."""
    used = np.zeros(len(data.longitude_latitude_deg), bool)
    outlines = [way for area in data.multipolygons for way in area.outer + area.inner]
    used[[node for way in (*data.ways, *outlines) for node in way.nodes]] = True
    tagged = np.array(list(data.node_tags), np.int64)
    used[tagged[box.contains(data.longitude_latitude_deg[tagged])]] = True
    number = np.cumsum(used) - 1
    renumbered = {way.id: _renumber(way, number) for way in (*outlines, *data.ways)}
    return replace(
        data,
        longitude_latitude_deg=data.longitude_latitude_deg[used],
        node_tags={int(number[node]): tags for node, tags in data.node_tags.items() if used[node]},
        ways=tuple(renumbered[way.id] for way in data.ways),
        multipolygons=tuple(_with_ways(area, renumbered) for area in data.multipolygons),
    )


def _renumber(way: Way, number: Int64Array) -> Way:
    return way._replace(nodes=tuple(number[list(way.nodes)].tolist()))
