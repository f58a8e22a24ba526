"""Crossfall of roads that come as a SUMO net, whose lanes lie level across: rain runs off to the curb.

The carriageway falls away from its inner border: the crown between both directions, or the left side of a one-way road
(the right one where traffic keeps to the left). Medians lie level at its top, sidewalks at its foot. Where roads meet,
junctions stay level: towards them, and towards dead ends, the crossfall fades out, as slowly as banked roads turn.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.sumo.net import SumoNet
from simbev_ros.types import Float64Array

CROSSFALL = 0.02
"""Of paved roads; 1.5 to 2 % are usual (AASHTO, A Policy on Geometric Design of Highways and Streets, chapter 4)."""

_GRADIENT = 0.005  # of the carriageway's foot against its top: AASHTO's largest at 80 km/h (ibid., chapter 3)
_SHORTEST_M = 15.0
_STEPS = 6  # in which it fades, each even
_APART_M = 1.0  # points of a line that come between others
_SAME_M = 0.01
_CARRIAGEWAY = (*ROAD_KINDS, LaneKind.SHOULDER)


@dataclass(frozen=True)
class Crossfall:
    """How far the borders of a net's N lanes lie below the inner border of their edge.

    Attributes:
        inner_m: (N,) the borders on the side of oncoming traffic, where nothing fades.
        outer_m: (N,) the others.
        fade_m: (N,) so much of a lane's length it takes to fade out.
        level_m: (N, 2) so much stays level then, at the lane's start and at its end; -inf where nothing fades.
        continued: Ids of the junctions that it goes through, because there a road merely goes on.
    """

    inner_m: Float64Array
    outer_m: Float64Array
    fade_m: Float64Array
    level_m: Float64Array
    continued: frozenset[str]

    @classmethod
    def of(cls, net: SumoNet, edges: Mapping[str, Sequence[Lane]]) -> "Crossfall":
        """That of all lanes of a net; ``edges``: those that lie side by side, from the curb inward."""
        row = {lane: number for number, lane in enumerate(net.lanes)}
        below_m, level_m = np.zeros((2, len(row), 2))
        fade_m = np.full(len(row), _SHORTEST_M)
        outside = {edge: edges[edge][::-1] for edge in net.edge_ends if edge in edges}
        for lanes in outside.values():
            falls_m = np.array([CROSSFALL * lane.width_m * (lane.kind in _CARRIAGEWAY) for lane in lanes])
            foot_m = np.cumsum(falls_m)
            below_m[[row[lane.id] for lane in lanes]] = np.column_stack([foot_m - falls_m, foot_m])
        continued = _continued(net, dict(zip(row, below_m, strict=True)))
        for edge, lanes in outside.items():
            rows = [row[lane.id] for lane in lanes]
            goes_on = [end in continued for end in net.edge_ends[edge]]
            level_m[rows] = np.where(goes_on, -np.inf, _ahead_m(lanes))
            fade_m[rows] = _fade_m(lanes, level_m[rows], below_m[rows[-1], 1])
        for start, junction, (*inside, _) in _ways(net):
            if junction in continued:
                rows = [row[lane] for lane in inside]
                below_m[rows], level_m[rows] = below_m[row[start]], -np.inf
        return cls(below_m[:, 0], below_m[:, 1], fade_m, level_m, continued)

    def stepped(self, lines: Polylines) -> Polylines:
        """The lanes' lines, with more points where it fades."""
        from_end_m = self.level_m[:, :, None] + self.fade_m[:, None, None] * np.arange(_STEPS + 1) / _STEPS
        row = np.repeat(np.arange(len(lines)), 2 * (_STEPS + 1))
        at_m = np.stack([from_end_m[:, 0], lines.length_m[:, None] - from_end_m[:, 1]], axis=1).reshape(-1)
        wanted = (at_m > 0.0) & (at_m < lines.length_m[row]) & (self.outer_m[row] > 0.0)
        row, at_m = row[wanted], at_m[wanted]
        rows, stations_m = np.concatenate([lines.row, row]), np.concatenate([lines.station_m, at_m])
        points_m = np.concatenate([lines.points_m, lines.values(lines.parameter(row, at_m))])
        order = np.lexsort([stations_m, rows])
        is_new = order >= len(lines.row)
        close = (np.diff(stations_m[order]) < _APART_M) & (np.diff(rows[order]) == 0)
        superfluous = is_new & (np.append(False, close) | (np.append(close, False) & ~np.append(is_new[1:], False)))
        kept = order[~superfluous]
        count = np.bincount(rows[kept], minlength=len(lines))
        return Polylines(points_m[kept], np.concatenate([[0], np.cumsum(count)]))

    def share(self, lines: Polylines) -> Float64Array:
        """(P,) how much of it is left at the points of the lanes' lines."""
        to_ends_m = np.column_stack([lines.station_m, lines.length_m[lines.row] - lines.station_m])
        part = np.clip((to_ends_m - self.level_m[lines.row]) / self.fade_m[lines.row, None], 0.0, 1.0)
        return np.asarray(np.prod(part**2 * (3.0 - 2.0 * part), axis=1))


def _ahead_m(lanes: Sequence[Lane]) -> Float64Array:
    """(N, 2) how far lanes side by side reach beyond the one that reaches least, at their starts and at their ends."""
    reached_m = np.empty((len(lanes), 2))
    for column, (end, before) in enumerate(((0, 1), (-1, -2))):
        outward = lanes[0].centerline_m[end, :2] - lanes[0].centerline_m[before, :2]
        ends_m = np.array([lane.centerline_m[end, :2] for lane in lanes])
        reached_m[:, column] = ends_m @ outward / np.linalg.norm(outward)
    return np.asarray(reached_m - reached_m.min(axis=0))


def _fade_m(lanes: Sequence[Lane], level_m: Float64Array, foot_m: float) -> Float64Array:
    """(N,) lengths over which lanes side by side change together; on short ones in their proportion, as in loops."""
    fade_m = max(foot_m / _GRADIENT, _SHORTEST_M)
    kept_m = np.maximum(level_m, 0.0).sum(axis=1)
    if lanes[0].length_m - kept_m[0] >= 2.0 * fade_m:
        return np.full(len(lanes), fade_m)
    left_m = np.maximum(np.array([lane.length_m for lane in lanes]) - kept_m, _APART_M)
    return np.asarray(fade_m * left_m / left_m[0])


def _continued(net: SumoNet, below_m: Mapping[str, Float64Array]) -> frozenset[str]:
    """Junctions of two arms in which each lane leads to one that lies just as far below its inner border."""
    arms: dict[str, set[str]] = defaultdict(set)
    for start, end in net.edge_ends.values():
        arms[start].add(end)
        arms[end].add(start)
    changed = {
        junction
        for lane, junction, (*_, following) in _ways(net)
        if np.abs(below_m[following] - below_m[lane]).max() > _SAME_M
    }
    return frozenset(junction for junction, others in arms.items() if len(others) == 2) - changed


def _ways(net: SumoNet) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Lane of a carriageway, the junction that it leads to, and lanes through that, the last one beyond."""
    for lane in net.lanes.values():
        if lane.kind in _CARRIAGEWAY and lane.edge in net.edge_ends:
            for way in _beyond(net, lane):
                yield lane.id, net.edge_ends[lane.edge][1], way


def _beyond(net: SumoNet, lane: Lane) -> Iterator[tuple[str, ...]]:
    """Lanes that follow each other after one, up to the first outside junctions."""
    for following in lane.successors:
        if net.lanes[following].junction:
            yield from ((following, *way) for way in _beyond(net, net.lanes[following]))
        else:
            yield (following,)
