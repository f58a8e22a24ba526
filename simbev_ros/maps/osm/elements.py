"""Collects the elements of an OpenStreetMap file while it is read, and resolves their references.

Filled by the readers of XML and of PBF, which differ in nothing else. Memory is about 50 bytes a node.
"""

from array import array
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.findings import Finding, Outcome
from simbev_ros.maps.osm.data import Multipolygon, OsmData, Tags, Way

_MAX_REFERENCES_PER_NODE = 4


class Relation(NamedTuple):
    """A relation: its tags, and role and id of each member that is a way."""

    tags: Tags
    ways: Sequence[tuple[str, int]]


class OsmElements:
    """The elements of a file by id.

    Attributes:
        node_tags: Tags by node id, for nodes that have any.
        relations: Relations in the order of the file.
    """

    def __init__(self, path: object, max_nodes: int) -> None:
        """Begin with nothing.

        Args:
            path: The file, for messages.
            max_nodes: Number of nodes beyond which ``add_node`` refuses.
        """
        self.node_tags: dict[int, Tags] = {}
        self.relations: list[Relation] = []
        self._path, self._max_nodes = path, max_nodes
        self._ids, self._longitudes_deg, self._latitudes_deg = array("q"), array("d"), array("d")
        self._way_ids, self._way_tags = array("q"), list[Tags]()
        self._references, self._ends = array("q"), array("q")

    def add_node(self, identifier: int, longitude_deg: float, latitude_deg: float) -> None:
        """Add a node.

        Raises:
            InputError: There are too many.
        """
        if len(self._ids) == self._max_nodes:
            raise InputError(
                f"{self._path}: has more than {self._max_nodes:,} nodes; choose a part with bounds (west, south, east, "
                "north in degrees)"
            )
        self._ids.append(identifier)
        self._longitudes_deg.append(longitude_deg)
        self._latitudes_deg.append(latitude_deg)

    def add_nodes(self, identifiers: Int64Array, longitude_latitude_deg: Float64Array) -> None:
        """Add (N,) nodes with (N, 2) coordinates; raises the errors of ``add_node``."""
        for identifier, (longitude_deg, latitude_deg) in zip(
            identifiers.tolist(), longitude_latitude_deg.tolist(), strict=True
        ):
            self.add_node(identifier, longitude_deg, latitude_deg)

    def add_way(self, identifier: int, nodes: Sequence[int], tags: Tags) -> None:
        """Add a way with the ids of its nodes, which may come later or never; raises the errors of ``add_node``."""
        if len(self._references) + len(nodes) + len(self._ends) > _MAX_REFERENCES_PER_NODE * self._max_nodes:
            raise InputError(f"{self._path}: has too many ways; choose a part with bounds, or a smaller one")
        self._way_ids.append(identifier)
        self._way_tags.append(tags)
        self._references.extend(nodes)
        self._ends.append(len(self._references))

    def resolve(self) -> OsmData:
        """The content with references resolved: ways to nodes that are there, relations to ways that are there."""
        ids = np.frombuffer(self._ids, np.int64) if self._ids else np.empty(0, np.int64)
        degrees = np.column_stack([self._longitudes_deg, self._latitudes_deg]).reshape(-1, 2)
        order = np.argsort(ids, kind="stable")
        known, node = _positions_of(np.array(self._references, np.int64), ids, order)
        ways, num_missing = self._ways(known, node)
        tagged, tagged_node = _positions_of(np.array(list(self.node_tags), np.int64), ids, order)
        tags = [tags for tags, there in zip(self.node_tags.values(), tagged.tolist(), strict=True) if there]
        missing = Finding("a node of a way is missing: the way is shortened", Outcome.REPAIRED, num_missing)
        return OsmData(
            longitude_latitude_deg=degrees,
            node_tags=dict(sorted(zip(tagged_node[tagged].tolist(), tags, strict=True))),
            ways=tuple(ways.values()),
            multipolygons=tuple(self._multipolygons(ways)),
            findings=(missing,) if num_missing else (),
            driving_side=_driving_side(self.relations, list(ways.values())),
        )

    def _ways(self, known: BoolArray, node: Int64Array) -> tuple[dict[int, Way], int]:
        """Ways with at least two nodes by id, and the number of missing nodes."""
        ends = np.array(self._ends, np.int64)
        way = np.repeat(np.arange(len(ends)), ends - np.concatenate([[0], ends])[:-1])
        way, node = way[known], node[known]
        # Consecutive duplicates of a node do not make a line.
        keep = np.ones(len(node), bool)
        keep[1:] = (np.diff(way) != 0) | (np.diff(node) != 0)
        way, nodes = way[keep], node[keep].tolist()
        bounds = np.searchsorted(way, np.arange(len(ends) + 1)).tolist()
        found = {}
        for index, (identifier, tags) in enumerate(zip(self._way_ids, self._way_tags, strict=True)):
            line = tuple(nodes[bounds[index] : bounds[index + 1]])
            if len(line) > 1:
                found[identifier] = Way(str(identifier), line, tags)
        return found, int(np.count_nonzero(~known))

    def _multipolygons(self, ways: Mapping[int, Way]) -> Sequence[Multipolygon]:
        found = []
        for tags, members in self.relations:
            if tags.get("type") != "multipolygon" or any(way not in ways for _, way in members):
                continue
            inner = tuple(ways[way] for role, way in members if role == "inner")
            outer = tuple(ways[way] for role, way in members if role != "inner")
            found.append(Multipolygon(outer, inner, tags))
        return found


def _positions_of(wanted: Int64Array, ids: Int64Array, order: Int64Array) -> tuple[BoolArray, Int64Array]:
    """(N,) whether each of N ids is there, and its position among the ids, which ``order`` sorts."""
    if not len(ids):
        return np.zeros(len(wanted), bool), np.zeros(len(wanted), np.int64)
    position = order[np.minimum(np.searchsorted(ids, wanted, sorter=order), len(ids) - 1)]
    return ids[position] == wanted, position


def _driving_side(relations: Sequence[Relation], ways: Sequence[Way]) -> str:
    """``left`` or ``right``, see ``OsmData.driving_side``; single roads may be exceptions."""
    boundaries = [tags for tags, _ in relations if "boundary" in tags]
    sides = {tags["driving_side"] for tags in boundaries if "driving_side" in tags}
    if sides:
        return "left" if sides == {"left"} else "right"
    roads = [way.tags.get("driving_side") for way in ways if "highway" in way.tags]
    return next((side for side in ("left", "right") if 2 * roads.count(side) > len(roads)), "")
