"""Bird's-eye-view grid around the ego: row 0 is the foremost, column 0 the leftmost."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import Float64Array


@dataclass(frozen=True, slots=True)
class BevGrid:
    """Grid of ``rows`` × ``columns`` square cells, centered on the ego, with its axes along the ego's x and y."""

    rows: int
    columns: int
    cell_m: float

    def cells_from_ego(self, points_ego: Float64Array) -> Float64Array:
        """(N, 2) continuous (row, column) of (N, ≥2) points in meters, ego frame; cell centers are at integers."""
        row = (self.rows - 1) / 2.0 - points_ego[:, 0] / self.cell_m
        column = (self.columns - 1) / 2.0 - points_ego[:, 1] / self.cell_m
        return np.stack([row, column], axis=1)

    def cells_from_map(self, ego_m: Float64Array, yaw_rad: float) -> Float64Array:
        """(2, 3) affine transform from (x, y, 1) in the map frame, meters, to the (row, column) of ``cells_from_ego``.

        Args:
            ego_m: (2,) position of the ego, map frame.
            yaw_rad: Heading of the ego; the grid stays level regardless of the ego's roll and pitch.
        """
        cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
        turn = -np.array([[cosine, sine], [-sine, cosine]]) / self.cell_m
        middle = np.array([self.rows - 1, self.columns - 1]) / 2.0
        return np.column_stack([turn, middle - turn @ ego_m])

    @property
    def centers_ego(self) -> Float64Array:
        """(rows, columns, 2) x and y of the cell centers, meters, ego frame."""
        x = ((self.rows - 1) / 2.0 - np.arange(self.rows)) * self.cell_m
        y = ((self.columns - 1) / 2.0 - np.arange(self.columns)) * self.cell_m
        return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
