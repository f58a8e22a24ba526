"""Height rasters, and a membrane interpolation that fills a raster from the nodes with known heights."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array

_MIN_SIDE = 4
_RELAXATION_STEPS = 6


@dataclass(frozen=True, slots=True)
class Raster:
    """Values at the nodes of a square lattice.

    Attributes:
        origin_m: (2,) position of node (0, 0), map frame.
        spacing_m: Distance between nodes.
        values: (I, J); the first index runs east, the second north.
    """

    origin_m: Float64Array
    spacing_m: float
    values: Float64Array

    def linear(self, xy_m: Float64Array) -> Float64Array:
        """(N,) values at (N, 2) positions, linear on the two triangles of each cell.

        The triangles meet on the cell's diagonal from south-west to north-east. Positions outside the raster are
        clamped to its border.
        """
        last = np.array(self.values.shape) - 1
        node = np.clip(self._node_coordinates(xy_m), 0.0, last)
        i, j = np.minimum(node.astype(np.int64), np.maximum(last - 1, 0)).T
        u, v = node[:, 0] - i, node[:, 1] - j
        east, north = np.minimum(i + 1, last[0]), np.minimum(j + 1, last[1])
        a, b, c, d = (self.values[k] for k in ((i, j), (east, j), (east, north), (i, north)))
        return a + np.where(u >= v, u * (b - a) + v * (c - b), v * (d - a) + u * (c - d))

    def smooth(self, xy_m: Float64Array) -> Float64Array:
        """(N,) values at (N, 2) positions of the cubic B-spline that has the raster's values as its coefficients.

        The spline is close to the values and twice differentiable.
        """
        from scipy.ndimage import map_coordinates  # takes long to load; most processes read ready-made land

        return map_coordinates(self.values, self._node_coordinates(xy_m).T, order=3, mode="nearest", prefilter=False)

    def refine(self, low_m: Float64Array, spacing_m: float, shape: Sequence[int]) -> Float64Array:
        """Evaluate ``smooth`` at ``shape`` nodes of a finer lattice with its first node at (2,) ``low_m``.

        Both lattices share nodes. A value does not depend on which other nodes are evaluated.
        """
        parts = round(self.spacing_m / spacing_m)
        first = np.round((low_m - self.origin_m) / spacing_m).astype(int)
        values = self.values
        for start, count in zip(first, shape, strict=True):  # each iteration swaps the axes
            index, part = np.divmod(start + np.arange(count), parts)
            weights = _spline(part / parts)
            rows = [values[np.clip(index + k, 0, len(values) - 1)] for k in (-1, 0, 1, 2)]
            values = sum(weight[:, None] * row for weight, row in zip(weights, rows, strict=True)).T
        return np.ascontiguousarray(values)

    def _node_coordinates(self, xy_m: Float64Array) -> Float64Array:
        return (np.asarray(xy_m, np.float64) - self.origin_m) / self.spacing_m


def node_positions_m(origin_m: Float64Array, spacing_m: float, shape: Sequence[int]) -> Float64Array:
    """(I, J, 2) positions of the nodes of a raster with ``shape`` (I, J)."""
    axes = [start + spacing_m * np.arange(count) for start, count in zip(origin_m, shape, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def membrane(values: Float64Array, known: BoolArray) -> Float64Array:
    """(I, J) raster that keeps the known values and interpolates the others like a membrane hung between them.

    Pull-push (Gortler et al. 1996): averages down to half the resolution recursively, then fills in on the way back,
    with a few relaxation steps at each scale. At least one value must be known.
    """
    if min(values.shape) <= _MIN_SIDE:
        filled = np.where(known, values, values[known].mean())
    else:
        pads = [(0, size % 2) for size in values.shape]
        weights = np.pad(known.astype(np.float64), pads)
        sums = np.pad(np.where(known, values, 0.0), pads)
        counts, sums = _block_sums(weights), _block_sums(sums)
        half = membrane(sums / np.maximum(counts, 1.0), counts > 0.0)
        finer = half.repeat(2, axis=0).repeat(2, axis=1)[: values.shape[0], : values.shape[1]]
        filled = np.where(known, values, finer)
    return relax(filled, ~known, _RELAXATION_STEPS)


def relax(values: Float64Array, free: BoolArray, steps: int) -> Float64Array:
    """Relax (I, J) values: set the free ones to the mean of their four neighbors, ``steps`` times; returns a copy."""
    around = np.pad(values, 1, mode="edge")
    inner = around[1:-1, 1:-1]
    for _ in range(steps):
        mean = around[:-2, 1:-1] + around[2:, 1:-1]
        mean += around[1:-1, :-2]
        mean += around[1:-1, 2:]
        mean /= 4.0
        np.copyto(inner, mean, where=free)
        around[0], around[-1] = around[1], around[-2]
        around[:, 0], around[:, -1] = around[:, 1], around[:, -2]
    return inner.copy()


def _spline(share: Float64Array) -> tuple[Float64Array, ...]:
    """Weights of a uniform cubic B-spline's four coefficients, at fractions between the second and the third."""
    rest = 1.0 - share
    return (
        rest**3 / 6.0,
        (4.0 - 6.0 * share**2 + 3.0 * share**3) / 6.0,
        (4.0 - 6.0 * rest**2 + 3.0 * rest**3) / 6.0,
        share**3 / 6.0,
    )


def _block_sums(values: Float64Array) -> Float64Array:
    """Sums of 2 × 2 blocks."""
    rows = values[0::2] + values[1::2]
    return rows[:, 0::2] + rows[:, 1::2]
