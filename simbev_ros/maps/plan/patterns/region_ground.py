"""The ground of a region: maps lattice points to map positions by a warp, and draws a river and lakes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.curves import resample, round_corners
from simbev_ros.maps.plan.patterns.street_lattice import FINE
from simbev_ros.maps.plan.patterns.warp import draw_warp

_RIVER_RADIUS_M = 60.0


@dataclass(frozen=True, slots=True)
class Ground:
    """Map positions of lattice points: grid lines at (cells + 1,) coordinates along each axis, then a warp.

    Attributes:
        column_m: (cells + 1,) x of the cells' borders.
        row_m: (cells + 1,) y of the cells' borders.
        sweep: The long-wave part of the warp, for motorways.
        bend: The whole warp.
    """

    column_m: Float64Array
    row_m: Float64Array
    sweep: Callable[[Float64Array], Float64Array]
    bend: Callable[[Float64Array], Float64Array]

    def before_warp(self, lattice_points: Float64Array) -> Float64Array:
        """(N, 2) positions of (N, 2) lattice points before the warp."""
        cells_from_origin = np.asarray(lattice_points, np.float64) / FINE
        return np.column_stack(
            [_interpolate(self.column_m, cells_from_origin[:, 0]), _interpolate(self.row_m, cells_from_origin[:, 1])]
        )

    def line(self, lattice_points: Float64Array, radius_m: float) -> Float64Array:
        """(N, 2) line on the map along lattice points, with rounded corners."""
        return self.bend(resample(round_corners(self.before_warp(lattice_points), radius_m), 10.0))

    def area(self, lattice_points: Float64Array) -> shapely.Polygon:
        """The area on the map within a polygon of lattice points."""
        outline = shapely.segmentize(shapely.Polygon(self.before_warp(lattice_points)), 60.0)
        return shapely.transform(outline, self.bend)


def _interpolate(lines_m: Float64Array, cells_from_origin: Float64Array) -> Float64Array:
    """Interpolate between grid lines, and extrapolate up to one cell beyond the outermost ones."""
    padded_m = np.concatenate([2.0 * lines_m[:1] - lines_m[1:2], lines_m, 2.0 * lines_m[-1:] - lines_m[-2:-1]])
    return np.asarray(np.interp(cells_from_origin, np.arange(-1, len(lines_m) + 1), padded_m))


def draw_ground(size_m: float, cells: int, bend_m: float, rng: np.random.Generator) -> Ground:
    """Draw a square region's ground: cells grow, and streets bend more, with the distance from the center."""
    edge_distance = np.abs(np.arange(cells) + 0.5 - cells / 2.0) / (cells / 2.0)
    lines = []
    for _ in range(2):
        widths = (1.0 + 0.35 * edge_distance) * rng.uniform(0.88, 1.12, cells)
        lines.append((np.concatenate([[0.0], np.cumsum(widths)]) / np.sum(widths) - 0.5) * size_m)
    wide = draw_warp(rng, bend_m, 0.3 * size_m)
    medium, narrow = draw_warp(rng, 85.0, 1500.0), draw_warp(rng, 14.0, 480.0)

    def bend(points_m: Float64Array) -> Float64Array:
        outside = np.clip(np.linalg.norm(points_m, axis=1) / (0.13 * size_m) - 1.0, 0.0, 1.0)[:, None]
        return wide(points_m + outside * (narrow(medium(points_m)) - points_m))

    return Ground(lines[0], lines[1], wide, bend)


def draw_river(ground: Ground, width_m: float, rng: np.random.Generator) -> shapely.Polygon:
    """Draw a river that winds from west to east beside the region's center."""
    cells = len(ground.column_m) - 1
    row = (cells // 2 + int(rng.choice([-2, 1])) + 0.5) * FINE
    column = np.linspace(-0.2 * FINE, (cells + 0.2) * FINE, 12 * cells)
    swing = 1.6 * np.sin(column / FINE * 2.3 + rng.uniform(0.0, 6.0)) + 0.8 * np.sin(column / FINE * 5.1)
    course = shapely.LineString(ground.line(np.column_stack([column, row + swing]), _RIVER_RADIUS_M))
    return shapely.simplify(course.buffer(width_m / 2.0, cap_style="flat"), 0.3)


def draw_lake(ground: Ground, cell: tuple[int, int], rng: np.random.Generator) -> shapely.Polygon:
    """Draw a lake in the middle of a cell."""
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    radius = np.full(len(angle), rng.uniform(1.2, 2.2))
    for waves in (2, 3, 4):
        radius *= 1.0 + rng.uniform(0.0, 0.25 / waves) * np.sin(waves * angle + rng.uniform(0.0, 6.0))
    shore = np.column_stack([np.cos(angle), np.sin(angle)]) * radius[:, None]
    return ground.area((np.array(cell) + 0.5) * FINE + shore)
