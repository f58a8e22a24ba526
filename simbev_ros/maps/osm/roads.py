"""From ways to roads that meet at their ends only: divided at junctions, joined where nothing changes."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely

from simbev_ros.maps.osm.data import OsmData
from simbev_ros.maps.osm.road_rules import RoadTags, road_tags
from simbev_ros.maps.sumo.islands import on_mainland
from simbev_ros.types import Float64Array

_LONGEST_UNDERPASS_M = 120.0


@dataclass(frozen=True, slots=True)
class OsmRoad:
    """A road between two junctions; it runs along its nodes.

    Attributes:
        nodes: Indices of nodes; none of them but the first and the last belongs to another road.
        way: What it is.
    """

    nodes: tuple[int, ...]
    way: RoadTags


def roads_of(data: OsmData, xy_m: Float64Array) -> tuple[tuple[OsmRoad, ...], tuple[str, ...]]:
    """The roads of a file, and what was left out.

    Args:
        data: The file.
        xy_m: (N, 2) its nodes in the map frame.
    """
    notes = []
    ways = [OsmRoad(way.nodes, tags) for way in data.ways if (tags := road_tags(way.tags, data.left_hand)) is not None]
    ways = [replace(road, nodes=road.nodes[::-1]) if road.way.reverse else road for road in ways]
    tunnels = [road for road in ways if road.way.tunnel and _length_m(road, xy_m) > _LONGEST_UNDERPASS_M]
    if tunnels:
        notes.append(f"tunnels longer than {_LONGEST_UNDERPASS_M:.0f} m were left out: {len(tunnels)}")
        ways = [road for road in ways if road not in tunnels]
    ways = _without_stairs(ways, xy_m)
    roads = joined(list(_divided(ways)))
    roads = [road for road in roads if _length_m(road, xy_m) > 0.5]
    kept = _connected(roads, xy_m)
    if len(kept) < len(roads):
        notes.append(f"roads that are not connected with the rest were left out: {len(roads) - len(kept)}")
    return tuple(kept), tuple(notes)


def line_of(road: OsmRoad, xy_m: Float64Array) -> shapely.LineString:
    """Its line in the map frame."""
    return shapely.LineString(xy_m[list(road.nodes)])


def crossings_of(roads: Sequence[OsmRoad], xy_m: Float64Array) -> list[tuple[int, int, shapely.Point]]:
    """Pairs of roads of different layers that cross without meeting: index of the upper, of the lower, the place."""
    lines = np.array([line_of(road, xy_m) for road in roads], dtype=object)
    first, second = shapely.STRtree(lines).query(lines, predicate="intersects")
    found = []
    for a, b in zip(first.tolist(), second.tolist(), strict=True):
        if roads[a].way.layer > roads[b].way.layer:
            shared = shapely.MultiPoint(xy_m[list(set(roads[a].nodes) & set(roads[b].nodes))])
            places = shapely.get_parts(shapely.intersection(lines[a], lines[b]))
            found += [(a, b, shapely.centroid(place)) for place in places if shapely.distance(place, shared) != 0.0]
    return found


def joined(pieces: Sequence[OsmRoad]) -> list[OsmRoad]:
    """Pieces that follow each other and differ in nothing, as one."""
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
        both = _join(roads[a], roads[b], node) if a != b else None
        if both is not None:
            roads[a] = both
            del roads[b]
            owner[b] = a
    return list(roads.values())


def _without_stairs(roads: list[OsmRoad], xy_m: Float64Array) -> list[OsmRoad]:
    """Without paths that pass above or below roads, for which their ends are too near."""
    stairs = {index for pair in crossings_of(roads, xy_m) for index in pair[:2] if roads[index].way.walk}
    return [road for index, road in enumerate(roads) if index not in stairs]


def _divided(roads: Sequence[OsmRoad]) -> Iterable[OsmRoad]:
    """Pieces from shared node to shared node; a node that a road passes twice counts as shared."""
    uses = Counter(node for road in roads for node in road.nodes)
    for road in roads:
        ends = {road.nodes[0], road.nodes[-1]}
        cuts = [k for k, node in enumerate(road.nodes) if uses[node] > 1 or node in ends]
        if road.nodes[0] == road.nodes[-1] and len(cuts) == 2:
            cuts.insert(1, len(road.nodes) // 2)  # a lone ring: two halves
        for start, end in pairwise(cuts):
            yield replace(road, nodes=road.nodes[start : end + 1])


def _owner(owner: list[int], index: int) -> int:
    while owner[index] != index:
        index = owner[index]
    return index


def _join(a: OsmRoad, b: OsmRoad, node: int) -> OsmRoad | None:
    """The two as one road across a node, if they are alike and run the same way."""
    if a.way != b.way or "turn" in " ".join(a.way.tags):
        return None
    if a.nodes[0] == node:
        a, b = b, a
    if a.nodes[-1] == node == b.nodes[0] and a.nodes[0] != b.nodes[-1]:
        return replace(a, nodes=a.nodes + b.nodes[1:])
    return None


def _connected(roads: list[OsmRoad], xy_m: Float64Array) -> list[OsmRoad]:
    """The largest part that hangs together."""
    if not roads:
        return []
    lengths_m = np.array([_length_m(road, xy_m) for road in roads])
    starts, ends = ([str(road.nodes[end]) for road in roads] for end in (0, -1))
    return [road for road, keep in zip(roads, on_mainland(starts, ends, lengths_m), strict=True) if keep]


def _length_m(road: OsmRoad, xy_m: Float64Array) -> float:
    return float(shapely.length(line_of(road, xy_m)))
