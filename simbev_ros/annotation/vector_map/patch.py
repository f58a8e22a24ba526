"""Lines in a rectangle around the ego: clipped exactly, from an index that is built once."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.scene.state import WorldState
from simbev_ros.types import BoolArray, Float64Array

Holds = Callable[[Float64Array], BoolArray]
"""(N,) whether what is at (N, 3) places of the map frame counts."""

_CHUNK = 16  # segments with common bounds
_STEP_M = 1.0  # so exactly lines end where they leave a level
_SHORTEST_M = 1e-9
_DECIMALS = 3


@dataclass(frozen=True, slots=True)
class Patch:
    """A level rectangle around the ego, that turns with its heading; roll and pitch do not tilt it.

    Attributes:
        origin_m: (3,) the ego's position, map frame: the origin of the patch frame (x ahead, y left, z up).
        yaw_rad: The ego's heading.
        length_m: Along x, half of it ahead.
        width_m: Along y.
    """

    origin_m: Float64Array
    yaw_rad: float
    length_m: float
    width_m: float

    @classmethod
    def around_ego(cls, state: WorldState, length_m: float, width_m: float) -> "Patch":
        """The patch of a state."""
        ego = state.ego
        return cls(np.array([ego["x"], ego["y"], ego["z"]], np.float64), float(ego["yaw"]), length_m, width_m)

    @property
    def half_m(self) -> Float64Array:
        """(2,) half length and half width."""
        return np.array([self.length_m, self.width_m]) / 2.0

    @property
    def bounds_m(self) -> tuple[Float64Array, Float64Array]:
        """(2,) lowest and (2,) highest x and y that it reaches, map frame."""
        cosine, sine = abs(np.cos(self.yaw_rad)), abs(np.sin(self.yaw_rad))
        reach_m = np.array([[cosine, sine], [sine, cosine]]) @ self.half_m
        return self.origin_m[:2] - reach_m, self.origin_m[:2] + reach_m

    def from_map(self, points_m: Float64Array) -> Float64Array:
        """(N, 3) points in the patch frame of (N, 3) points in the map frame."""
        cosine, sine = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        map_from_patch = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        points: Float64Array = (points_m - self.origin_m) @ map_from_patch
        return points


class _Pieces(NamedTuple):
    """(K,) stretches of lines: their first and last places, as parameters of ``Polylines``."""

    begin: Float64Array
    end: Float64Array


class PatchLines:
    """Polylines of a scene."""

    def __init__(
        self,
        lines_m: Sequence[Float64Array],
        guides_m: Sequence[Float64Array] | None = None,
        real: Sequence[BoolArray] | None = None,
    ) -> None:
        """Index lines.

        Args:
            lines_m: (N, 3) each, map frame.
            guides_m: (N, 3) each: where to ask whether a point on the line counts; None: there itself.
            real: (N - 1,) each, whether a segment belongs to its line; None: all do.
        """
        self._lines = Polylines.of(lines_m)
        self._guides_m = self._lines.points_m if guides_m is None else Polylines.of(guides_m).points_m
        begins = np.ones(len(self._lines.points_m), bool)
        begins[self._lines.first[1:] - 1] = False
        if real is not None:
            begins[begins] = np.concatenate([np.empty(0, bool), *real])
        self._segments = np.flatnonzero(begins)
        starts = np.arange(0, len(self._segments), _CHUNK)
        ends_m = np.stack([self._lines.points_m[self._segments + end, :2] for end in (0, 1)])
        low_m, high_m = ends_m.min(axis=0), ends_m.max(axis=0)
        self._low_m = np.minimum.reduceat(low_m, starts) if len(starts) else low_m
        self._high_m = np.maximum.reduceat(high_m, starts) if len(starts) else high_m

    def within(self, patch: Patch, holds: Holds | None) -> dict[int, list[Float64Array]]:
        """What of the lines is in a patch.

        Args:
            patch: Where; what lies on its border is inside.
            holds: What counts there; None: everything.

        Returns:
            Line → its pieces along it, (M, 3) each, patch frame; lines of which nothing is inside are left out.
        """
        pieces = self._clipped(patch)
        if holds is not None:
            pieces = self._holding(pieces, holds)
        return self._joined(pieces, patch)

    def _clipped(self, patch: Patch) -> _Pieces:
        """The part of each segment that is inside, by Liang and Barsky (1984)."""
        low_m, high_m = patch.bounds_m
        near = np.flatnonzero(((self._low_m <= high_m) & (self._high_m >= low_m)).all(axis=1))
        place = (near[:, None] * _CHUNK + np.arange(_CHUNK)).ravel()
        segment = self._segments[place[place < len(self._segments)]]
        start, stop = (patch.from_map(self._lines.points_m[segment + end])[:, :2] for end in (0, 1))
        step = stop - start
        flat = np.abs(step) < _SHORTEST_M
        per_step = 1.0 / np.where(flat, 1.0, step)
        one, other = (-patch.half_m - start) * per_step, (patch.half_m - start) * per_step
        outside = flat & (np.abs(start) > patch.half_m)
        enter = np.where(flat, np.where(outside, np.inf, 0.0), np.minimum(one, other)).max(axis=1)
        leave = np.where(flat, 1.0, np.maximum(one, other)).min(axis=1)
        enter, leave = np.maximum(enter, 0.0), np.minimum(leave, 1.0)
        inside = enter < leave
        return _Pieces(segment[inside] + enter[inside], segment[inside] + leave[inside])

    def _holding(self, pieces: _Pieces, holds: Holds) -> _Pieces:
        """The parts of pieces of segments that count, to the next metre."""
        ends_m = [self._lines.values(end)[:, :2] for end in pieces]
        count = np.maximum(np.ceil(np.linalg.norm(ends_m[1] - ends_m[0], axis=1) / _STEP_M), 1.0).astype(np.int64)
        row = np.repeat(np.arange(len(count)), count)
        number = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        step = ((pieces.end - pieces.begin) / count)[row]
        begin = pieces.begin[row] + number * step
        end = np.where(number == count[row] - 1, pieces.end[row], pieces.begin[row] + (number + 1) * step)
        held = holds(self._lines.values((begin + end) / 2.0, self._guides_m)) if len(row) else np.zeros(0, bool)
        return _Pieces(begin[held], end[held])

    def _joined(self, pieces: _Pieces, patch: Patch) -> dict[int, list[Float64Array]]:
        """Pieces that follow each other as one, with the points of the line between."""
        begin, end = pieces
        if not len(begin):
            return {}
        starts, stops = np.append(True, begin[1:] != end[:-1]), np.append(begin[1:] != end[:-1], True)
        corner = starts | (begin == np.floor(begin))
        chosen = np.column_stack([corner, stops])
        points = patch.from_map(self._lines.values(np.column_stack(pieces)[chosen]))
        run = np.repeat(np.cumsum(starts), 2)[chosen.ravel()]
        parts = np.split(points, np.flatnonzero(np.diff(run)) + 1)
        rows = self._lines.row[begin[starts].astype(np.int64)].tolist()
        found: dict[int, list[Float64Array]] = {}
        ends: dict[int, list[float]] = {}
        for row, part, *bounds in zip(rows, parts, begin[starts].tolist(), end[stops].tolist(), strict=True):
            found.setdefault(row, []).append(part)
            ends.setdefault(row, []).extend(bounds)
        for row, several in found.items():
            if len(several) > 1 and self._is_closed(row, ends[row][0], ends[row][-1]):
                head, *between, tail = several
                found[row] = [np.concatenate([tail, head[1:]]), *between]
        return found

    def _is_closed(self, row: int, begin: float, end: float) -> bool:
        """Whether a line ends where it begins, and these places are its ends."""
        first, last = self._lines.first[row], self._lines.first[row + 1] - 1
        points_m = self._lines.points_m
        return bool(begin == first and end == last and (points_m[first] == points_m[last]).all())


def plain_points(points_m: Float64Array) -> list[list[float]]:
    """Points for JSON, to the millimetre."""
    rounded: list[list[float]] = (np.round(points_m, _DECIMALS) + 0.0).tolist()  # never -0.0
    return rounded
