"""Random changes of each image on its own: it is mirrored, rotated and zoomed, and its projection with it.

As in BEVDet (https://arxiv.org/abs/2112.11790): changes of the bird's-eye view alone leave the image branch with the
same images in each epoch, which it learns by heart.
"""

import numpy as np
from torch import Tensor
from torch.nn.functional import affine_grid, grid_sample

from simbev_ros.foundation.types import Float64Array
from simbev_training.training.config import Augmentation


def draw_image_warps(
    augmentation: Augmentation, cameras: int, size_px: tuple[int, int], rng: np.random.Generator
) -> Float64Array:
    """(K, 3, 3) maps of homogeneous pixels, one for each image: mirrored or not, rotated and zoomed about the middle.

    Args:
        augmentation: How far.
        cameras: K.
        size_px: Width and height; pixel centers are at integers.
        rng: Where numbers are drawn from.
    """
    to_middle = np.eye(3)
    to_middle[:2, 2] = -(np.array(size_px) - 1) / 2
    warps = np.tile(np.eye(3), (cameras, 1, 1))
    for warp in warps:
        angle_rad = np.radians(rng.uniform(-1.0, 1.0) * augmentation.image_rotation_deg)
        zoom = rng.uniform(1.0 - augmentation.zoom, 1.0 + augmentation.zoom)
        side = -1.0 if augmentation.flip and rng.random() < 0.5 else 1.0
        cosine, sine = zoom * np.cos(angle_rad), zoom * np.sin(angle_rad)
        warp[:2, :2] = np.array([[cosine, -sine], [sine, cosine]]) @ np.diag([side, 1.0])
    return np.asarray(np.linalg.inv(to_middle) @ warps @ to_middle)


def warped_images(images: Tensor, recorded_from_pixel: Tensor, mode: str) -> Tensor:
    """(B, K, C, h, w) float32 warped images, 0 outside the recorded ones.

    Args:
        images: (B, K, C, h, w) float32, of full size or smaller.
        recorded_from_pixel: (B, K, 3, 3) maps of the homogeneous pixels of an image of full size, in the coordinates of
            ``unit_from_pixel``.
        mode: ``bilinear`` or ``nearest``.
    """
    batch, cameras, *shape = images.shape
    grid = affine_grid(recorded_from_pixel.flatten(0, 1)[:, :2], [batch * cameras, *shape], align_corners=False)
    sampled = grid_sample(images.flatten(0, 1), grid, mode, "zeros", align_corners=False)
    return sampled.reshape(images.shape)


def unit_from_pixel(size_px: tuple[int, int]) -> Float64Array:
    """(3, 3) map from homogeneous pixels to coordinates of -1 … 1 from edge to edge, which are those of any size."""
    result = np.diag([2 / size_px[0], 2 / size_px[1], 1.0])
    result[:2, 2] = 1 / np.array(size_px) - 1.0
    return result
