"""The path of a vehicle lane by lane: a sequence of edges in, points along lane centers with limits and commands out.

Lane changes are as few as the connections at junctions allow. Each leads smoothly from one center line to the next.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import Lane, RoadNetwork, paths_beyond
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.schema.scene.drive_spec import Command

SPACING_M = 1.0
_TURN_RAD = math.radians(30.0)
_CHANGE_S, _MIN_CHANGE_M, _MAX_CHANGE_M = 3.5, 20.0, 80.0
"""Duration of a lane change at the speed limit, between two lengths; naturalistic ones take 3 to 5 s (NHTSA, 2004)."""
_BEFORE_CHANGE = 0.3
"""Share of the length that lane changes leave free on an edge that comes before the first of them."""
_SHORT_PENALTY = 10.0
_MIN_STEP_M = 0.01


@dataclass(frozen=True)
class LanePath:
    """N points along a path.

    Attributes:
        points_m: (N, 3) float64, map frame.
        lanes: N lanes.
        commands: N maneuvers.
    """

    points_m: Float64Array
    lanes: tuple[Lane, ...]
    commands: tuple[Command, ...]

    @property
    def edges(self) -> tuple[str, ...]:
        """Ids of the edges outside junctions along the path."""
        return tuple(edge for edge, lanes in groupby(self.lanes, lambda lane: lane.edge) if not next(lanes).junction)


@dataclass(frozen=True)
class _Link:
    """A way from a lane across a junction to a lane of the next edge."""

    exit: Lane
    inside: tuple[Lane, ...]
    entry: Lane


class LanePaths:
    """Finds paths for one of SUMO's vehicle classes."""

    def __init__(self, network: RoadNetwork, sumo_class: str) -> None:
        """On the driving lanes of a map that the class may use."""
        self._network, self._class = network, sumo_class

    def path_along(self, edges: Sequence[str], start: tuple[Lane, float], goal: tuple[Lane, float] | None) -> LanePath:
        """The path along edges outside junctions, each of which follows the one before it.

        Args:
            edges: Ids of the edges.
            start: Lane of the first edge, and the distance from its start at which the path begins.
            goal: Lane of the last edge, and the distance at which the path ends; None: the end of any lane.

        Raises:
            ValueError: No lane of an edge leads to the next one.
        """
        links = self._choose_links(edges, start[0], goal[0] if goal is not None else None)
        points_m, lanes, commands = list[Float64Array](), list[Lane](), list[Command]()
        lane, entered_m = start
        last = goal if goal is not None else (links[-1].entry if links else lane, math.inf)
        for number in range(len(edges)):
            link = links[number] if number < len(links) else None
            exit_lane, until_m = (link.exit, math.inf) if link is not None else last
            for part, part_lanes, part_commands in self._parts(lane, entered_m, exit_lane, until_m, link):
                points_m.append(part)
                lanes += part_lanes
                commands += part_commands
            if link is not None:
                lane, entered_m = link.entry, 0.0
        return _without_repeated_points(np.concatenate(points_m), lanes, commands)

    def _parts(
        self, lane: Lane, from_m: float, exit_lane: Lane, until_m: float, link: _Link | None
    ) -> Iterator[tuple[Float64Array, list[Lane], list[Command]]]:
        """Points on one edge, then those inside the junction behind it."""
        beside = self._lanes(lane.edge)
        first, last = beside.index(lane), beside.index(exit_lane)
        yield _along(beside[first : last + 1] if last >= first else beside[last : first + 1][::-1], from_m, until_m)
        if link is not None:
            command = self._command(link)
            for inside in link.inside:
                points_m, lanes, _ = _along([inside], 0.0, math.inf)
                yield points_m, lanes, [command] * len(lanes)

    def _lanes(self, edge: str) -> list[Lane]:
        """Usable lanes of an edge from right to left."""
        lanes = (each for each in self._network.lanes_of_edge(edge) if each.kind is LaneKind.DRIVING)
        return sorted((each for each in lanes if self._class in each.classes), key=lambda each: each.index)

    def _links(self, edge: str) -> list[_Link]:
        """All ways from an edge to edges that follow."""
        links = []
        for lane in self._lanes(edge):
            for path in paths_beyond(lane, self._network.lanes):
                *inside, entry = (self._network.lanes[name] for name in path)
                if all(each.kind is LaneKind.DRIVING and self._class in each.classes for each in (*inside, entry)):
                    links.append(_Link(lane, tuple(inside), entry))
        return links

    def _choose_links(self, edges: Sequence[str], start: Lane, goal: Lane | None) -> list[_Link]:
        """The links between edges with the fewest lane changes in all; those on short edges count as several."""
        cost = {each.id: 0.0 if goal is None else _change_cost(each, goal) for each in self._lanes(edges[-1])}
        best: list[dict[str, _Link]] = []
        for edge, following in zip(edges[-2::-1], edges[:0:-1], strict=True):
            links = [each for each in self._links(edge) if each.entry.edge == following]
            if not links:
                raise ValueError(f"no lane of edge {edge} leads to edge {following}")
            onward, cost, chosen = cost, {}, {}
            for lane in self._lanes(edge):
                costs = [_change_cost(lane, each.exit) + onward[each.entry.id] for each in links]
                chosen[lane.id], cost[lane.id] = links[int(np.argmin(costs))], min(costs)
            best.append(chosen)
        lane, path = start, []
        for chosen in reversed(best):
            path.append(chosen[lane.id])
            lane = path[-1].entry
        return path

    def _command(self, link: _Link) -> Command:
        """The maneuver of a link; without another edge to choose, there is none."""
        choices = [each for each in self._links(link.exit.edge) if not _turns_back(each)]
        if len({each.entry.edge for each in choices} | {link.entry.edge}) < 2:
            return Command.FOLLOW
        turn_rad = _turn_rad(link)
        if abs(turn_rad) <= _TURN_RAD:
            return Command.STRAIGHT
        return Command.LEFT if turn_rad > 0.0 else Command.RIGHT


