"""Clips polylines exactly to a rectangle around the ego, using a spatial index that is built once per scene.

Polylines in the map frame enter at construction; ``PatchLines.within`` returns their pieces in the patch frame.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.schema.scene.state import WorldState

LevelFilter = Callable[[Float64Array], BoolArray]
"""(N,) bool: whether objects at (N, 3) positions in the map frame count, that is, are on the ego's level."""

_CHUNK = 16  # number of segments that share bounds
_STEP_M = 1.0  # accuracy to which lines end where they leave a level
_MIN_STEP_M = 1e-9
_DECIMALS = 3


@dataclass(frozen=True, slots=True)
class Patch:
    """A horizontal rectangle around the ego that turns with its heading; roll and pitch do not tilt it.

    Attributes:
        origin_m: (3,) the ego's position, map frame: the origin of the patch frame (x ahead, y left, z up).
        yaw_rad: The ego's heading.
        length_m: Size along x, half of it ahead of the ego.
        width_m: Size along y.
    """

    origin_m: Float64Array
    yaw_rad: float
    length_m: float
    width_m: float

    @classmethod
    def around_ego(cls, state: WorldState, length_m: float, width_m: float) -> "Patch":
        """The patch around the ego of a state."""
        ego = state.ego
        return cls(np.array([ego["x"], ego["y"], ego["z"]], np.float64), float(ego["yaw"]), length_m, width_m)

    @property
    def half_m(self) -> Float64Array:
        """(2,) half length and half width."""
        return np.array([self.length_m, self.width_m]) / 2.0

    @property
    def bounds_m(self) -> tuple[Float64Array, Float64Array]:
        """(2,) minimum and (2,) maximum x and y of the patch, map frame."""
        cosine, sine = abs(np.cos(self.yaw_rad)), abs(np.sin(self.yaw_rad))
        reach_m = np.array([[cosine, sine], [sine, cosine]]) @ self.half_m
        return self.origin_m[:2] - reach_m, self.origin_m[:2] + reach_m

    def from_map(self, points_m: Float64Array) -> Float64Array:
        """(N, 3) points in the patch frame of (N, 3) points in the map frame."""
        cosine, sine = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        map_from_patch = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return (points_m - self.origin_m) @ map_from_patch


class _Pieces(NamedTuple):
    """(K,) pieces of lines: their begin and end as parameters of ``Polylines``."""

    begin: Float64Array
    end: Float64Array


