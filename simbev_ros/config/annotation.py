"""Section ``annotation``: which labels are produced, and their extents, resolutions and rates.

Occupancy and the vector map are off unless their section is given; ``{}`` gives their defaults.
"""

from typing import Literal, Self

from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.geometry.voxel_grid import VoxelGrid

_MAX_VOXELS = 150_000_000
_RELATIVE_TOLERANCE = 1e-6
_RATE = "rate of these labels, which must divide that of all labels or be a multiple of it; none: that of all labels"


class Bev(Model):
    """The bird's-eye-view grid."""

    rows: int = Field(360, ge=1, le=4096, description="number of rows along the ego's x axis; row 0 is ahead")
    columns: int = Field(360, ge=1, le=4096, description="number of columns along the ego's y axis; column 0 is left")
    cell_m: float = Field(0.4, gt=0, le=10, description="side length of a cell")
    road: Literal["exact", "paper"] = Field(
        "exact",
        exclude_if=lambda value: value == "exact",
        description="cells that are roads; exact: those on the surface of roads; paper: also those nearer the middle "
        "of a driving lane than its width, and gaps of one or two cells",
    )

    @property
    def grid(self) -> BevGrid:
        """Geometry of the grid."""
        return BevGrid(self.rows, self.columns, self.cell_m)


class Occupancy(Model):
    """The occupancy grid: voxels around the ego that move, turn, pitch and roll with it."""

    half_side_m: float = Field(64.0, gt=0, le=512, description="extent ahead, behind, left and right of the ego")
    bottom_m: float = Field(-1.0, ge=-50, le=50, description="height of the grid's bottom above the ground at the ego")
    top_m: float = Field(7.0, ge=-50, le=50, description="height of the grid's top above the ground at the ego")
    voxel_m: float = Field(0.4, ge=0.1, le=4, description="side length of a voxel")
    rate_hz: float | None = Field(2.0, gt=0, le=1000, description=_RATE)
    ego: bool = Field(False, description="whether voxels of the ego itself are included")

    @model_validator(mode="after")
    def _whole_voxels(self) -> Self:
        if self.top_m <= self.bottom_m:
            raise ValueError(f"top_m {self.top_m:g} is not above bottom_m {self.bottom_m:g}")
        extents_m = {"2 half_side_m": 2.0 * self.half_side_m, "top_m - bottom_m": self.top_m - self.bottom_m}
        for name, extent_m in extents_m.items():
            voxels = extent_m / self.voxel_m
            if abs(voxels - round(voxels)) > _RELATIVE_TOLERANCE * voxels:
                raise ValueError(f"{name} {extent_m:g} is not a whole number of voxel_m {self.voxel_m:g}")
        columns, _, layers = self.grid.shape
        if columns**2 * layers > _MAX_VOXELS:
            raise ValueError(f"{columns} x {columns} x {layers} voxels; allowed are {_MAX_VOXELS:,} in all")
        return self

    @property
    def grid(self) -> VoxelGrid:
        """Geometry of the voxel grid."""
        side = round(2.0 * self.half_side_m / self.voxel_m)
        layers = round((self.top_m - self.bottom_m) / self.voxel_m)
        low_m = -self.half_side_m, -self.half_side_m, self.bottom_m
        return VoxelGrid(low_m, self.voxel_m, (side, side, layers))


class VectorMapPatch(Model):
    """The vector map: roads around the ego as lines and outlines."""

    length_m: float = Field(60.0, gt=0, le=1000, description="length of the patch, half of it ahead of the ego")
    width_m: float = Field(30.0, gt=0, le=1000, description="width of the patch, half of it on each side of the ego")
    rate_hz: float | None = Field(None, gt=0, le=1000, description=_RATE)


class Annotation(Model):
    """Labels that are produced: boxes, the bird's-eye view, occupancy and the vector map."""

    rate_hz: float | None = Field(
        None,
        gt=0,
        le=1000,
        exclude_if=lambda value: value is None,
        description="rate of all labels, which must divide the tick rate; none: every tick. Motion follows from every "
        "tick, so the labels of a tick do not depend on it",
    )
    box_radius_m: float = Field(120.0, gt=0, le=1000, description="maximum distance of labeled boxes from the ego")
    views: bool = Field(True, description="whether cameras with instance images get 2D boxes and visibility")
    bev: Bev = Bev()
    occupancy: Occupancy | None = None
    vector_map: VectorMapPatch | None = None
