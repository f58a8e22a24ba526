"""A whole baseline: one or two sensor branches, the trunk, and the heads."""

from typing import NamedTuple

import torch
from torch import Tensor, nn

from simbev_ros.baselines.modality import Modality
from simbev_training.model.blocks import conv_norm_relu
from simbev_training.model.cameras import CameraEncoder
from simbev_training.model.heads import Heads, Outputs
from simbev_training.model.pillars import PillarEncoder
from simbev_training.model.trunk import BevTrunk

_CHANNELS = 64
_FINE_CHANNELS = 32


class Inputs(NamedTuple):
    """A batch of B samples; a model leaves out what it does not see.

    Attributes:
        points: (N, 4) float32 x, y, z (m, level frame), index of the sweep, of all samples.
        sample: (N,) int64 index of each point's sample.
        images: (B, K, 3, H, W) RGB, 0 … 255.
        pixel_from_level: (B, K, 3, 4) float32 projections.
        samples: B.
    """

    points: Tensor | None
    sample: Tensor | None
    images: Tensor | None
    pixel_from_level: Tensor | None
    samples: int


class BevModel(nn.Module):
    """Bird's-eye-view segmentation and 3D detection from lidar sweeps, images, or both.

    Args:
        modality: What the model sees.
    """

    def __init__(self, modality: Modality) -> None:
        super().__init__()
        self.modality = modality
        self.lidar = PillarEncoder(_CHANNELS, _FINE_CHANNELS) if modality.has_lidar else None
        self.cameras = CameraEncoder(_CHANNELS, beside_lidar=modality.has_lidar) if modality.has_cameras else None
        both = self.lidar is not None and self.cameras is not None
        self.fuse = conv_norm_relu(2 * _CHANNELS, _CHANNELS, 1) if both else nn.Identity()
        self.trunk = BevTrunk(_CHANNELS, _CHANNELS)
        self.heads = Heads(_CHANNELS, _FINE_CHANNELS if self.lidar is not None else 0)

    def compile_parts(self) -> None:
        """Compile those parts in place that get tensors of one shape; names and values of weights stay."""
        self.trunk.compile()
        self.heads.compile()
        if self.cameras is not None:
            self.cameras.images.compile()

    def forward(self, inputs: Inputs) -> Outputs:
        """Outputs for a batch."""
        branches, fine, depth = [], None, None
        if self.lidar is not None:
            assert inputs.points is not None and inputs.sample is not None
            features, fine = self.lidar(inputs.points, inputs.sample, inputs.samples)
            branches.append(features)
        if self.cameras is not None:
            assert inputs.images is not None and inputs.pixel_from_level is not None
            lifted, depth = self.cameras(inputs.images, inputs.pixel_from_level)
            branches.append(lifted)
        cells, heat, boxes, small_heat, small_boxes = self.heads(self.trunk(self.fuse(torch.cat(branches, 1))), fine)
        return Outputs(cells, heat, boxes, small_heat, small_boxes, depth)
