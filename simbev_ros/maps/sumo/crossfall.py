"""Adds crossfall to the roads of a SUMO net, where lanes are level across, so that rain would drain to the curb.

The carriageway falls from its inner border: the crown between both directions, or the left side of a one-way road (the
right side for left-hand traffic). Medians are level at its top, sidewalks at its outer edge. Junctions stay level:
towards them, and towards dead ends, the crossfall fades out as gradually as the superelevation of banked roads.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import Lane, paths_beyond
from simbev_ros.maps.roads.lane_kind import PAVED_KINDS
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.sumo.net import SumoNet

CROSSFALL = 0.02
"""Slope of paved roads; 1.5 to 2 % are usual (AASHTO, A Policy on Geometric Design of Highways and Streets, ch. 4)."""

_MAX_RELATIVE_GRADIENT = 0.005  # of the outer edge relative to the top: AASHTO's at 80 km/h (ibid., chapter 3)
_MIN_FADE_M = 15.0
_NUM_FADE_STEPS = 6  # linear steps in which it fades
_MIN_SPACING_M = 1.0  # spacing of added points
_HEIGHT_TOLERANCE_M = 0.01


@dataclass(frozen=True)
class Crossfall:
    """Depths of the borders of a net's N lanes below the inner border of their edge.

    Attributes:
        inner_m: (N,) depth of the borders on the side of oncoming traffic, where the crossfall is not faded.
        outer_m: (N,) depth of the other borders.
        fade_m: (N,) length over which a lane's crossfall fades out.
        level_m: (N, 2) length that is level beyond that, at the lane's start and at its end; -inf where nothing fades.
        continued: Ids of the junctions that the crossfall passes through, because a road only continues there.
    """

    inner_m: Float64Array
    outer_m: Float64Array
    fade_m: Float64Array
    level_m: Float64Array
    continued: frozenset[str]

    @classmethod
    def of_net(cls, net: SumoNet, edges: Mapping[str, Sequence[Lane]]) -> "Crossfall":
        """Crossfall of all lanes of a net; ``edges``: parallel lanes by edge, from the curb inward."""
        row = {lane: number for number, lane in enumerate(net.lanes)}
        below_m, level_m = np.zeros((2, len(row), 2))
        fade_m = np.full(len(row), _MIN_FADE_M)
        outside = {edge: edges[edge][::-1] for edge in net.edge_ends if edge in edges}
        for lanes in outside.values():
            falls_m = np.array([CROSSFALL * lane.width_m * (lane.kind in PAVED_KINDS) for lane in lanes])
            foot_m = np.cumsum(falls_m)
            below_m[[row[lane.id] for lane in lanes]] = np.column_stack([foot_m - falls_m, foot_m])
        continued = _continued(net, dict(zip(row, below_m, strict=True)))
        for edge, lanes in outside.items():
            rows = [row[lane.id] for lane in lanes]
            continues = [end in continued for end in net.edge_ends[edge]]
            level_m[rows] = np.where(continues, -np.inf, _excess_m(lanes))
            fade_m[rows] = _fade_m(lanes, level_m[rows], below_m[rows[-1], 1])
        for start, junction, (*inside, _) in _paths(net):
            if junction in continued:
                rows = [row[lane] for lane in inside]
                below_m[rows], level_m[rows] = below_m[row[start]], -np.inf
        return cls(below_m[:, 0], below_m[:, 1], fade_m, level_m, continued)

    def add_fade_points(self, lines: Polylines) -> Polylines:
        """Insert points into the lanes' lines where the crossfall fades."""
        from_end_m = (
            self.level_m[:, :, None] + self.fade_m[:, None, None] * np.arange(_NUM_FADE_STEPS + 1) / _NUM_FADE_STEPS
        )
        row = np.repeat(np.arange(len(lines)), 2 * (_NUM_FADE_STEPS + 1))
        added_m = np.stack([from_end_m[:, 0], lines.length_m[:, None] - from_end_m[:, 1]], axis=1).reshape(-1)
        is_inside = (added_m > 0.0) & (added_m < lines.length_m[row]) & (self.outer_m[row] > 0.0)
        row, added_m = row[is_inside], added_m[is_inside]
        rows, stations_m = np.concatenate([lines.row, row]), np.concatenate([lines.station_m, added_m])
        points_m = np.concatenate([lines.points_m, lines.values(lines.parameter(row, added_m))])
        order = np.lexsort([stations_m, rows])
        is_new = order >= len(lines.row)
        close = (np.diff(stations_m[order]) < _MIN_SPACING_M) & (np.diff(rows[order]) == 0)
        is_superfluous = is_new & (np.append(False, close) | (np.append(close, False) & ~np.append(is_new[1:], False)))
        kept = order[~is_superfluous]
        count = np.bincount(rows[kept], minlength=len(lines))
        return Polylines(points_m[kept], np.concatenate([[0], np.cumsum(count)]))

    def fraction(self, lines: Polylines) -> Float64Array:
        """(P,) remaining fraction of the crossfall at the points of the lanes' lines."""
        to_ends_m = np.column_stack([lines.station_m, lines.length_m[lines.row] - lines.station_m])
        to_end_fraction = np.clip((to_ends_m - self.level_m[lines.row]) / self.fade_m[lines.row, None], 0.0, 1.0)
        return np.asarray(np.prod(to_end_fraction**2 * (3.0 - 2.0 * to_end_fraction), axis=1))


