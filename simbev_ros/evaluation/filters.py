"""Filters that decide which ground-truth boxes count in an evaluation.

A ``BoxFilter`` takes the columns of a box table and returns a mask of the boxes that must be found.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import DIFFICULTIES
from simbev_ros.foundation.types import BoolArray, Float64Array, Table

_Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class BoxFilter:
    """Conditions on boxes that must all hold; with the defaults every box counts.

    Each span includes its first value and excludes its second.

    Attributes:
        range_m: Span of the distance from the center of the ego's box.
        visibility: Span of the visible share, 0 … 1; a box that no camera sees has 0.
        difficulties: Allowed difficulties, out of ``DIFFICULTIES``.
        points: Span of the number of lidar and radar points together; a sensor that was not received counts as 0.
        seen: Whether a box counts only if a lidar or radar point is inside, or a camera sees a part of it.
    """

    range_m: _Span = (0.0, np.inf)
    visibility: _Span = (0.0, np.inf)
    difficulties: tuple[str, ...] = DIFFICULTIES
    points: _Span = (0, np.inf)
    seen: bool = False

    def __post_init__(self) -> None:
        """Raise InputError for conditions that no box can meet."""
        for name in ("range_m", "visibility", "points"):
            low, high = getattr(self, name)
            if not 0 <= low < high:
                raise InputError(f"{name}: {low:g} to {high:g}: the first must be at least 0, the second above it")
        if self.visibility[0] > 1:
            raise InputError(f"visibility: from {self.visibility[0]:g}: shares are 0 to 1")
        unknown = [name for name in self.difficulties if name not in DIFFICULTIES]
        if unknown or not self.difficulties:
            wrong = repr(unknown[0]) if unknown else "empty"
            raise InputError(f"difficulties: {wrong} is not allowed; allowed: {', '.join(DIFFICULTIES)}")

    def truth_mask(self, boxes: Table) -> BoolArray:
        """(N,) mask of the ``schema.boxes.BOX_DTYPE`` boxes that count."""
        points = np.maximum(boxes["lidar_points"], 0) + np.maximum(boxes["radar_points"], 0)
        visibility = np.nan_to_num(boxes["visibility"])
        difficulties = [DIFFICULTIES.index(name) for name in self.difficulties]
        return (
            self.range_mask(boxes["distance"].astype(np.float64))
            & _within(visibility, self.visibility)
            & np.isin(boxes["difficulty"], difficulties)
            & _within(points, self.points)
            & ((points > 0) | (visibility > 0.0) | (not self.seen))
        )

    def range_mask(self, distance_m: Float64Array) -> BoolArray:
        """(M,) mask of the predictions, at (M,) distances from the ego, that count as wrong if they match no box."""
        return _within(distance_m, self.range_m)


def _within(values: Float64Array, span: _Span) -> BoolArray:
    return (values >= span[0]) & (values < span[1])