def _along(lanes: Sequence[Lane], from_m: float, until_m: float) -> tuple[Float64Array, list[Lane], list[Command]]:
    """Points along the first of adjacent lanes, with a change to each of the others, at equal shares of their lengths.

    Args:
        lanes: The lanes in the order in which they are driven.
        from_m: Distance from the start of the first lane.
        until_m: Distance from the start of the last lane.
    """
    length_m = max(lane.length_m for lane in lanes)
    first, last = (min(at_m / lane.length_m, 1.0) for at_m, lane in ((from_m, lanes[0]), (until_m, lanes[-1])))
    share = np.linspace(first, last, max(2, math.ceil((last - first) * length_m / SPACING_M) + 1))
    lines_m = np.stack([_at_shares(lane.centerline_m, share) for lane in lanes])
    changes = len(lanes) - 1
    if not changes:
        return lines_m[0], [lanes[0]] * len(share), [Command.FOLLOW] * len(share)
    free_m = (last - first) * length_m
    change_m = min(min(max(_CHANGE_S * lanes[0].speed_mps, _MIN_CHANGE_M), _MAX_CHANGE_M), free_m / changes)
    begin_m = _BEFORE_CHANGE * (free_m - changes * change_m)
    done = np.clip(((share - first) * length_m - begin_m) / max(change_m, 1e-9), 0.0, changes)
    row = np.minimum(done.astype(np.int64), changes - 1)
    part = done - row
    weight = (part**2 * (3.0 - 2.0 * part))[:, None]
    at = np.arange(len(share))
    points_m: Float64Array = (1.0 - weight) * lines_m[row, at] + weight * lines_m[row + 1, at]
    to_left = _is_left(lines_m[0, len(share) // 2 - 1 : len(share) // 2 + 1], lines_m[1, len(share) // 2])
    change = Command.CHANGE_LEFT if to_left else Command.CHANGE_RIGHT
    is_changing = (done > 0.0) & (done < changes)
    return (
        points_m,
        [lanes[each] for each in (row + (part >= 0.5)).tolist()],
        [change if each else Command.FOLLOW for each in is_changing.tolist()],
    )


def _at_shares(line_m: Float64Array, share: Float64Array) -> Float64Array:
    """(N, 3) points at shares of the length of a line in plan view."""
    stations_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1))])
    return np.column_stack([np.interp(share * stations_m[-1], stations_m, line_m[:, axis]) for axis in range(3)])


def _is_left(step_m: Float64Array, point_m: Float64Array) -> bool:
    """Whether a point is to the left of the line through (2, 3) points."""
    ahead, beside = step_m[1] - step_m[0], point_m - step_m[0]
    return bool(ahead[0] * beside[1] - ahead[1] * beside[0] > 0.0)


def _change_cost(start: Lane, goal: Lane) -> float:
    """Lane changes between two lanes of an edge, weighted where the edge is short for them."""
    changes = abs(start.index - goal.index)
    return changes * (1.0 if start.length_m >= changes * _MIN_CHANGE_M else _SHORT_PENALTY)


def _turn_rad(link: _Link) -> float:
    """Angle by which the direction changes across a junction, counterclockwise positive."""
    before, after = (
        np.diff(link.exit.centerline_m[-2:, :2], axis=0)[0],
        np.diff(link.entry.centerline_m[:2, :2], axis=0)[0],
    )
    return math.atan2(before[0] * after[1] - before[1] * after[0], float(before @ after))


def _turns_back(link: _Link) -> bool:
    """Whether a link leads back along the road."""
    return abs(_turn_rad(link)) > math.radians(150.0)


def _without_repeated_points(points_m: Float64Array, lanes: list[Lane], commands: list[Command]) -> LanePath:
    """The path without points at the same position, of which edges have one at each end."""
    step_m = np.linalg.norm(np.diff(points_m[:, :2], axis=0), axis=1)
    kept = np.flatnonzero(np.concatenate([[True], step_m > _MIN_STEP_M])).tolist()
    return LanePath(points_m[kept], tuple(lanes[row] for row in kept), tuple(commands[row] for row in kept))
