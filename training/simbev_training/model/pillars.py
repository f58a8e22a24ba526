"""Lidar branch: points become pillars, columns of 0.2 m x 0.2 m with statistics of their points, and these features.

As in PointPillars (https://arxiv.org/abs/1812.05784) a pillar has no division in height, so the rest of the network is
two-dimensional. Fixed statistics stand in for its learned point network: a CPU computes them in a few milliseconds, and
they do not depend on the order of the points.
"""

import torch
from torch import Tensor, nn

from simbev_ros.baselines.grid import FEATURE_CELLS, FEATURE_STRIDE, HALF_M
from simbev_training.model.blocks import conv_norm_relu

PATCH = 4
"""Pillars along each side of one cell of the features."""
PILLARS = FEATURE_CELLS * PATCH
"""Pillars along each side of the grid."""
BOTTOM_M, TOP_M = -4.0, 6.0
"""Points lower or higher are left out; heights count from the ego's origin on the ground."""
SLICES = 8
_SLICES_BOTTOM_M, _SLICE_M = -1.5, 0.6
_HEIGHT_SCALE_M = 2.0
_SUM_STEPS = 2000.0
"""Steps of a height in its unit, when heights are added up."""
_BIG = 100.0
"""Beyond all heights, in their unit."""
GROUPS = 4
"""Groups of sweeps whose points are put together: the three newest sweeps each, and all older ones."""
CHANNELS = 3 * GROUPS + 2 + SLICES
"""Statistics of a pillar: whether there are points, the lowest and the highest, for each group; logarithm of the number
of points, their mean height and whether there are points in each slice of height, for the newest sweep."""
_FINE_PATCH = PATCH // FEATURE_STRIDE


class PillarEncoder(nn.Module):
    """Features of a batch of clouds.

    Args:
        channels: Number of features of a cell of the feature grid.
        fine_channels: Number of features of a cell of the bird's-eye-view grid.
    """

    def __init__(self, channels: int, fine_channels: int) -> None:
        super().__init__()
        self.fine = conv_norm_relu(CHANNELS, fine_channels, _FINE_PATCH, _FINE_PATCH, padding=0)
        self.patches = conv_norm_relu(fine_channels, channels, FEATURE_STRIDE, FEATURE_STRIDE, padding=0)

    def forward(self, points: Tensor, sample: Tensor, samples: int) -> tuple[Tensor, Tensor]:
        """Features (B, C, FEATURE_CELLS, FEATURE_CELLS) and (B, C', CELLS, CELLS) of the points of B samples.

        Args:
            points: (N, 4) float32 x, y, z (m, level frame) and the index of the sweep, 0 the newest.
            sample: (N,) int64 index of each point's sample.
            samples: B.
        """
        fine = self.fine(pillar_statistics(points, sample, samples))
        return self.patches(fine), fine


def pillar_statistics(points: Tensor, sample: Tensor, samples: int) -> Tensor:
    """(B, CHANNELS, PILLARS, PILLARS) statistics of the points in each pillar; arguments as for ``PillarEncoder``."""
    x, y, z, sweep = points.unbind(1)
    row = torch.floor((HALF_M - x) * (PILLARS / (2 * HALF_M))).long()
    column = torch.floor((HALF_M - y) * (PILLARS / (2 * HALF_M))).long()
    inside = (row >= 0) & (row < PILLARS) & (column >= 0) & (column < PILLARS) & (z >= BOTTOM_M) & (z < TOP_M)
    is_newest = (inside & (sweep < 0.5)).float()
    # Points that do not count stay, with values that change nothing: shapes do not depend on the data, and on a GPU
    # they would wait for each other at a common place.
    area = PILLARS * PILLARS
    within = row.clamp(0, PILLARS - 1) * PILLARS + column.clamp(0, PILLARS - 1)
    height = z / _HEIGHT_SCALE_M
    # A new array is one element that is repeated: as a whole, ONNX files would hold it as a constant.
    one = points.new_zeros(1)
    group = sweep.long().clamp(0, GROUPS - 1)
    pillar = (sample * GROUPS + group) * area + within
    none = one.expand(samples * GROUPS * area)
    highest = (none - _BIG).scatter_reduce(0, pillar, torch.where(inside, height, -_BIG), "amax")
    lowest = (none + _BIG).scatter_reduce(0, pillar, torch.where(inside, height, _BIG), "amin")
    occupied = highest > -_BIG
    extent = [occupied.float(), torch.where(occupied, lowest, 0.0), torch.where(occupied, highest, 0.0)]
    pillar = sample * area + within
    none = one.expand(samples * area)
    count = none.scatter_add(0, pillar, is_newest)
    # A sum of integers does not depend on the order of the points, which is arbitrary on a GPU.
    total = none.int().scatter_add(0, pillar, torch.round(is_newest * height * _SUM_STEPS).int()).float() / _SUM_STEPS
    level = torch.floor((z - _SLICES_BOTTOM_M) / _SLICE_M).long().clamp(0, SLICES - 1)
    cell = (sample * SLICES + level) * area + within
    slices = one.expand(samples * SLICES * area).scatter_reduce(0, cell, is_newest, "amax")
    statistics = [*extent, torch.log1p(count), total / count.clamp(min=1), slices]
    return torch.cat([each.reshape(samples, -1, PILLARS, PILLARS) for each in statistics], 1)
