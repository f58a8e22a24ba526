"""Which boxes of the truth count, by what the dataset says of them."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.errors import InputError
from simbev_ros.semantics import DIFFICULTIES
from simbev_ros.types import BoolArray, Float64Array, Table

_Span = tuple[float, float]


@dataclass(frozen=True, slots=True)
class BoxFilter:
    """Conditions that must all hold; without any, all boxes count, as in the paper.

    Spans are from the first value on and below the second.

    Attributes:
        range_m: Of distances from the centre of the ego's box.
        visibility: Of visible shares, 0 … 1; those that no camera sees have 0.
        difficulties: Of ``DIFFICULTIES``.
        points: Of points of lidars and radars together; a sensor that was not received has none.
    """

    range_m: _Span = (0.0, np.inf)
    visibility: _Span = (0.0, np.inf)
    difficulties: tuple[str, ...] = DIFFICULTIES
    points: _Span = (0, np.inf)

    def __post_init__(self) -> None:
        """Raise InputError for what no box could pass."""
        for name in ("range_m", "visibility", "points"):
            low, high = getattr(self, name)
            if not 0 <= low < high:
                raise InputError(f"{name}: {low:g} to {high:g}: the first must be at least 0, the second above it")
        if self.visibility[0] > 1:
            raise InputError(f"visibility: from {self.visibility[0]:g}: shares are 0 to 1")
        strange = [name for name in self.difficulties if name not in DIFFICULTIES]
        if strange or not self.difficulties:
            wrong = repr(strange[0]) if strange else "empty"
            raise InputError(f"difficulties: {wrong} is not allowed; allowed: {', '.join(DIFFICULTIES)}")

    def of_truth(self, boxes: Table) -> BoolArray:
        """(N,) which of ``annotation.boxes.BOX_DTYPE`` boxes count."""
        points = np.maximum(boxes["lidar_points"], 0) + np.maximum(boxes["radar_points"], 0)
        difficulties = [DIFFICULTIES.index(name) for name in self.difficulties]
        chosen: BoolArray = (
            self.in_range(boxes["distance"].astype(np.float64))
            & _within(np.nan_to_num(boxes["visibility"]), self.visibility)
            & np.isin(boxes["difficulty"], difficulties)
            & _within(points, self.points)
        )
        return chosen

    def in_range(self, distance_m: Float64Array) -> BoolArray:
        """(M,) whether predictions at (M,) distances from the ego count where they find nothing."""
        return _within(distance_m, self.range_m)


def _within(values: Float64Array, span: _Span) -> BoolArray:
    within: BoolArray = (values >= span[0]) & (values < span[1])
    return within
