"""Finds the largest connected part of a road network."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from simbev_ros.types import BoolArray, Float64Array


def on_mainland(starts: Sequence[str], ends: Sequence[str], lengths_m: Float64Array) -> BoolArray:
    """(N,) whether each of N roads belongs to the connected component of greatest length; directions are ignored.

    Args:
        starts: Node at which each road begins.
        ends: Node at which each road ends.
        lengths_m: (N,) lengths.
    """
    nodes, index = np.unique([*starts, *ends], return_inverse=True)
    start, end = np.split(index, 2)
    graph = coo_matrix((np.ones(len(start)), (start, end)), shape=(len(nodes), len(nodes)))
    part = connected_components(graph, directed=False)[1][start]
    return np.asarray(part == np.argmax(np.bincount(part, lengths_m)))
