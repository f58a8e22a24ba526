"""Brings images of any camera to the size that a model takes, with the projection that belongs to them.

An image is scaled to the model's width; of its rows, those around the horizon are kept, so that the principal point
comes to lie where it is in the models' training data. Geometry is an input of the models, so focal length and
principal point may be others.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import simplejpeg

from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.types import Float64Array, UInt8Array

_PRINCIPAL_ROW = 58 / 256
"""Row of the principal point over the height of the images in config/rigs/baselines.yaml."""


@dataclass(frozen=True)
class ImageFit:
    """How images of one camera become those that a model takes. Rows that the camera lacks are black.

    Attributes:
        size_px: Width and height of the model's images.
        scaled_px: Width and height of the whole image, scaled.
        top_px: First kept row of the scaled image.
        fitted_from_source: (3, 3) homogeneous pixels of the model's image from those of the camera's.
    """

    size_px: tuple[int, int]
    scaled_px: tuple[int, int]
    top_px: int
    fitted_from_source: Float64Array

    @classmethod
    def of_camera(cls, camera: PinholeCamera, size_px: tuple[int, int]) -> "ImageFit":
        """The fit of a camera's images to a model's size (width and height)."""
        width_px, height_px = size_px
        scaled_height_px = max(1, round(camera.height_px * width_px / camera.width_px))
        scale = np.array([width_px / camera.width_px, scaled_height_px / camera.height_px])
        offset = (scale - 1.0) / 2.0  # pixel centers are at integers
        wanted_px = round(float(camera.cy_px * scale[1] + offset[1]) - _PRINCIPAL_ROW * height_px)
        top_px = min(max(wanted_px, 0), max(scaled_height_px - height_px, 0))
        fitted_from_source = np.diag([*scale, 1.0])
        fitted_from_source[:2, 2] = offset[0], offset[1] - top_px
        return cls(size_px, (width_px, scaled_height_px), top_px, fitted_from_source)

    def decode(self, jpeg: bytes) -> UInt8Array:
        """The model's image (H, W, 3) from a JPEG, RGB.

        Raises:
            ValueError: It is not a JPEG.
        """
        width_px, height_px = self.scaled_px
        return self.fit(simplejpeg.decode_jpeg(jpeg, colorspace="RGB", min_width=width_px, min_height=height_px))

    def fit(self, image: UInt8Array) -> UInt8Array:
        """The model's image (H, W, 3) from the camera's, which may be larger or smaller than the camera says."""
        if image.shape[1::-1] != self.scaled_px:
            is_larger = image.shape[1] > self.scaled_px[0]
            image = np.asarray(cv2.resize(image, self.scaled_px, interpolation=_METHODS[is_larger]), np.uint8)
        width_px, height_px = self.size_px
        kept = image[self.top_px : self.top_px + height_px]
        if len(kept) == height_px:
            return kept
        padded = np.zeros((height_px, width_px, 3), np.uint8)
        padded[: len(kept)] = kept
        return padded


_METHODS = {False: cv2.INTER_LINEAR, True: cv2.INTER_AREA}
"""Methods to enlarge and to shrink images."""
