"""Lidar branch: points become pillars, columns of 0.2 m x 0.2 m with statistics of their points, and these features.

As in PointPillars (https://arxiv.org/abs/1812.05784) a pillar has no division in height, so the rest of the network is
two-dimensional. Fixed statistics stand in for its learned point network: a CPU computes them in a few milliseconds, and
they do not depend on the order of the points.
"""

import torch
from torch import Tensor, nn

from simbev_ros.baselines.frames import SWEEPS
from simbev_ros.baselines.grid import FEATURE_CELLS, HALF_M

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
CHANNELS = 5 + SLICES + 3 * (SWEEPS - 1)
"""Statistics of a pillar: all of them for the newest sweep; whether there are points, lowest and highest for others."""


class PillarEncoder(nn.Module):
    """Features of a batch of clouds.

    Args:
        channels: Number of features of a cell.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.patches = nn.Sequential(
            nn.Conv2d(CHANNELS, channels, PATCH, PATCH, bias=False), nn.BatchNorm2d(channels), nn.ReLU(inplace=True)
        )

    def forward(self, points: Tensor, sample: Tensor, samples: int) -> Tensor:
        """Features (B, C, FEATURE_CELLS, FEATURE_CELLS) of the points of B samples.

        Args:
            points: (N, 4) float32 x, y, z (m, level frame) and the index of the sweep, 0 the newest.
            sample: (N,) int64 index of each point's sample.
            samples: B.
        """
        statistics = pillar_statistics(points, sample, samples)
        result: Tensor = self.patches(statistics)
        return result


def pillar_statistics(points: Tensor, sample: Tensor, samples: int) -> Tensor:
    """(B, CHANNELS, PILLARS, PILLARS) statistics of the points in each pillar; arguments as of ``PillarEncoder``."""
    x, y, z, sweep = points.unbind(1)
    row = torch.floor((HALF_M - x) * (PILLARS / (2 * HALF_M))).long()
    column = torch.floor((HALF_M - y) * (PILLARS / (2 * HALF_M))).long()
    inside = (row >= 0) & (row < PILLARS) & (column >= 0) & (column < PILLARS) & (z >= BOTTOM_M) & (z < TOP_M)
    area = PILLARS * PILLARS
    size = samples * SWEEPS * area
    # Points outside go to one element more, which is cut off: shapes then do not depend on the data.
    pillar = torch.where(inside, (sample * SWEEPS + sweep.long()) * area + row * PILLARS + column, size)
    height = z / _HEIGHT_SCALE_M
    # One element that is repeated: as a whole, ONNX files would hold it as a constant.
    empty = points.new_zeros(1).expand(size + 1)
    count = empty.scatter_add(0, pillar, torch.ones_like(z))[:size]
    # A sum of integers does not depend on the order of the points, which is arbitrary on a GPU.
    total = empty.int().scatter_add(0, pillar, torch.round(height * _SUM_STEPS).int())[:size].float() / _SUM_STEPS
    highest = (empty - _BIG).scatter_reduce(0, pillar, height, "amax")[:size]
    lowest = (empty + _BIG).scatter_reduce(0, pillar, height, "amin")[:size]
    occupied = count > 0
    per_sweep = torch.stack(
        [occupied.float(), torch.where(occupied, lowest, 0.0), torch.where(occupied, highest, 0.0)]
    ).reshape(3, samples, SWEEPS, PILLARS, PILLARS)
    per_sweep = per_sweep.permute(1, 2, 0, 3, 4)
    newest = torch.stack([torch.log1p(count), total / count.clamp(min=1)])
    newest = newest.reshape(2, samples, SWEEPS, PILLARS, PILLARS)[:, :, 0].transpose(0, 1)
    level = torch.floor((z - _SLICES_BOTTOM_M) / _SLICE_M).long().clamp(0, SLICES - 1)
    is_newest = inside & (sweep < 0.5)
    slice_size = samples * SLICES * area
    cell = torch.where(is_newest, (sample * SLICES + level) * area + row * PILLARS + column, slice_size)
    slices = points.new_zeros(1).expand(slice_size + 1)
    slices = slices.scatter(0, cell, torch.ones_like(z))[:slice_size].reshape(samples, SLICES, PILLARS, PILLARS)
    earlier = per_sweep[:, 1:].reshape(samples, 3 * (SWEEPS - 1), PILLARS, PILLARS)
    return torch.cat([per_sweep[:, 0], newest, slices, earlier], 1)
