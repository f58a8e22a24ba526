"""Computes road heights for an OpenStreetMap file, which defines only the order of layers at crossings.

All land is level. Where two roads of different layers cross, the upper one is raised, or, if it is itself on or below
the ground, the lower one is lowered; along every connected road the height returns smoothly to 0. Long tunnels descend
from their portals, so that they pass below rivers and need no hill.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from heapq import heappop, heappush

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Finding, Outcome
from simbev_ros.maps.osm.roads import OsmRoad, crossings_of, line_of

_CLEARANCE_M = 6.2  # from carriageway to carriageway: 4.7 m for traffic and 1.5 m of structure
_FLAT_M = 12.0
_RAMP_M, _FAST_RAMP_M = 150.0, 220.0
_JUNCTION_M, _JUNCTION_REACH_M = 8.0, 40.0
_FAST_KMH = 70
_MIN_RAMP_M = 25.0
_SPACING_M = 8.0
_PASSES = 4
_TUNNEL_DEPTH_M, _TUNNEL_RAMP_M = 9.0, 180.0  # depth of long tunnels, reached at this distance from their portals


def add_heights(
    roads: Sequence[OsmRoad], xy_m: Float64Array
) -> tuple[tuple[OsmRoad, ...], Float64Array, tuple[Finding, ...]]:
    """Add heights to roads, with additional nodes where the height changes.

    Args:
        roads: Roads that meet at their ends.
        xy_m: (N, 2) nodes, map frame.

    Returns:
        The roads with additional nodes; (M, 3) all nodes, the first N with unchanged x and y; a finding about crossings
        without enough clearance.
    """
    crossings = crossings_of(roads, xy_m)
    if not crossings and not any(road.way.tunnel for road in roads):
        return tuple(roads), np.column_stack([xy_m, np.zeros(len(xy_m))]), ()
    roads, xy_m, pairs = _subdivide(roads, xy_m, crossings)
    z_m = -_tunnel_depths_m(roads, xy_m)
    graph = _RoadGraph(roads, xy_m)
    order = sorted(range(len(crossings)), key=lambda k: roads[crossings[k][0]].way.layer)
    for _ in range(_PASSES):
        for k in order:
            _apply_clearance(roads, crossings[k][:2], pairs[k], graph, z_m)
    _flatten_junctions(graph, z_m)
    tight = [k for k in order if z_m[pairs[k][0]] - z_m[pairs[k][1]] < _CLEARANCE_M - 0.7]
    findings = [
        Finding("a crossing at two levels has too little clearance", Outcome.ASSUMED, position_m=xy_m[pairs[k][0]])
        for k in tight
    ]
    return tuple(roads), np.column_stack([xy_m, z_m]), tuple(findings)


def _tunnel_depths_m(roads: Sequence[OsmRoad], xy_m: Float64Array) -> Float64Array:
    """(N,) depths of (N, 2) nodes below the ground: 0 outside of tunnels and at portals."""
    tunnels = [road for road in roads if road.way.tunnel]
    depth_m = np.zeros(len(xy_m))
    if not tunnels:
        return depth_m
    outside = {node for road in roads if not road.way.tunnel for node in road.nodes}
    portals = sorted({node for road in tunnels for node in road.nodes} & outside)
    graph = _RoadGraph(tunnels, xy_m)
    from_portal_m = graph.distances_m(portals, np.inf)
    for portal in portals:
        tube = list(graph.distances_m([portal], np.inf))
        inside_m = np.array([from_portal_m[node] for node in tube])
        ramp_m = float(np.clip(inside_m.max(), 1.0, _TUNNEL_RAMP_M))
        share = np.clip(inside_m / ramp_m, 0.0, 1.0)
        depth_m[tube] = _TUNNEL_DEPTH_M * ramp_m / _TUNNEL_RAMP_M * 0.5 * (1.0 - np.cos(np.pi * share))
    return depth_m


def _apply_clearance(
    roads: Sequence[OsmRoad], crossing: tuple[int, int], pair: tuple[int, int], graph: "_RoadGraph", z_m: Float64Array
) -> None:
    """Raise or lower one road of a crossing by the lacking clearance; changes ``z_m``."""
    lacking_m = _CLEARANCE_M - (z_m[pair[0]] - z_m[pair[1]])
    if lacking_m < 0.01:
        return
    rises = roads[crossing[0]].way.layer > 0
    moved_node, other_node = pair if rises else pair[::-1]
    fast = float(roads[crossing[0 if rises else 1]].way.tags.get("maxspeed", 0)) > _FAST_KMH
    ramp_m = _FAST_RAMP_M if fast else _RAMP_M
    near_m = graph.distances_m([moved_node], _FLAT_M + ramp_m)
    if other_node in near_m:  # the roads are connected nearby: end the ramp before it reaches the other road
        ramp_m = max(_MIN_RAMP_M, min(ramp_m, near_m[other_node] - 2.0 * _FLAT_M))
    share = np.clip((np.array(list(near_m.values())) - _FLAT_M) / ramp_m, 0.0, 1.0)
    z_m[list(near_m)] += (lacking_m if rises else -lacking_m) * 0.5 * (1.0 + np.cos(np.pi * share))


def _flatten_junctions(graph: "_RoadGraph", z_m: Float64Array) -> None:
    """Flatten roads around junctions on a slope, because SUMO's junctions are level; changes ``z_m``."""
    junctions = {node for node in graph.junctions() if abs(z_m[node]) > 0.01}
    sloping_m = z_m.copy()
    for junction in sorted(junctions):
        near_m = graph.distances_m([junction], 2.0 * _JUNCTION_REACH_M)
        others_m = (along_m for node, along_m in near_m.items() if node in junctions and node != junction)
        neighbor_m = min(others_m, default=np.inf)
        reach_m = min(_JUNCTION_REACH_M, neighbor_m / 2.0)
        flat_m = min(_JUNCTION_M, reach_m / 2.0)
        nodes = list(near_m)
        share = np.clip((np.array(list(near_m.values())) - flat_m) / (reach_m - flat_m), 0.0, 1.0)
        z_m[nodes] += 0.5 * (1.0 + np.cos(np.pi * share)) * (sloping_m[junction] - sloping_m[nodes])


