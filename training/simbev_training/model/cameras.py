"""Camera branch: images become features with a distribution over depth, which are lifted to the bird's-eye view.

As in Lift, Splat, Shoot (https://arxiv.org/abs/2008.05711), each cell of an image's features says how far away it is;
as in BEVDepth (https://arxiv.org/abs/2206.10092), exact depth supervises that. The view transformation pulls instead of
splatting: each voxel looks up the cell that it projects to and takes its features, weighted by the probability of the
voxel's own depth. This leaves no holes at a distance, needs no sorting, and takes any pose of the cameras as an input.

With a lidar, which measures positions, features of some heights also enter without that weight, as in
Simple-BEV (https://arxiv.org/abs/2206.07959): far away, depth from images is too vague to say what a lidar's object is.
"""

import torch
from torch import Tensor, nn
from torch.nn.functional import interpolate

from simbev_ros.baselines.frames import IMAGE_STRIDE
from simbev_ros.baselines.grid import FEATURE_CELL_M, FEATURE_CELLS, HALF_M
from simbev_training.model.blocks import conv_norm_relu, residual_stage

DEPTHS = 48
"""Number of intervals of depth."""
NEAR_M, FAR_M = 1.0, 97.0
HEIGHTS_M = (-3.0, -1.2, 0.0, 0.8, 1.8, 3.2)
"""Heights of the voxels of a cell above the ego's origin on the ground."""
_UNWEIGHTED = range(3, 5)
"""The heights among these at which features also enter without the weight of depth."""
_WIDTHS = (32, 56, 112, 208)
_LIFTED = 32
_MEAN, _SCALE = 110.0, 60.0


