"""Heights of roads that cross at two levels: OpenStreetMap knows layers, not metres.

All land is level. Where two roads of different layers cross, the upper one rises over the lower one, or, if it is
itself on or below the ground, the lower one dips; along every road that leads away the height returns smoothly to 0.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from simbev_ros.maps.osm.roads import OsmRoad, crossings_of, line_of
from simbev_ros.types import Float64Array

_CLEARANCE_M = 6.2  # from carriageway to carriageway: 4.7 m for traffic and 1.5 m of structure
_FLAT_M = 12.0
_RAMP_M, _FAST_RAMP_M = 150.0, 220.0
_JUNCTION_M, _JUNCTION_REACH_M = 8.0, 40.0
_FAST_KMH = 70
_SHORTEST_RAMP_M = 25.0
_SPACING_M = 8.0
_PASSES = 4


def with_heights(
    roads: Sequence[OsmRoad], xy_m: Float64Array
) -> tuple[tuple[OsmRoad, ...], Float64Array, tuple[str, ...]]:
    """Roads with nodes where their height changes.

    Args:
        roads: Roads that meet at their ends.
        xy_m: (N, 2) nodes, map frame.

    Returns:
        The roads with further nodes; (M, 3) all nodes, the first N in plan as they were; what could not be done.
    """
    crossings = crossings_of(roads, xy_m)
    if not crossings:
        return tuple(roads), np.column_stack([xy_m, np.zeros(len(xy_m))]), ()
    roads, xy_m, pairs = _subdivided(roads, xy_m, crossings)
    z_m = np.zeros(len(xy_m))
    graph = _graph(roads, xy_m)
    order = sorted(range(len(crossings)), key=lambda k: roads[crossings[k][0]].way.layer)
    for _ in range(_PASSES):
        for k in order:
            _separate(roads, crossings[k][:2], pairs[k], graph, z_m)
    _level_junctions(graph, z_m)
    tight = [k for k in order if z_m[pairs[k][0]] - z_m[pairs[k][1]] < _CLEARANCE_M - 0.7]
    notes = (f"crossings at two levels that are lower than they should be: {len(tight)}",) if tight else ()
    return tuple(roads), np.column_stack([xy_m, z_m]), notes


def _separate(
    roads: Sequence[OsmRoad], crossing: tuple[int, int], pair: tuple[int, int], graph: csr_matrix, z_m: Float64Array
) -> None:
    """Raise or sink what lacks in height at one crossing; changes ``z_m``."""
    missing_m = _CLEARANCE_M - (z_m[pair[0]] - z_m[pair[1]])
    if missing_m < 0.01:
        return
    rises = roads[crossing[0]].way.layer > 0
    mover, other = pair if rises else pair[::-1]
    fast = float(roads[crossing[0 if rises else 1]].way.tags.get("maxspeed", 0)) > _FAST_KMH
    ramp_m = _FAST_RAMP_M if fast else _RAMP_M
    along_m = dijkstra(graph, directed=False, indices=mover, limit=_FLAT_M + ramp_m)
    if np.isfinite(along_m[other]):  # both hang together nearby: the ramp ends before it comes back
        ramp_m = max(_SHORTEST_RAMP_M, min(ramp_m, along_m[other] - 2.0 * _FLAT_M))
    share = np.clip((along_m - _FLAT_M) / ramp_m, 0.0, 1.0)
    z_m += (missing_m if rises else -missing_m) * 0.5 * (1.0 + np.cos(np.pi * share))


def _level_junctions(graph: csr_matrix, z_m: Float64Array) -> None:
    """Make roads level where they meet on a slope, because junctions are; changes ``z_m``."""
    junctions = np.flatnonzero((np.diff((graph + graph.T).indptr) > 2) & (np.abs(z_m) > 0.01))
    sloping_m = z_m.copy()
    for junction in junctions:
        along_m = dijkstra(graph, directed=False, indices=junction, limit=2.0 * _JUNCTION_REACH_M)
        neighbour_m = np.delete(along_m[junctions], np.searchsorted(junctions, junction)).min(initial=np.inf)
        reach_m = min(_JUNCTION_REACH_M, neighbour_m / 2.0)
        flat_m = min(_JUNCTION_M, reach_m / 2.0)
        share = np.clip((along_m - flat_m) / (reach_m - flat_m), 0.0, 1.0)
        z_m += 0.5 * (1.0 + np.cos(np.pi * share)) * (sloping_m[junction] - sloping_m)


def _subdivided(
    roads: Sequence[OsmRoad], xy_m: Float64Array, crossings: Sequence[tuple[int, int, shapely.Point]]
) -> tuple[list[OsmRoad], Float64Array, list[tuple[int, int]]]:
    """Roads with nodes at crossings and, near them, at short distances; and each crossing's upper and lower node."""
    near = shapely.buffer(shapely.MultiPoint([place for _, _, place in crossings]), _FLAT_M + _FAST_RAMP_M)
    marks: dict[int, list[tuple[float, int, int]]] = defaultdict(list)
    for k, (upper, lower, place) in enumerate(crossings):
        for side, index in enumerate((upper, lower)):
            marks[index].append((line_of(roads[index], xy_m).project(place), k, side))
    nodes, pairs = list(xy_m), [[-1, -1] for _ in crossings]
    divided = list(roads)
    for index, road in enumerate(roads):
        line = line_of(road, xy_m)
        if not shapely.intersects(line, near):
            continue
        corners_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy_m[list(road.nodes)], axis=0).T))])
        steps_m = np.arange(_SPACING_M, line.length - _SPACING_M / 2.0, _SPACING_M)
        steps_m = steps_m[np.abs(steps_m[:, None] - corners_m).min(axis=1) > _SPACING_M / 2.0]
        places = [(float(s_m), node, -1, 0) for s_m, node in zip(corners_m, road.nodes, strict=True)]
        places += [(float(s_m), -1, -1, 0) for s_m in steps_m]
        places += [(s_m, -1, k, side) for s_m, k, side in marks[index]]
        numbers = []
        for s_m, node, k, side in sorted(places):
            if node < 0:
                node = len(nodes)
                nodes.append(np.array(line.interpolate(s_m).coords[0]))
            numbers.append(node)
            if k >= 0:
                pairs[k][side] = node
        divided[index] = replace(road, nodes=tuple(numbers))
    return divided, np.array(nodes), [(upper, lower) for upper, lower in pairs]


def _graph(roads: Sequence[OsmRoad], xy_m: Float64Array) -> csr_matrix:
    """Distances along roads from node to node."""
    starts = np.concatenate([road.nodes[:-1] for road in roads])
    ends = np.concatenate([road.nodes[1:] for road in roads])
    lengths_m = np.maximum(np.linalg.norm(xy_m[ends] - xy_m[starts], axis=1), 1e-3)
    pairs, index = np.unique(np.sort(np.stack([starts, ends], axis=1), axis=1), axis=0, return_index=True)
    return coo_matrix((lengths_m[index], pairs.T), shape=(len(xy_m), len(xy_m))).tocsr()
