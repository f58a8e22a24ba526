"""The lanes ahead of SUMO's vehicles, as far as they get in a few seconds."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.simulation.world.sumo.libsumo_import import libsumo
from simbev_ros.simulation.world.sumo.tracks import LaneTracks

_MAX_LANES = 7  # number of lanes of one vehicle's path; it ends there
_REFRESH_TICKS = 100  # the lanes that a vehicle will take may change while it is still on the same lane


class LaneProgress(NamedTuple):
    """Where V vehicles are on their routes.

    Attributes:
        lanes: V lane ids.
        position_m: (V,) SUMO's positions of their fronts on these lanes.
        next_edges: V ids of the edges that follow outside junctions, "" where a route ends.
    """

    lanes: Sequence[str]
    position_m: Float64Array
    next_edges: Sequence[str]


class LanesAhead:
    """The path of each of V vehicles of a running simulation over the next lanes.

    Attributes:
        next_edges: V ids of the edges outside junctions that follow the present lanes, "" where a route ends.
    """

    def __init__(self, names: Sequence[str], tracks: LaneTracks) -> None:
        """For vehicles with these SUMO names, on tracks that contain all their lanes."""
        self.next_edges = [""] * len(names)
        self._names = names
        self._removed: set[int] = set()
        self._tracks = tracks
        self._lanes = [""] * len(names)
        self._row = np.zeros((len(names), _MAX_LANES), np.int64)
        self._end_m = np.full((len(names), _MAX_LANES), np.inf)
        self._lanes_after: dict[str, tuple[str, ...]] = {}
        self._position_m, self._left_m = np.zeros((2, len(names)))
        self._steps = 0

    def observe(self, lanes: Sequence[str], position_m: Float64Array, left_m: Float64Array) -> None:
        """Take the next tick: V lanes, (V,) positions on them, and (V,) distances to the left of their center lines."""
        self._steps += 1
        self._position_m, self._left_m = position_m, left_m
        for vehicle, lane in enumerate(lanes):
            is_due = lane != self._lanes[vehicle] or (self._steps + vehicle) % _REFRESH_TICKS == 0
            if is_due and vehicle not in self._removed:
                self._update_lanes(vehicle, lane)

    def remove(self, vehicle: int) -> None:
        """Keep the path of a vehicle that has left the simulation."""
        self._removed.add(vehicle)

    def ahead_m(self, vehicle: Int64Array, distance_m: Float64Array, left_m: Float64Array) -> Float64Array:
        """(N, K, 3) positions of N fronts after (N, K) distances, (N, K) further left in their lanes than now."""
        path_position_m = self._position_m[vehicle, None] + distance_m
        end_m = self._end_m[vehicle]
        number = np.sum(path_position_m >= end_m.T[:-1, :, None], axis=0)
        before_m = np.concatenate([np.zeros((len(vehicle), 1)), end_m[:, :-1]], axis=1)
        path_position_m = path_position_m - np.take_along_axis(before_m, number, axis=1)
        row = np.take_along_axis(self._row[vehicle], number, axis=1)
        positions_m = self._tracks.positions_on_rows_m(
            row.ravel(), path_position_m.ravel(), (self._left_m[vehicle, None] + left_m).ravel()
        )
        return positions_m.reshape(*distance_m.shape, 3)

    def _update_lanes(self, vehicle: int, lane: str) -> None:
        """Store the lanes ahead of a vehicle."""
        self._lanes[vehicle] = lane
        lanes = [lane, *self._junction_lanes_after(lane)]
        for link in libsumo.vehicle.getNextLinks(self._names[vehicle]):
            if len(lanes) >= _MAX_LANES:
                break
            lanes += [link[4], *self._junction_lanes_after(link[4])] if link[4] else [link[0]]
        self.next_edges[vehicle] = next((each.rsplit("_", 1)[0] for each in lanes[1:] if not each.startswith(":")), "")
        known = lanes[
            : min(_MAX_LANES, next((k for k, each in enumerate(lanes) if each not in self._tracks), _MAX_LANES))
        ]
        row = self._tracks.rows(known)
        self._row[vehicle, : len(known)], self._row[vehicle, len(known) :] = row, row[-1]
        self._end_m[vehicle] = np.inf
        self._end_m[vehicle, : len(known) - 1] = np.cumsum(self._tracks.sumo_length_m(row))[:-1]

    def _junction_lanes_after(self, lane: str) -> tuple[str, ...]:
        """The lanes after one inside a junction, up to and including the first one behind the junction."""
        if lane not in self._lanes_after:
            lanes_after: tuple[str, ...] = ()
            if lane.startswith(":"):
                for following, _, _, _, via, *_ in libsumo.lane.getLinks(lane)[:1]:
                    lanes_after = (via, *self._junction_lanes_after(via)) if via else (following,)
            self._lanes_after[lane] = lanes_after
        return self._lanes_after[lane]
