"""Relations between lanes and edges as sparse boolean matrices, and the paths in them."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array


def relation(first: Int64Array, second: Int64Array, shape: tuple[int, int]) -> csr_array:
    """Boolean matrix of the pairs, columns ascending."""
    pairs = coo_array((np.ones(len(first), bool), (first, second)), shape=shape).tocsr()
    pairs.sum_duplicates()
    pairs.sort_indices()
    return pairs


def only_pairs(pairs: csr_array, kept: BoolArray) -> csr_array:
    """The relation with only those of its K pairs that a (K,) mask selects."""
    first, second = pairs.nonzero()
    return relation(first[kept], second[kept], pairs.shape)


def without_columns(pairs: csr_array, columns: BoolArray) -> csr_array:
    """The relation without the columns in a mask."""
    second = pairs.nonzero()[1]
    return only_pairs(pairs, ~columns[second])


def related(pairs: csr_array, row: int) -> Int64Array:
    """The columns that one row is related to."""
    return pairs.indices[pairs.indptr[row] : pairs.indptr[row + 1]]


def between_groups(pairs: csr_array, group: Int64Array) -> csr_array:
    """(E, E) relation between groups, of an (L, E) relation from members to groups and the (L,) groups of members."""
    first, second = pairs.nonzero()
    count = pairs.shape[1]
    return relation(group[first], second, (count, count))


class Loops(NamedTuple):
    """The sets of edges from each of which all others of its set can be reached.

    Attributes:
        number: (E,) each edge's set; a set of its own if no path leads back to it.
        length_m: (N,) total length of each of N sets, 0 for those without a path back.
    """

    number: Int64Array
    length_m: Float64Array


def loops(following: csr_array, length_m: Float64Array) -> Loops:
    """The loops in an (E, E) relation of edges with (E,) lengths."""
    count, number = connected_components(following, directed=True, connection="strong")
    first, second = following.nonzero()
    leads_back = np.zeros(count, bool)
    leads_back[number[first[number[first] == number[second]]]] = True
    return Loops(number.astype(np.int64), np.where(leads_back, np.bincount(number, length_m, count), 0.0))


def longest_path_beyond(following: csr_array, length_m: Float64Array, trap_m: float = 0.0) -> Float64Array:
    """(E,) length of the longest path beyond each edge's end; infinite if the path never has to end.

    Removes dead ends one after the other, last ones first, so that an edge's successors are done before the edge is.

    Args:
        following: (E, E) relation from edges to those that follow.
        length_m: (E,) their lengths.
        trap_m: Loops shorter than this are driven once only.
    """
    number, loop_m = loops(following, length_m) if trap_m else Loops(np.arange(len(length_m)), np.zeros(len(length_m)))
    is_trap = ((loop_m > 0.0) & (loop_m < trap_m))[number]
    once_m = np.where(is_trap, loop_m[number], length_m)
    if is_trap.any():
        first, second = following.nonzero()
        following = only_pairs(following, ~(is_trap[first] & (number[first] == number[second])))
    predecessors = following.T.tocsr()
    remaining = np.diff(following.indptr)
    beyond_m = np.zeros(len(length_m))
    never_ends = np.ones(len(length_m), bool)
    done = np.flatnonzero(remaining == 0)
    while len(done):
        never_ends[done] = False
        index, before = predecessors[done].nonzero()
        np.maximum.at(beyond_m, before, (once_m + beyond_m)[done[index]])
        np.subtract.at(remaining, before, 1)
        done = np.unique(before[remaining[before] == 0])
    return np.where(never_ends, np.inf, beyond_m + once_m - length_m)
