"""Finds the connected parts of a road network."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.findings import Finding, Outcome


def driven_parts(
    starts: Sequence[str] | Int64Array, ends: Sequence[str] | Int64Array, driven_m: Float64Array
) -> tuple[BoolArray, tuple[Finding, ...]]:
    """Keep the connected parts of a road network that cars may drive on; each has traffic of its own.

    Args:
        starts: Node at which each of N roads begins.
        ends: Node at which each road ends; directions are ignored.
        driven_m: (N,) length of each road for cars, 0 for those that they may not use.

    Returns:
        (N,) whether each road belongs to such a part, and a finding if there are several.
    """
    part = _components(starts, ends)
    part_m = np.bincount(part, driven_m)
    parts = int(np.count_nonzero(part_m))
    kept: BoolArray = part_m[part] > 0.0
    if parts <= 1:
        return kept, ()
    rule = f"roads are in {parts} parts that are not connected, each with traffic of its own"
    apart_km, all_km = (part_m.sum() - part_m.max()) / 1e3, part_m.sum() / 1e3
    detail = f"{apart_km:.2f} of {all_km:.2f} km are outside the largest"
    return kept, (Finding(rule, Outcome.ASSUMED, detail=detail),)


def _components(starts: Sequence[str] | Int64Array, ends: Sequence[str] | Int64Array) -> Int64Array:
    """(N,) number of the connected component that each of N roads between two nodes belongs to, from 0 on."""
    nodes, index = np.unique(np.concatenate([starts, ends]), return_inverse=True)
    start, end = np.split(index, 2)
    graph = coo_matrix((np.ones(len(start)), (start, end)), shape=(len(nodes), len(nodes)))
    return np.asarray(connected_components(graph, directed=False)[1][start], np.int64)
