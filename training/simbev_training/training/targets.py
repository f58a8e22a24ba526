"""Training targets of a batch: grids of classes, heat maps, and values of boxes at their centers."""

from typing import NamedTuple

import torch
from torch import Tensor

from simbev_ros.baselines.boxes import DETECTED_CLASSES, LARGE_CLASSES
from simbev_ros.baselines.grid import CELL_M, CELLS, FEATURE_CELLS, HALF_M
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_training.training.batches import Batch

_MAX_RADIUS = 6
_MIN_RADIUS = 2.0
_RADIUS_SHARE = 0.35
"""Radius of a peak in the heat map over the mean side of the box."""


class BoxTargets(NamedTuple):
    """Targets of the boxes of some classes in B samples, on a grid of N x N cells.

    Attributes:
        heat: (B, classes, N, N) float32, 1 at centers and less around them.
        open: (B, classes, N, N) float32, the same for boxes that are not to be learned.
        center: (M,) int64 flat index of sample, row, column of each box's center, of all classes.
        weight: (M,) float32, 1 for boxes of these classes that are to be learned, else 0.
        boxes: (M, len(BOX_VALUES)) values.
    """

    heat: Tensor
    open: Tensor
    center: Tensor
    weight: Tensor
    boxes: Tensor


class Targets(NamedTuple):
    """Targets of B samples.

    Attributes:
        cells: (B, CELLS, CELLS, C) float32, 0 or 1: in memory as a GPU's convolutions have it.
        known: (B, CELLS, CELLS, 1) float32, 1 where the warped grid was recorded.
        large: Boxes of the large classes, on the cells of features.
        small: Boxes of the other classes, on the cells of the grid.
    """

    cells: Tensor
    known: Tensor
    large: BoxTargets
    small: BoxTargets


def targets_of(batch: Batch) -> Targets:
    """Targets of a batch, on its device."""
    cells, known = _warped_cells(batch)
    large, small = range(LARGE_CLASSES), range(LARGE_CLASSES, len(DETECTED_CLASSES))
    samples = len(batch.cells)
    return Targets(
        cells,
        known,
        _box_targets(batch.boxes, samples, large, FEATURE_CELLS),
        _box_targets(batch.boxes, samples, small, CELLS),
    )


def _warped_cells(batch: Batch) -> tuple[Tensor, Tensor]:
    samples, device = len(batch.cells), batch.cells.device
    ahead = HALF_M - (torch.arange(CELLS, device=device) + 0.5) * CELL_M
    center = torch.stack(torch.meshgrid(ahead, ahead, indexing="ij"), -1).reshape(1, -1, 2)
    source = center @ batch.level_from_warped[:, :, :2].transpose(1, 2) + batch.level_from_warped[:, None, :, 2]
    index = torch.floor((HALF_M - source) / CELL_M).long()
    known = ((index >= 0) & (index < CELLS)).all(-1)
    row, column = index.clamp(0, CELLS - 1).unbind(-1)
    bits = batch.cells.reshape(samples, -1).gather(1, row * CELLS + column)
    shift = torch.arange(len(BEV_CLASSES), device=device, dtype=bits.dtype)
    cells = ((bits[..., None] >> shift) & 1).to(torch.float32).reshape(samples, CELLS, CELLS, -1)
    return cells, known.to(torch.float32).reshape(samples, CELLS, CELLS, 1)


def _box_targets(boxes: Tensor, samples: int, labels: range, cells: int) -> BoxTargets:
    """Targets of the boxes of some classes. Others stay with no weight: a GPU would have to be waited for to count."""
    cell_m = 2 * HALF_M / cells
    position = (HALF_M - boxes[:, 2:4]) / cell_m
    cell = torch.floor(position).long()
    sample, label = boxes[:, 0].long(), boxes[:, 1].long() - labels.start
    wanted = (label >= 0) & (label < len(labels))
    size = boxes[:, 5:8]
    radius = (_RADIUS_SHARE * size[:, :2].mean(1) / cell_m).clamp(_MIN_RADIUS, _MAX_RADIUS)
    around = torch.arange(-_MAX_RADIUS, _MAX_RADIUS + 1, device=boxes.device)
    row = cell[:, 0, None, None] + around[None, :, None]
    column = cell[:, 1, None, None] + around[None, None, :]
    square = (around**2)[None, :, None] + (around**2)[None, None, :]
    sigma = (2 * radius + 1)[:, None, None] / 6
    peak = torch.exp(-square / (2 * sigma**2))
    inside = (row >= 0) & (row < cells) & (column >= 0) & (column < cells) & wanted[:, None, None]
    area = cells * cells
    plane = (sample * len(labels) + label.clamp(0, len(labels) - 1))[:, None, None] * area
    flat = (plane + row.clamp(0, cells - 1) * cells + column.clamp(0, cells - 1)).flatten()
    learned = boxes[:, 11] > 0
    none = torch.zeros(samples * len(labels) * area, device=boxes.device)
    heat, unlearned = (
        none.scatter_reduce(0, flat, torch.where(inside & each[:, None, None], peak, 0.0).flatten(), "amax").reshape(
            samples, len(labels), cells, cells
        )
        for each in (learned, ~learned)
    )
    offset = position - cell - 0.5
    values = torch.cat(
        [offset, boxes[:, 4:5], torch.log(size), torch.sin(boxes[:, 8:9]), torch.cos(boxes[:, 8:9]), boxes[:, 9:11]], 1
    )
    center = (sample * cells + cell[:, 0]) * cells + cell[:, 1]
    return BoxTargets(heat, unlearned, center, (wanted & learned).float(), values)
