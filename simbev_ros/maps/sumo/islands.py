"""Finds the connected parts of a road network."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from simbev_ros.types import BoolArray, Float64Array, Int64Array


def on_mainland(starts: Sequence[str], ends: Sequence[str], lengths_m: Float64Array) -> BoolArray:
    """(N,) whether each of N roads belongs to the connected component of greatest length; directions are ignored.

    Args:
        starts: Node at which each road begins.
        ends: Node at which each road ends.
        lengths_m: (N,) lengths.
    """
    part = components(starts, ends)
    return np.asarray(part == np.argmax(np.bincount(part, lengths_m)))


def components(starts: Sequence[str] | Int64Array, ends: Sequence[str] | Int64Array) -> Int64Array:
    """(N,) number of the connected component that each of N roads between two nodes belongs to, from 0 on."""
    nodes, index = np.unique(np.concatenate([starts, ends]), return_inverse=True)
    start, end = np.split(index, 2)
    graph = coo_matrix((np.ones(len(start)), (start, end)), shape=(len(nodes), len(nodes)))
    return np.asarray(connected_components(graph, directed=False)[1][start], np.int64)
