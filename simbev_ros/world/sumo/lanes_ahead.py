"""The lanes ahead of SUMO's vehicles, as far as these get in a few seconds."""

from collections.abc import Sequence

import numpy as np

from simbev_ros.types import Float64Array, Int64Array
from simbev_ros.world.sumo.libsumo_import import libsumo
from simbev_ros.world.sumo.tracks import Tracks

_LANES = 7  # of the way of one vehicle; it ends there
_STALE_TICKS = 100  # which lane of an edge a vehicle will take may change without its leaving its own


class TrafficWays:
    """Where each of V vehicles of a running simulation goes next."""

    def __init__(self, names: Sequence[str], tracks: Tracks) -> None:
        """For vehicles of these names, on tracks that hold all their lanes."""
        self._names = names
        self._tracks = tracks
        self._lanes = [""] * len(names)
        self._row = np.zeros((len(names), _LANES), np.int64)
        self._end_m = np.full((len(names), _LANES), np.inf)
        self._onward: dict[str, tuple[str, ...]] = {}
        self._position_m, self._left_m = np.zeros((2, len(names)))
        self._steps = 0

    def advance(self, lanes: Sequence[str], position_m: Float64Array, left_m: Float64Array) -> None:
        """Take the next tick's V lanes, (V,) positions on them and (V,) distances to the left of their middles."""
        self._steps += 1
        self._position_m, self._left_m = position_m, left_m
        for vehicle, lane in enumerate(lanes):
            if lane != self._lanes[vehicle] or (self._steps + vehicle) % _STALE_TICKS == 0:
                self._note(vehicle, lane)

    def ahead_m(self, vehicle: Int64Array, way_m: Float64Array, left_m: Float64Array) -> Float64Array:
        """(N, K, 3) places of N vehicles' fronts after (N, K) ways on, and (N, K) farther to the left than now."""
        at_m = self._position_m[vehicle, None] + way_m
        end_m = self._end_m[vehicle]
        number = np.sum(at_m[..., None] >= end_m[:, None, :-1], axis=-1)
        before_m = np.concatenate([np.zeros((len(vehicle), 1)), end_m[:, :-1]], axis=1)
        at_m = at_m - np.take_along_axis(before_m, number, axis=1)
        row = np.take_along_axis(self._row[vehicle], number, axis=1)
        places_m = self._tracks.places_on_m(row.ravel(), at_m.ravel(), (self._left_m[vehicle, None] + left_m).ravel())
        return places_m.reshape(*way_m.shape, 3)

    def _note(self, vehicle: int, lane: str) -> None:
        """Note down the lanes ahead of a vehicle."""
        self._lanes[vehicle] = lane
        lanes = [lane, *self._inside(lane)]
        for link in libsumo.vehicle.getNextLinks(self._names[vehicle]):
            if len(lanes) >= _LANES:
                break
            lanes += [link[4], *self._inside(link[4])] if link[4] else [link[0]]
        known = lanes[: min(_LANES, next((k for k, each in enumerate(lanes) if each not in self._tracks), _LANES))]
        row = self._tracks.rows(known)
        self._row[vehicle, : len(known)], self._row[vehicle, len(known) :] = row, row[-1]
        self._end_m[vehicle] = np.inf
        self._end_m[vehicle, : len(known) - 1] = np.cumsum(self._tracks.sumo_length_m(row))[:-1]

    def _inside(self, lane: str) -> tuple[str, ...]:
        """The lanes after one inside of a junction, to the first one behind it."""
        if lane not in self._onward:
            onward: tuple[str, ...] = ()
            if lane.startswith(":"):
                for following, _, _, _, via, *_ in libsumo.lane.getLinks(lane)[:1]:
                    onward = (via, *self._inside(via)) if via else (following,)
            self._onward[lane] = onward
        return self._onward[lane]
