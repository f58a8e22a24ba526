"""The ground of a region: where its lattice lies on the map, and the water on it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.maps.plan.curves import resampled, rounded
from simbev_ros.maps.plan.patterns.street_lattice import FINE
from simbev_ros.maps.plan.patterns.warp import draw_warp
from simbev_ros.types import Float64Array

_RIVER_RADIUS_M = 60.0


@dataclass(frozen=True, slots=True)
class Ground:
    """Where lattice points lie on the map: lines at (cells + 1,) places along each axis, then warped.

    Attributes:
        column_m: (cells + 1,) x of the cells' borders.
        row_m: (cells + 1,) y.
        sweep: The wide part of the warp, for motorways.
        bend: The whole warp.
    """

    column_m: Float64Array
    row_m: Float64Array
    sweep: Callable[[Float64Array], Float64Array]
    bend: Callable[[Float64Array], Float64Array]

    def straight(self, lattice_points: Float64Array) -> Float64Array:
        """(N, 2) places before the warp of (N, 2) lattice points."""
        at = np.asarray(lattice_points, np.float64) / FINE
        return np.column_stack([_along(self.column_m, at[:, 0]), _along(self.row_m, at[:, 1])])

    def line(self, lattice_points: Float64Array, radius_m: float) -> Float64Array:
        """(N, 2) line on the map along lattice points, its corners rounded."""
        return self.bend(resampled(rounded(self.straight(lattice_points), radius_m), 10.0))

    def area(self, lattice_points: Float64Array) -> shapely.Polygon:
        """The area on the map within a polygon of lattice points."""
        outline = shapely.segmentize(shapely.Polygon(self.straight(lattice_points)), 60.0)
        return shapely.transform(outline, self.bend)


def _along(lines_m: Float64Array, at: Float64Array) -> Float64Array:
    """Places between lines, and up to one cell beyond the outermost ones."""
    padded_m = np.concatenate([2.0 * lines_m[:1] - lines_m[1:2], lines_m, 2.0 * lines_m[-1:] - lines_m[-2:-1]])
    return np.asarray(np.interp(at, np.arange(-1, len(lines_m) + 1), padded_m))


def draw_ground(size_m: float, cells: int, bend_m: float, rng: np.random.Generator) -> Ground:
    """A square region's ground: cells are larger far from the middle; streets of the middle stay nearly straight."""
    far = np.abs(np.arange(cells) + 0.5 - cells / 2.0) / (cells / 2.0)
    lines = []
    for _ in range(2):
        widths = (1.0 + 0.35 * far) * rng.uniform(0.88, 1.12, cells)
        lines.append((np.concatenate([[0.0], np.cumsum(widths)]) / np.sum(widths) - 0.5) * size_m)
    wide = draw_warp(rng, bend_m, 0.3 * size_m)
    middling, narrow = draw_warp(rng, 85.0, 1500.0), draw_warp(rng, 14.0, 480.0)

    def bend(points_m: Float64Array) -> Float64Array:
        outside = np.clip(np.linalg.norm(points_m, axis=1) / (0.13 * size_m) - 1.0, 0.0, 1.0)[:, None]
        return wide(points_m + outside * (narrow(middling(points_m)) - points_m))

    return Ground(lines[0], lines[1], wide, bend)


def draw_river(ground: Ground, width_m: float, rng: np.random.Generator) -> shapely.Polygon:
    """A river that winds from west to east beside the region's middle."""
    cells = len(ground.column_m) - 1
    row = (cells // 2 + int(rng.choice([-2, 1])) + 0.5) * FINE
    column = np.linspace(-0.2 * FINE, (cells + 0.2) * FINE, 12 * cells)
    swing = 1.6 * np.sin(column / FINE * 2.3 + rng.uniform(0.0, 6.0)) + 0.8 * np.sin(column / FINE * 5.1)
    course = shapely.LineString(ground.line(np.column_stack([column, row + swing]), _RIVER_RADIUS_M))
    return shapely.simplify(course.buffer(width_m / 2.0, cap_style="flat"), 0.3)


def draw_lake(ground: Ground, cell: tuple[int, int], rng: np.random.Generator) -> shapely.Polygon:
    """A lake in the middle of a cell."""
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    radius = np.full(len(angle), rng.uniform(1.2, 2.2))
    for waves in (2, 3, 4):
        radius *= 1.0 + rng.uniform(0.0, 0.25 / waves) * np.sin(waves * angle + rng.uniform(0.0, 6.0))
    shore = np.column_stack([np.cos(angle), np.sin(angle)]) * radius[:, None]
    return ground.area((np.array(cell) + 0.5) * FINE + shore)
