"""Turns a grid around the ego so that its axes are those of the map: Nav2 reads no other. Pure: imports no ROS."""

import math
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array

FREE, OCCUPIED = 0, 100
"""Values of cells in nav_msgs/OccupancyGrid."""


@dataclass(frozen=True, slots=True)
class LevelGrid:
    """Cells on level ground.

    Attributes:
        cells: (height, width); columns run along x of the grid, rows along y, as in nav_msgs/OccupancyGrid.
        cell_m: Length of a cell's side.
        map_from_grid: (4, 4) pose of the outer corner of cell (0, 0).
    """

    cells: BoolArray
    cell_m: float
    map_from_grid: Float64Array


def align(grid: LevelGrid) -> LevelGrid:
    """Sample a grid at the centers of cells along the axes of the map.

    The result has the grid's center and the largest square around it that is inside at every heading; its corner is at
    a multiple of the cell's side, so that maps of successive poses have the same cells.
    """
    height, width = grid.cells.shape
    cell_m = grid.cell_m
    center_m = (grid.map_from_grid @ [width * cell_m / 2.0, height * cell_m / 2.0, 0.0, 1.0])[:3]
    count = max(1, math.floor(min(height, width) / math.sqrt(2.0)) - 1)
    corner_m = np.floor((center_m[:2] - count * cell_m / 2.0) / cell_m) * cell_m
    along_m = (np.arange(count) + 0.5) * cell_m
    x, y = np.meshgrid(corner_m[0] + along_m, corner_m[1] + along_m)
    offset_m = np.stack([x - center_m[0], y - center_m[1]], axis=-1)
    forward = grid.map_from_grid[:2, 0] / np.linalg.norm(grid.map_from_grid[:2, 0])
    left = np.array([-forward[1], forward[0]])
    columns = np.floor(offset_m @ forward / cell_m + width / 2.0).astype(np.int64)
    rows = np.floor(offset_m @ left / cell_m + height / 2.0).astype(np.int64)
    map_from_aligned = np.eye(4)
    map_from_aligned[:3, 3] = *corner_m, center_m[2]
    return LevelGrid(grid.cells[rows, columns], cell_m, map_from_aligned)