class ImageEncoder(nn.Module):
    """Features and depth of images: a small ResNet with a feature pyramid down to ``IMAGE_STRIDE``."""

    def __init__(self) -> None:
        super().__init__()
        half, quarter, eighth, sixteenth = _WIDTHS
        self.stem = nn.Sequential(conv_norm_relu(3, half, 3, 2), conv_norm_relu(half, half))
        self.quarter = residual_stage(half, quarter, 1, 2)
        self.eighth = residual_stage(quarter, eighth, 2, 2)
        self.sixteenth = residual_stage(eighth, sixteenth, 3, 2)
        self.from_sixteenth = nn.Conv2d(sixteenth, eighth, 1)
        self.smooth = conv_norm_relu(eighth, eighth)
        self.out = nn.Conv2d(eighth, _LIFTED + DEPTHS, 1)

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Features (M, C, H / 8, W / 8) and logits of depth (M, DEPTHS, H / 8, W / 8) of (M, 3, H, W) RGB, 0 … 255."""
        eighth = self.eighth(self.quarter(self.stem((images - _MEAN) / _SCALE)))
        sixteenth = self.sixteenth(eighth)
        coarse = interpolate(self.from_sixteenth(sixteenth), scale_factor=2.0, mode="nearest")
        features, depth = self.out(self.smooth(eighth + coarse)).split([_LIFTED, DEPTHS], 1)
        return features, depth


def depth_index(depth_m: Tensor) -> Tensor:
    """Interval of depth, not rounded, that grows with the square root: near ones are short (CaDDN's LID)."""
    share = (depth_m.clamp(NEAR_M, FAR_M) - NEAR_M) / (FAR_M - NEAR_M)
    return 0.5 * (torch.sqrt(1.0 + 4.0 * DEPTHS * (DEPTHS + 1) * share) - 1.0)


class CameraEncoder(nn.Module):
    """Features of a batch of frames with several cameras.

    Args:
        channels: Number of features of a cell of the bird's-eye view.
        beside_lidar: Whether features go in without the weight of depth as well.
    """

    ahead_m: Tensor
    height_m: Tensor

    def __init__(self, channels: int, *, beside_lidar: bool) -> None:
        super().__init__()
        self.images = ImageEncoder()
        self.beside_lidar = beside_lidar
        heights = len(HEIGHTS_M) + (len(_UNWEIGHTED) if beside_lidar else 0)
        self.mix = nn.Sequential(conv_norm_relu(_LIFTED * heights, channels, 1), conv_norm_relu(channels, channels))
        ahead_m = HALF_M - (torch.arange(FEATURE_CELLS) + 0.5) * FEATURE_CELL_M
        self.register_buffer("ahead_m", ahead_m, persistent=False)
        self.register_buffer("height_m", torch.tensor(HEIGHTS_M), persistent=False)

    def forward(self, images: Tensor, pixel_from_level: Tensor) -> tuple[Tensor, Tensor]:
        """Features (B, C, FEATURE_CELLS, FEATURE_CELLS) and logits of depth (B, K, DEPTHS, H / 8, W / 8).

        Args:
            images: (B, K, 3, H, W) RGB of K cameras, 0 … 255.
            pixel_from_level: (B, K, 3, 4) projections from the level frame to u * depth, v * depth, depth; pixel
                centers are at integers.
        """
        batch, cameras, _, height, width = images.shape
        features, depth = self.images(images.flatten(0, 1))
        rows, columns = height // IMAGE_STRIDE, width // IMAGE_STRIDE
        index, bins, seen = self._look_up(pixel_from_level, rows, columns)
        values = features.reshape(batch, cameras, _LIFTED, -1).permute(0, 1, 3, 2).reshape(batch, -1, _LIFTED)
        likely = depth.reshape(batch, cameras, DEPTHS, -1).permute(0, 1, 3, 2).softmax(-1).reshape(batch, -1)
        weight = likely.gather(1, index * DEPTHS + bins) * seen
        looked_up = _by_height(values.gather(1, index[..., None].expand(-1, -1, _LIFTED)))
        lifted = looked_up * _by_height(weight[..., None])
        if self.beside_lidar:
            heights = slice(_UNWEIGHTED.start, _UNWEIGHTED.stop)
            unweighted = looked_up[:, :, :, heights] * _by_height(seen[..., None])[:, :, :, heights]
            lifted = torch.cat([lifted, unweighted], 3)
        return self.mix(lifted.flatten(3).permute(0, 3, 1, 2)), depth.reshape(batch, cameras, DEPTHS, rows, columns)

    def _look_up(self, pixel_from_level: Tensor, rows: int, columns: int) -> tuple[Tensor, Tensor, Tensor]:
        """(B, V) cell of the image features of each voxel, its interval of depth, and 1 if any camera sees it, else 0.

        Of several cameras that see a voxel, the one counts in which it is nearest to the middle column.
        """
        with torch.autocast(self.ahead_m.device.type, enabled=False):
            along_x, along_y, along_z, origin = pixel_from_level.float()[..., None, None, None].unbind(3)
            on_plane = along_x * self.ahead_m[:, None, None] + along_y * self.ahead_m[:, None]
            projected = (on_plane + along_z * self.height_m + origin).flatten(3)
            depth_m = projected[:, :, 2]
            away = depth_m.clamp(min=0.1)
            column = torch.floor((projected[:, :, 0] / away + 0.5) / IMAGE_STRIDE)
            row = torch.floor((projected[:, :, 1] / away + 0.5) / IMAGE_STRIDE)
            seen = (depth_m > NEAR_M) & (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
            off_middle = torch.where(seen, (column - columns / 2).abs(), columns)
            best, camera = off_middle.min(1, keepdim=True)
            column = column.gather(1, camera).clamp(0, columns - 1)
            row = row.gather(1, camera).clamp(0, rows - 1)
            bins = depth_index(depth_m.gather(1, camera)).floor().clamp(0, DEPTHS - 1)
            index = ((camera * rows + row.long()) * columns + column.long())[:, 0]
            return index, bins.long()[:, 0], (best[:, 0] < columns).to(torch.float32)


def _by_height(voxels: Tensor) -> Tensor:
    """(B, FEATURE_CELLS, FEATURE_CELLS, heights, C) of (B, V, C) values of voxels."""
    return voxels.reshape(len(voxels), FEATURE_CELLS, FEATURE_CELLS, len(HEIGHTS_M), -1)
