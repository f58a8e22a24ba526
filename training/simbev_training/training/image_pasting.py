"""Copies the pixels of pasted objects from one frame's images to another's.

An object keeps its place relative to the ego and so, within a few pixels, its place in the images. Depth says which
pixels in the outline of its box are its own, and which ones something nearer hides.
"""

from typing import NamedTuple

import cv2
import numpy as np

from simbev_ros.baselines.frames import IMAGE_STRIDE
from simbev_ros.foundation.types import AnyArray, BoolArray, Float32Array, Float64Array, Table, UInt8Array

_MIN_DEPTH_M = 1.0
_AROUND_M = 0.5
"""Depths of an object may be that far outside its box."""


class Images(NamedTuple):
    """Images of a frame.

    Attributes:
        rgb: (K, H, W, 3) uint8.
        depth_m: (K, H / 8, W / 8) float32; 0: unknown, or the sky.
        pixel_from_level: (K, 3, 4) float32 projections.
    """

    rgb: UInt8Array
    depth_m: Float32Array
    pixel_from_level: Float32Array

    def without(self, missing: BoolArray) -> "Images":
        """The same without some of the K cameras: black images that see nothing, as the models get for missing ones."""
        kept = ~missing[:, None, None]
        return Images(
            np.where(kept[..., None], self.rgb, np.uint8(0)),
            np.where(kept, self.depth_m, np.float32(0.0)),
            np.where(kept, self.pixel_from_level, np.float32(0.0)),
        )


def paste_images(images: Images, donor: Images, boxes: Table, steps_m: Float64Array) -> Images:
    """Images with the objects of a donor; arguments as for ``pasting.Pasted``."""
    rgb, depth_m = images.rgb.copy(), images.depth_m.copy()
    for index in np.argsort(-np.hypot(boxes["x"], boxes["y"])):
        box, step_m = boxes[index], steps_m[index]
        for camera in range(len(rgb)):
            theirs = donor.pixel_from_level[camera] @ np.vstack([_corners(box).T, np.ones(8)])
            ends = np.array([[box["x"], box["y"], box["z"], 1.0], [box["x"], box["y"], box["z"] + step_m, 1.0]])
            there, here = donor.pixel_from_level[camera] @ ends[0], images.pixel_from_level[camera] @ ends[1]
            near_m, far_m = theirs[2].min() - _AROUND_M, theirs[2].max() + _AROUND_M
            if min(near_m, here[2]) < _MIN_DEPTH_M:
                continue
            row, column = np.nonzero(_own_pixels(theirs, donor.depth_m[camera], near_m, far_m))
            right, down = np.rint(here[:2] / here[2] - there[:2] / there[2]).astype(int)
            to_row, to_column = row + down, column + right
            inside = (to_row >= 0) & (to_row < rgb.shape[1]) & (to_column >= 0) & (to_column < rgb.shape[2])
            row, column, to_row, to_column = row[inside], column[inside], to_row[inside], to_column[inside]
            present_m = images.depth_m[camera][to_row // IMAGE_STRIDE, to_column // IMAGE_STRIDE]
            shown = (present_m == 0) | (present_m > near_m)
            row, column, to_row, to_column = row[shown], column[shown], to_row[shown], to_column[shown]
            rgb[camera][to_row, to_column] = donor.rgb[camera][row, column]
            patches = donor.depth_m[camera][row // IMAGE_STRIDE, column // IMAGE_STRIDE]
            depth_m[camera][to_row // IMAGE_STRIDE, to_column // IMAGE_STRIDE] = patches
    return Images(rgb, depth_m, images.pixel_from_level)


def _corners(box: Table) -> Float64Array:
    """(8, 3) corners of a box, level frame."""
    signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    half = signs * np.array([box["length"], box["width"], box["height"]]) / 2
    cosine, sine = np.cos(box["yaw"]), np.sin(box["yaw"])
    x, y = cosine * half[:, 0] - sine * half[:, 1], sine * half[:, 0] + cosine * half[:, 1]
    return np.stack([x, y, half[:, 2]], 1) + np.array([box["x"], box["y"], box["z"]])


def _own_pixels(corners: Float64Array, depth_m: Float32Array, near_m: float, far_m: float) -> AnyArray:
    """(H, W) pixels in the outline of (3, 8) projected corners whose depth is within that of the box."""
    rows, columns = depth_m.shape
    mask = np.zeros((rows * IMAGE_STRIDE, columns * IMAGE_STRIDE), np.uint8)
    outline = cv2.convexHull((corners[:2] / corners[2]).T.astype(np.float32))
    cv2.fillConvexPoly(mask, np.rint(np.clip(outline, -1e4, 1e4)).astype(np.int32), 1)
    own = ((depth_m > near_m) & (depth_m < far_m)).astype(np.uint8)
    return mask & np.kron(own, np.ones((IMAGE_STRIDE, IMAGE_STRIDE), np.uint8))
