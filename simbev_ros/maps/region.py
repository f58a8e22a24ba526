"""Regions: squares that a map's surroundings are built, stored and loaded by, each without knowledge of the others."""

import math
from typing import NamedTuple

import shapely

from simbev_ros.types import Float64Array

REGION_M = 512.0
"""Side of a region; a whole number of mesh tiles."""


class Region(NamedTuple):
    """Square number ``column`` from the map's origin to the east and ``row`` to the north."""

    column: int
    row: int

    @property
    def area(self) -> shapely.Polygon:
        """The square in the map frame, metres."""
        x_m, y_m = self.column * REGION_M, self.row * REGION_M
        return shapely.box(x_m, y_m, x_m + REGION_M, y_m + REGION_M)


def regions_within(bounds_m: Float64Array) -> tuple[Region, ...]:
    """Regions that touch (4,) bounds x0, y0, x1, y1, from south-west to north-east."""
    low_x, low_y, high_x, high_y = (math.floor(value / REGION_M) for value in bounds_m)
    return tuple(Region(column, row) for column in range(low_x, high_x + 1) for row in range(low_y, high_y + 1))