class PatchLines:
    """Indexed polylines of a scene that can be clipped to patches."""

    def __init__(
        self,
        lines_m: Sequence[Float64Array],
        guides_m: Sequence[Float64Array] | None = None,
        real: Sequence[BoolArray] | None = None,
    ) -> None:
        """Index lines.

        Args:
            lines_m: (N, 3) each, map frame.
            guides_m: (N, 3) each: positions that decide whether the line's points count; None: the points themselves.
            real: (N - 1,) each, whether a segment belongs to its line; None: all do.
        """
        self._lines = Polylines.from_lines(lines_m)
        self._guides_m = self._lines.points_m if guides_m is None else Polylines.from_lines(guides_m).points_m
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

    def within(self, patch: Patch, level_filter: LevelFilter | None) -> dict[int, list[Float64Array]]:
        """The pieces of lines inside a patch.

        Args:
            patch: The patch; its border is inside.
            level_filter: Which positions count; None: all.

        Returns:
            Line index → its pieces, in the line's direction, (M, 3) each, patch frame; lines without pieces are left
            out.
        """
        pieces = self._clip_to_patch(patch)
        if level_filter is not None:
            pieces = self._filter_by_level(pieces, level_filter)
        return self._join_pieces(pieces, patch)

    def _clip_to_patch(self, patch: Patch) -> _Pieces:
        """The part of each segment that is inside the patch, by Liang and Barsky (1984)."""
        low_m, high_m = patch.bounds_m
        near = np.flatnonzero(((self._low_m <= high_m) & (self._high_m >= low_m)).all(axis=1))
        index = (near[:, None] * _CHUNK + np.arange(_CHUNK)).ravel()
        segment = self._segments[index[index < len(self._segments)]]
        start, stop = (patch.from_map(self._lines.points_m[segment + end])[:, :2] for end in (0, 1))
        step = stop - start
        flat = np.abs(step) < _MIN_STEP_M
        per_step = 1.0 / np.where(flat, 1.0, step)
        low_crossing, high_crossing = (-patch.half_m - start) * per_step, (patch.half_m - start) * per_step
        outside = flat & (np.abs(start) > patch.half_m)
        enter = np.where(flat, np.where(outside, np.inf, 0.0), np.minimum(low_crossing, high_crossing)).max(axis=1)
        leave = np.where(flat, 1.0, np.maximum(low_crossing, high_crossing)).min(axis=1)
        enter, leave = np.maximum(enter, 0.0), np.minimum(leave, 1.0)
        inside = enter < leave
        return _Pieces(segment[inside] + enter[inside], segment[inside] + leave[inside])

    def _filter_by_level(self, pieces: _Pieces, level_filter: LevelFilter) -> _Pieces:
        """The parts of pieces that count, to within a meter."""
        ends_m = [self._lines.values(end)[:, :2] for end in pieces]
        count = np.maximum(np.ceil(np.linalg.norm(ends_m[1] - ends_m[0], axis=1) / _STEP_M), 1.0).astype(np.int64)
        row, index = ragged_indices(count)
        step = ((pieces.end - pieces.begin) / count)[row]
        begin = pieces.begin[row] + index * step
        end = np.where(index == count[row] - 1, pieces.end[row], pieces.begin[row] + (index + 1) * step)
        kept = level_filter(self._lines.values((begin + end) / 2.0, self._guides_m)) if len(row) else np.zeros(0, bool)
        return _Pieces(begin[kept], end[kept])

    def _join_pieces(self, pieces: _Pieces, patch: Patch) -> dict[int, list[Float64Array]]:
        """Join consecutive pieces, with the points of the line between them."""
        begin, end = pieces
        if not len(begin):
            return {}
        is_start, is_stop = np.append(True, begin[1:] != end[:-1]), np.append(begin[1:] != end[:-1], True)
        corner = is_start | (begin == np.floor(begin))
        selected = np.column_stack([corner, is_stop])
        points = patch.from_map(self._lines.values(np.column_stack(pieces)[selected]))
        run = np.repeat(np.cumsum(is_start), 2)[selected.ravel()]
        parts = np.split(points, np.flatnonzero(np.diff(run)) + 1)
        rows = self._lines.row[begin[is_start].astype(np.int64)].tolist()
        joined: dict[int, list[Float64Array]] = {}
        ends: dict[int, list[float]] = {}
        for row, part, *bounds in zip(rows, parts, begin[is_start].tolist(), end[is_stop].tolist(), strict=True):
            joined.setdefault(row, []).append(part)
            ends.setdefault(row, []).extend(bounds)
        for row, parts in joined.items():
            if len(parts) > 1 and self._is_closed(row, ends[row][0], ends[row][-1]):
                head, *between, tail = parts
                joined[row] = [np.concatenate([tail, head[1:]]), *between]
        return joined

    def _is_closed(self, row: int, begin: float, end: float) -> bool:
        """Whether a line is closed and the given parameters are its two ends."""
        first, last = self._lines.first[row], self._lines.first[row + 1] - 1
        points_m = self._lines.points_m
        return bool(begin == first and end == last and (points_m[first] == points_m[last]).all())


def plain_points(points_m: Float64Array) -> list[list[float]]:
    """Points as plain lists for JSON, rounded to the millimeter."""
    return (np.round(points_m, _DECIMALS) + 0.0).tolist()  # never -0.0
