"""Regions: squares that a map's surroundings are built, stored and loaded by, each without knowledge of the others."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely

from simbev_ros.maps.roads.layout import Layout
from simbev_ros.types import BoolArray, Float64Array

REGION_M = 512.0
"""Side of a region; a whole number of mesh tiles."""

OUTSKIRTS_M = 110.0
"""So far from roads land still belongs to a map."""


class Region(NamedTuple):
    """Square number ``column`` from the map's origin to the east and ``row`` to the north."""

    column: int
    row: int

    @property
    def area(self) -> shapely.Polygon:
        """The square in the map frame, metres."""
        x_m, y_m = self.column * REGION_M, self.row * REGION_M
        return shapely.box(x_m, y_m, x_m + REGION_M, y_m + REGION_M)


@dataclass(frozen=True, slots=True)
class Reach:
    """The circle of a map that a scene can see: (2,) centre in the map frame, and radius."""

    center_m: tuple[float, float]
    radius_m: float

    def touches(self, low_m: Float64Array, side_m: float) -> BoolArray:
        """(N,) which squares it touches, of (N, 2) south-western corners and a side."""
        gap_m = np.clip(self.center_m, low_m, np.asarray(low_m) + side_m) - self.center_m
        touched: BoolArray = np.hypot(gap_m[:, 0], gap_m[:, 1]) <= self.radius_m
        return touched


def regions_of(layout: Layout, reach: Reach | None = None) -> tuple[Region, ...]:
    """Regions of a map that has land near roads in them, from south-west to north-east; those in reach, if given."""
    places_m = np.concatenate([np.empty((0, 2)), *(strip.left_m[:, :2] for strip in layout.strips)])
    corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1], [0, 0]]) * OUTSKIRTS_M
    squares = np.unique(np.floor((places_m[:, None] + corners).reshape(-1, 2) / REGION_M).astype(int), axis=0)
    if reach is not None:
        squares = squares[reach.touches(squares * REGION_M, REGION_M)]
    return tuple(Region(column, row) for column, row in squares.tolist())
