"""The trunk that all baselines share: a ResNet over the bird's-eye view whose levels a feature pyramid joins."""

from torch import Tensor, nn
from torch.nn.functional import interpolate

from simbev_training.model.blocks import conv_norm_relu, residual_stage

_WIDTHS = (64, 128, 256)
_DILATIONS = (2, 4)
"""Dilations of the last blocks: what a road does is seen from far away."""


class BevTrunk(nn.Module):
    """Features of a cell from its wide surroundings.

    Args:
        channels_in: Features that enter.
        channels_out: Features that leave.
    """

    def __init__(self, channels_in: int, channels_out: int) -> None:
        super().__init__()
        fine, middle, coarse = _WIDTHS
        self.fine = residual_stage(channels_in, fine, 1, 1)
        self.middle = residual_stage(fine, middle, 2, 2)
        self.coarse = residual_stage(middle, coarse, 1, 2, _DILATIONS)
        self.from_coarse = nn.Conv2d(coarse, middle, 1)
        self.smooth_middle = conv_norm_relu(middle, middle)
        self.from_middle = nn.Conv2d(middle, fine, 1)
        self.smooth_fine = conv_norm_relu(fine, channels_out)

    def forward(self, features: Tensor) -> Tensor:
        """(B, channels_in, H, W) to (B, channels_out, H, W); H and W are multiples of 4."""
        fine = self.fine(features)
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        middle = self.smooth_middle(middle + interpolate(self.from_coarse(coarse), scale_factor=2.0, mode="nearest"))
        result: Tensor = self.smooth_fine(
            fine + interpolate(self.from_middle(middle), scale_factor=2.0, mode="nearest")
        )
        return result