def _excess_m(lanes: Sequence[Lane]) -> Float64Array:
    """(N, 2) lengths by which parallel lanes extend beyond the shortest one, at their starts and at their ends."""
    extent_m = np.empty((len(lanes), 2))
    for column, (end, before) in enumerate(((0, 1), (-1, -2))):
        outward = lanes[0].centerline_m[end, :2] - lanes[0].centerline_m[before, :2]
        ends_m = np.array([lane.centerline_m[end, :2] for lane in lanes])
        extent_m[:, column] = ends_m @ outward / np.linalg.norm(outward)
    return np.asarray(extent_m - extent_m.min(axis=0))


def _fade_m(lanes: Sequence[Lane], level_m: Float64Array, foot_m: float) -> Float64Array:
    """(N,) lengths over which parallel lanes fade together; on short ones in proportion to their length (loops)."""
    fade_m = max(foot_m / _MAX_RELATIVE_GRADIENT, _MIN_FADE_M)
    level_length_m = np.maximum(level_m, 0.0).sum(axis=1)
    if lanes[0].length_m - level_length_m[0] >= 2.0 * fade_m:
        return np.full(len(lanes), fade_m)
    fading_m = np.maximum(np.array([lane.length_m for lane in lanes]) - level_length_m, _MIN_SPACING_M)
    return np.asarray(fade_m * fading_m / fading_m[0])


def _continued(net: SumoNet, below_m: Mapping[str, Float64Array]) -> frozenset[str]:
    """Junctions of two arms in which each lane leads to a lane with the same depth below its inner border."""
    arms: dict[str, set[str]] = defaultdict(set)
    for start, end in net.edge_ends.values():
        arms[start].add(end)
        arms[end].add(start)
    changed = {
        junction
        for lane, junction, (*_, following) in _paths(net)
        if np.abs(below_m[following] - below_m[lane]).max() > _HEIGHT_TOLERANCE_M
    }
    return frozenset(junction for junction, others in arms.items() if len(others) == 2) - changed


def _paths(net: SumoNet) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Yield each carriageway lane, the junction that it leads to, and its paths through it to a lane beyond."""
    for lane in net.lanes.values():
        if lane.kind in PAVED_KINDS and lane.edge in net.edge_ends:
            for path in paths_beyond(lane, net.lanes):
                yield lane.id, net.edge_ends[lane.edge][1], path
