"""Turns on the spot, from a road back onto itself: which they are, and which a driver need not take."""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array

from simbev_ros.foundation.types import BoolArray, Int64Array
from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.scene.streets.relations import only_pairs

_OPPOSITE_COSINE, _TURN_M = 0.9, 15.0  # opposite direction, and distance of both roads' ends


class Turns:
    """Finds turns among the ways from the lanes of a map to edges."""

    def __init__(self, lanes: Sequence[Lane], edge: Int64Array) -> None:
        """For L lanes; ``edge`` (L,) is the number of each lane's edge."""
        lines = Polylines.from_lines([lane.centerline_m for lane in lanes])
        rows = np.arange(len(lines))
        stations_m = (np.zeros(len(lines)), lines.length_m / 2.0, lines.length_m)
        parameters = [lines.parameter(rows, s_m) for s_m in stations_m]
        self._points_m = np.stack([lines.values(each)[:, :2] for each in parameters])
        self._headings = np.stack([lines.headings(each) for each in parameters])
        self._first_lane = np.full(edge.max(initial=-1) + 1, -1)
        self._first_lane[edge[::-1]] = rows[::-1]

    def lead_back(self, lane: Int64Array, edge: Int64Array) -> BoolArray:
        """(K,) whether (K,) edges lead back from (K,) lanes outside junctions, by a turn of about 180° on the spot.

        The turn shows in the headings where both meet or, in bends, in the course of the whole edge.
        """
        goal = self._first_lane[edge]
        opposite = np.einsum("ij,ij->i", self._headings[-1, lane], self._headings[0, goal]) < -_OPPOSITE_COSINE
        gap_m = np.linalg.norm(self._points_m[::-1, lane] - self._points_m[:, goal], axis=2)
        return np.asarray((opposite & (gap_m[0] < _TURN_M)) | (gap_m < _TURN_M).all(axis=0))


def without_needless_turns(after: csr_array, turns: BoolArray, edge: Int64Array) -> csr_array:
    """A relation from lanes to edges without turns, except where nothing else follows a lane's edge.

    Args:
        after: The (L, E) relation, with K pairs.
        turns: (K,) whether each pair is a turn.
        edge: (L,) number of each lane's edge.
    """
    number = edge[after.nonzero()[0]]
    goes_on = np.zeros(after.shape[1], bool)
    goes_on[number[~turns]] = True
    kept = ~turns | ~goes_on[number]
    return after if kept.all() else only_pairs(after, kept)
