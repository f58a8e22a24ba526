"""What lies on the ground seen from above: labelled triangles in plan."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.annotation.raster import covered_cells
from simbev_ros.geometry.grid import BevGrid
from simbev_ros.scene.state import WorldState
from simbev_ros.types import BoolArray, Float64Array, Int32Array, Int64Array, UInt8Array


@dataclass(frozen=True, slots=True)
class Footprint:
    """(V, 2) points in metres, map frame, (T, 3) indices, and (T,) the plane that each triangle counts for."""

    points_m: Float64Array
    triangles: Int32Array
    planes: UInt8Array

    def covers(self, state: WorldState, grid: BevGrid, planes: int) -> BoolArray:
        """(planes, rows, columns) whether the centre of each cell around the ego lies in a triangle of the plane."""
        yaw_rad = float(state.ego["yaw"])
        cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
        map_from_heading = np.array([[cosine, -sine], [sine, cosine]])
        points_ego = (self.points_m - np.array([state.ego["x"], state.ego["y"]])) @ map_from_heading
        shape = planes, grid.rows, grid.columns
        return covered_cells(grid.cells_from_ego(points_ego), self.triangles, self.planes, shape)


def merged(footprints: Sequence[Footprint]) -> Footprint:
    """All triangles, in order."""
    starts: Int64Array = np.cumsum([0, *(len(each.points_m) for each in footprints)])
    return Footprint(
        np.concatenate([np.empty((0, 2)), *(each.points_m for each in footprints)]),
        np.concatenate(
            [
                np.empty((0, 3), np.int32),
                *(each.triangles + np.int32(start) for each, start in zip(footprints, starts, strict=False)),
            ]
        ),
        np.concatenate([np.empty(0, np.uint8), *(each.planes for each in footprints)]),
    )
