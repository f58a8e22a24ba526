"""Square regions of a map, the unit in which its surroundings are built, stored and loaded.

Each region is built without knowledge of the others.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.roads.layout import Layout

REGION_M = 512.0
"""Side length of a region; a multiple of the side of a mesh tile."""

OUTSKIRTS_M = 110.0
"""Distance from roads up to which land belongs to a map."""

_HALF = 2**20  # no region is further from the origin


class Region(NamedTuple):
    """Grid square ``column`` to the east and ``row`` to the north of the map's origin."""

    column: int
    row: int

    @property
    def area(self) -> shapely.Polygon:
        """The square as a polygon in the map frame, meters."""
        x_m, y_m = self.column * REGION_M, self.row * REGION_M
        return shapely.box(x_m, y_m, x_m + REGION_M, y_m + REGION_M)


@dataclass(frozen=True, slots=True)
class Reach:
    """The circle of a map that an agent can see: (2,) center in the map frame, and radius."""

    center_m: tuple[float, float]
    radius_m: float

    def touches(self, low_m: Float64Array, side_m: float) -> BoolArray:
        """(N,) whether the circle touches each square, given (N, 2) south-western corners and the side length."""
        gap_m = np.clip(self.center_m, low_m, np.asarray(low_m) + side_m) - self.center_m
        return np.hypot(gap_m[:, 0], gap_m[:, 1]) <= self.radius_m


@dataclass(frozen=True, slots=True)
class Reaches:
    """The part of a map that several agents can see: the union of their circles."""

    circles: tuple[Reach, ...]

    def touches(self, low_m: Float64Array, side_m: float) -> BoolArray:
        """(N,) whether any circle touches each square. Arguments as for ``Reach.touches``."""
        touched: BoolArray = np.any([circle.touches(low_m, side_m) for circle in self.circles], axis=0)
        return touched


def regions_of(layout: Layout, reach: Reach | Reaches | None = None) -> tuple[Region, ...]:
    """Regions of a map with land near roads, from south-west to north-east; with ``reach``, only those within it."""
    positions_m = np.concatenate([np.empty((0, 2)), *(strip.left_m[:, :2] for strip in layout.strips)])
    corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1], [0, 0]]) * OUTSKIRTS_M
    columns, rows = (np.floor((positions_m[:, None] + corners).reshape(-1, 2) / REGION_M).astype(int) + _HALF).T
    squares = np.column_stack(np.divmod(np.unique(columns * 2 * _HALF + rows), 2 * _HALF)) - _HALF
    if reach is not None:
        squares = squares[reach.touches(squares * REGION_M, REGION_M)]
    return tuple(Region(column, row) for column, row in squares.tolist())