def _subdivide(
    roads: Sequence[OsmRoad], xy_m: Float64Array, crossings: Sequence[tuple[int, int, shapely.Point]]
) -> tuple[list[OsmRoad], Float64Array, list[tuple[int, int]]]:
    """Insert nodes at crossings and, near them and in tunnels, at short distances; also return pairs of crossings."""
    points = shapely.MultiPoint([point for _, _, point in crossings])
    near: BaseGeometry = shapely.buffer(points, _FLAT_M + _FAST_RAMP_M)
    near = overlay.union_all([near, *(line_of(road, xy_m) for road in roads if road.way.tunnel)])
    shapely.prepare(near)
    marks: dict[int, list[tuple[float, int, int]]] = defaultdict(list)
    for k, (upper, lower, point) in enumerate(crossings):
        for side, index in enumerate((upper, lower)):
            marks[index].append((line_of(roads[index], xy_m).project(point), k, side))
    nodes, pairs = list(xy_m), [[-1, -1] for _ in crossings]
    divided = list(roads)
    for index, road in enumerate(roads):
        line = line_of(road, xy_m)
        if not shapely.intersects(near, line):  # in this order: only the first one's index is used
            continue
        corners_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy_m[list(road.nodes)], axis=0).T))])
        steps_m = np.arange(_SPACING_M, line.length - _SPACING_M / 2.0, _SPACING_M)
        steps_m = steps_m[np.abs(steps_m[:, None] - corners_m).min(axis=1) > _SPACING_M / 2.0]
        stations = [(float(s_m), node, -1, 0) for s_m, node in zip(corners_m, road.nodes, strict=True)]
        stations += [(float(s_m), -1, -1, 0) for s_m in steps_m]
        stations += [(s_m, -1, k, side) for s_m, k, side in marks[index]]
        road_nodes = []
        for s_m, node, k, side in sorted(stations):
            if node < 0:
                node = len(nodes)
                nodes.append(np.array(line.interpolate(s_m).coords[0]))
            road_nodes.append(node)
            if k >= 0:
                pairs[k][side] = node
        divided[index] = replace(road, nodes=tuple(road_nodes))
    return divided, np.array(nodes), [(upper, lower) for upper, lower in pairs]


class _RoadGraph:
    """The nodes of roads and the distances between consecutive ones; scipy's search takes time for all nodes."""

    def __init__(self, roads: Sequence[OsmRoad], xy_m: Float64Array) -> None:
        starts = np.concatenate([road.nodes[:-1] for road in roads])
        ends = np.concatenate([road.nodes[1:] for road in roads])
        lengths_m = np.maximum(np.linalg.norm(xy_m[ends] - xy_m[starts], axis=1), 1e-3)
        self._neighbors: dict[int, dict[int, float]] = defaultdict(dict)
        for start, end, length_m in zip(starts.tolist(), ends.tolist(), lengths_m.tolist(), strict=True):
            self._neighbors[start][end] = self._neighbors[end][start] = length_m

    def junctions(self) -> Iterator[int]:
        """Nodes with more than two neighbors."""
        return (node for node, neighbors in self._neighbors.items() if len(neighbors) > 2)

    def distances_m(self, nodes: Sequence[int], limit_m: float) -> dict[int, float]:
        """Distances along the roads from the nearest of some nodes to all within a limit (Dijkstra, 1959)."""
        found: dict[int, float] = {}
        waiting = [(0.0, node) for node in nodes]
        while waiting:
            along_m, nearest = heappop(waiting)
            if nearest in found:
                continue
            found[nearest] = along_m
            for neighbor, length_m in self._neighbors[nearest].items():
                if neighbor not in found and along_m + length_m <= limit_m:
                    heappush(waiting, (along_m + length_m, neighbor))
        return found
