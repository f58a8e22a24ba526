"""Labels that are made only if they are asked for."""

from typing import Self

from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.geometry.voxel_grid import VoxelGrid

_MOST_VOXELS = 150_000_000
_WHOLE = 1e-6


class Occupancy(Model):
    """The voxels around the ego; they move, turn, pitch and roll with it."""

    half_side_m: float = Field(64.0, gt=0, le=512, description="how far it reaches ahead, back, left and right")
    bottom_m: float = Field(-1.0, ge=-50, le=50, description="height of its lowest corner above the ego's ground")
    top_m: float = Field(7.0, ge=-50, le=50)
    voxel_m: float = Field(0.4, ge=0.1, le=4)
    rate_hz: float | None = Field(2.0, gt=0, le=1000, description="a divisor of the ticks' rate; none: at every tick")
    ego: bool = Field(False, description="the ego's own voxels count too")

    @model_validator(mode="after")
    def _whole_voxels(self) -> Self:
        if self.top_m <= self.bottom_m:
            raise ValueError(f"top_m {self.top_m:g} is not above bottom_m {self.bottom_m:g}")
        extents_m = {"2 half_side_m": 2.0 * self.half_side_m, "top_m - bottom_m": self.top_m - self.bottom_m}
        for name, extent_m in extents_m.items():
            voxels = extent_m / self.voxel_m
            if abs(voxels - round(voxels)) > _WHOLE * voxels:
                raise ValueError(f"{name} {extent_m:g} is not a whole number of voxel_m {self.voxel_m:g}")
        columns, _, layers = self.grid.shape
        if columns**2 * layers > _MOST_VOXELS:
            raise ValueError(f"{columns} x {columns} x {layers} voxels; allowed are {_MOST_VOXELS:,} in all")
        return self

    @property
    def grid(self) -> VoxelGrid:
        """Its geometry."""
        side = round(2.0 * self.half_side_m / self.voxel_m)
        layers = round((self.top_m - self.bottom_m) / self.voxel_m)
        low_m = -self.half_side_m, -self.half_side_m, self.bottom_m
        return VoxelGrid(low_m, self.voxel_m, (side, side, layers))
