"""Which boxes of the truth count, by what the dataset says of them."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.errors import InputError
from simbev_ros.semantics import DIFFICULTIES
from simbev_ros.types import BoolArray, Float64Array, Table


@dataclass(frozen=True, slots=True)
class BoxFilter:
    """Conditions that must all hold; without any, all boxes count, as in the paper.

    Attributes:
        range_m: Distance from the ego's box's centre: from the first on, below the second.
        least_visibility: Smallest visible share; above 0, boxes that no camera sees do not count.
        difficulties: Of ``DIFFICULTIES``.
        least_points: Fewest points of lidars and radars together; a sensor that was not received has none.
    """

    range_m: tuple[float, float] = (0.0, np.inf)
    least_visibility: float = 0.0
    difficulties: tuple[str, ...] = DIFFICULTIES
    least_points: int = 0

    def __post_init__(self) -> None:
        """Raise InputError for what no box could pass."""
        near_m, far_m = self.range_m
        if not 0 <= near_m < far_m:
            raise InputError(f"filter: range_m: is {self.range_m}; the first must be at least 0, the second above it")
        if not 0 <= self.least_visibility <= 1:
            raise InputError(f"filter: least_visibility: is {self.least_visibility}; allowed: 0 to 1")
        strange = [name for name in self.difficulties if name not in DIFFICULTIES]
        if strange or not self.difficulties:
            raise InputError(f"filter: difficulties: are {self.difficulties}; allowed: {', '.join(DIFFICULTIES)}")

    def of_truth(self, boxes: Table) -> BoolArray:
        """(N,) which of ``annotation.boxes.BOX_DTYPE`` boxes count."""
        chosen: BoolArray = self.in_range(boxes["distance"].astype(np.float64))
        if self.least_visibility > 0:
            chosen &= np.nan_to_num(boxes["visibility"]) >= self.least_visibility
        chosen &= np.isin(boxes["difficulty"], [DIFFICULTIES.index(name) for name in self.difficulties])
        points = np.maximum(boxes["lidar_points"], 0) + np.maximum(boxes["radar_points"], 0)
        chosen &= points >= self.least_points
        return chosen

    def in_range(self, distance_m: Float64Array) -> BoolArray:
        """(M,) whether predictions at (M,) distances from the ego count where they find nothing."""
        near_m, far_m = self.range_m
        return (distance_m >= near_m) & (distance_m < far_m)
