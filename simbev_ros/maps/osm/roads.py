"""Converts OpenStreetMap ways to roads that meet only at their ends: splits them at junctions, joins them elsewhere."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Finding, Outcome
from simbev_ros.maps.osm.data import OsmData
from simbev_ros.maps.osm.road_rules import RoadTags, is_unread_speed, road_tags
from simbev_ros.maps.sumo.islands import driven_parts


@dataclass(frozen=True, slots=True)
class OsmRoad:
    """A road between two junctions; it runs along its nodes.

    Attributes:
        nodes: Node indices; only the first and the last may belong to other roads.
        way: Its normalized tags.
    """

    nodes: tuple[int, ...]
    way: RoadTags


def roads_of(data: OsmData, xy_m: Float64Array) -> tuple[tuple[OsmRoad, ...], tuple[Finding, ...]]:
    """The roads of a file, and findings about those that were left out.

    Args:
        data: The file.
        xy_m: (N, 2) positions of its nodes, map frame.
    """
    ways = [OsmRoad(way.nodes, tags) for way in data.ways if (tags := road_tags(way.tags, data.left_hand)) is not None]
    unread = sum(1 for way in data.ways if is_unread_speed(way.tags) and road_tags(way.tags) is not None)
    ways = [replace(road, nodes=road.nodes[::-1]) if road.way.reverse else road for road in ways]
    ways = _remove_stairs(ways, xy_m)
    roads = join_roads(list(_split_at_junctions(ways)))
    roads = [road for road in roads if _length_m(road, xy_m) > 0.5]
    kept, findings = _leave_out_lone_paths(roads, xy_m)
    rule = "a maxspeed that is not a number is ignored: the road has the limit of its kind"
    ignored = [Finding(rule, Outcome.ASSUMED, unread)] if unread else []
    return tuple(kept), (*findings, *ignored)


def line_of(road: OsmRoad, xy_m: Float64Array) -> shapely.LineString:
    """The road's line in the map frame."""
    return shapely.LineString(xy_m[list(road.nodes)])


def crossings_of(roads: Sequence[OsmRoad], xy_m: Float64Array) -> list[tuple[int, int, shapely.Point]]:
    """Crossings between roads of different layers that do not meet: index of upper and lower road, and position."""
    lines = np.array([line_of(road, xy_m) for road in roads], dtype=object)
    layers = np.array([road.way.layer for road in roads])
    upper = np.flatnonzero(layers > layers.min(initial=0))
    first, second = shapely.STRtree(lines).query(lines[upper], predicate="intersects")
    found = []
    for a, b in zip(upper[first].tolist(), second.tolist(), strict=True):
        if roads[a].way.layer > roads[b].way.layer:
            shared = shapely.MultiPoint(xy_m[list(set(roads[a].nodes) & set(roads[b].nodes))])
            points = shapely.get_parts(overlay.intersection(lines[a], lines[b]))
            found += [(a, b, shapely.centroid(point)) for point in points if shapely.distance(point, shared) != 0.0]
    return found


def join_roads(pieces: Sequence[OsmRoad]) -> list[OsmRoad]:
    """Join consecutive pieces with equal tags to one road."""
    at_node: dict[int, list[int]] = defaultdict(list)
    for index, piece in enumerate(pieces):
        for node in (piece.nodes[0], piece.nodes[-1]):
            at_node[node].append(index)
    roads: dict[int, OsmRoad] = dict(enumerate(pieces))
    owner = list(range(len(pieces)))
    for node, (first, *others) in at_node.items():
        if len(others) != 1:
            continue
        a, b = _owner(owner, first), _owner(owner, others[0])
        both = _joined_pair(roads[a], roads[b], node) if a != b else None
        if both is not None:
            roads[a] = both
            del roads[b]
            owner[b] = a
    return list(roads.values())


def _remove_stairs(roads: list[OsmRoad], xy_m: Float64Array) -> list[OsmRoad]:
    """Remove footpaths that pass above or below roads, because they are too short for ramps."""
    stairs = {index for pair in crossings_of(roads, xy_m) for index in pair[:2] if roads[index].way.walk}
    return [road for index, road in enumerate(roads) if index not in stairs]


def _split_at_junctions(roads: Sequence[OsmRoad]) -> Iterable[OsmRoad]:
    """Split roads at shared nodes; a node that a road passes twice counts as shared."""
    uses = Counter(node for road in roads for node in road.nodes)
    for road in roads:
        ends = {road.nodes[0], road.nodes[-1]}
        cuts = [k for k, node in enumerate(road.nodes) if uses[node] > 1 or node in ends]
        if road.nodes[0] == road.nodes[-1] and len(cuts) == 2:
            cuts.insert(1, len(road.nodes) // 2)  # an isolated ring: two halves
        for start, end in pairwise(cuts):
            yield replace(road, nodes=road.nodes[start : end + 1])


def _owner(owner: list[int], index: int) -> int:
    while owner[index] != index:
        index = owner[index]
    return index


def _joined_pair(a: OsmRoad, b: OsmRoad, node: int) -> OsmRoad | None:
    """Two roads joined at a node, or None if their tags or directions differ."""
    if a.way != b.way or "turn" in " ".join(a.way.tags):
        return None
    if a.nodes[0] == node:
        a, b = b, a
    if a.nodes[-1] == node == b.nodes[0] and a.nodes[0] != b.nodes[-1]:
        return replace(a, nodes=a.nodes + b.nodes[1:])
    return None


def _leave_out_lone_paths(roads: list[OsmRoad], xy_m: Float64Array) -> tuple[list[OsmRoad], list[Finding]]:
    """The connected parts of the roads that cars may drive on, each with traffic of its own, and findings."""
    if not roads:
        return [], []
    lengths_m = np.array([_length_m(road, xy_m) for road in roads])
    walk = np.array([road.way.walk for road in roads])
    starts, ends = (np.array([road.nodes[end] for road in roads]) for end in (0, -1))
    keep, parts = driven_parts(starts, ends, np.where(walk, 0.0, lengths_m))
    findings = [*parts]
    if not keep.all():
        for row in np.flatnonzero(~keep).tolist():
            middle_m = xy_m[roads[row].nodes[len(roads[row].nodes) // 2]]
            findings.append(Finding("a footpath that no road reaches is left out", position_m=middle_m))
    return [road for road, kept in zip(roads, keep.tolist(), strict=True) if kept], findings


def _length_m(road: OsmRoad, xy_m: Float64Array) -> float:
    return float(shapely.length(line_of(road, xy_m)))
