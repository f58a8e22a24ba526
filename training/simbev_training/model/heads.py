"""The heads: scores of all classes for each cell of the grid, and boxes by their centers.

Boxes are predicted as in CenterPoint (https://arxiv.org/abs/2006.11275): a heat map for each class, and at its peaks
the position within the cell, height above the ego's ground, size, heading and velocity. People and two-wheelers have
maps on the cells of the grid: those of features, twice as long, would make one box of a group.
"""

from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn.functional import pixel_shuffle

from simbev_ros.baselines.boxes import BOX_VALUES, DETECTED_CLASSES, LARGE_CLASSES
from simbev_ros.baselines.grid import FEATURE_STRIDE
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_training.model.blocks import ResidualBlock, conv_norm_relu

_CELL_CHANNELS, _MIXED_CHANNELS = 16, 32
_RARE = -4.6
"""Logit of 1 %: scores start low, as centers and most classes are rare."""


class Heads(nn.Module):
    """All heads over the same features; those on the cells of the grid see the features of small objects as well.

    Args:
        channels: Features of a cell of the feature grid.
        fine_channels: Features of a cell of the bird's-eye-view grid; 0: none.
    """

    def __init__(self, channels: int, fine_channels: int) -> None:
        super().__init__()
        self.segmentation = nn.Sequential(
            conv_norm_relu(channels, channels), nn.Conv2d(channels, _CELL_CHANNELS * FEATURE_STRIDE**2, 1)
        )
        fine = [ResidualBlock(_MIXED_CHANNELS, _MIXED_CHANNELS)] if fine_channels else []
        self.cells = nn.Sequential(
            conv_norm_relu(_CELL_CHANNELS + fine_channels, _MIXED_CHANNELS),
            *fine,
            nn.Conv2d(_MIXED_CHANNELS, len(BEV_CLASSES), 1),
        )
        self.detection = conv_norm_relu(channels, channels)
        self.heat = nn.Conv2d(channels, LARGE_CLASSES, 3, padding=1)
        self.boxes = nn.Conv2d(channels, len(BOX_VALUES), 1)
        self.small = conv_norm_relu(_MIXED_CHANNELS, _MIXED_CHANNELS)
        self.small_heat = nn.Conv2d(_MIXED_CHANNELS, len(DETECTED_CLASSES) - LARGE_CLASSES, 1)
        self.small_boxes = nn.Conv2d(_MIXED_CHANNELS, len(BOX_VALUES), 1)
        for layer in (self.cells[-1], self.heat, self.small_heat):
            nn.init.constant_(layer.bias, _RARE)

    def forward(self, features: Tensor, fine: Tensor | None) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """Cells, and heat and boxes of large and of small objects, as in ``Outputs``.

        Args:
            features: (B, C, FEATURE_CELLS, FEATURE_CELLS).
            fine: (B, C', CELLS, CELLS); None: the model has none.
        """
        cells = pixel_shuffle(self.segmentation(features), FEATURE_STRIDE)
        mixed = self.cells[:-1](cells if fine is None else torch.cat([cells, fine], 1))
        detection, small = self.detection(features), self.small(mixed)
        large = self.heat(detection), self.boxes(detection)
        return self.cells[-1](mixed), *large, self.small_heat(small), self.small_boxes(small)


class Outputs(NamedTuple):
    """Output of a model for a batch.

    Attributes:
        cells: (B, len(BEV_CLASSES), CELLS, CELLS) logits.
        heat: (B, LARGE_CLASSES, FEATURE_CELLS, FEATURE_CELLS) logits of centers of the large classes.
        boxes: (B, len(BOX_VALUES), FEATURE_CELLS, FEATURE_CELLS) values of their boxes.
        small_heat: (B, other classes, CELLS, CELLS) the same for the other classes.
        small_boxes: (B, len(BOX_VALUES), CELLS, CELLS)
        depth: (B, cameras, DEPTHS, H, W) logits of the depth of each cell of the image features; None without cameras.
    """

    cells: Tensor
    heat: Tensor
    boxes: Tensor
    small_heat: Tensor
    small_boxes: Tensor
    depth: Tensor | None
