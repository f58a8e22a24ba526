"""Traces the outline of a mask as one polygon, as YOLO's labels have it. OpenCV is needed.

A polygon goes through the centers of the outermost pixels, which readers fill together with its inside. Separate parts
are connected by lines to and fro, so that filling the polygon gives all of them, and the pixels below these lines.
Holes are filled.
"""

import numpy as np

from simbev_exporters.labeled_images.layout import HALF_PX
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array

_MIN_CORNERS = 3
_INSET_PX = 0.25


def outline(mask: BoolArray, low_px: Float64Array, high_px: Float64Array) -> Float64Array:
    """(N, 2) x and y of the corners of a mask's outline, px; the corner of the first pixel is 0, 0.

    A mask with fewer than three corners has no area, so its outline is the box around it, a quarter of a pixel smaller
    on each side: filling it gives the same pixels.

    Args:
        mask: (H, W) mask.
        low_px: (2,) left and top of the box around it.
        high_px: (2,) right and bottom of the box around it.

    Raises:
        InputError: OpenCV is not installed.
    """
    load_extras()["pictures"].require("tracing outlines of objects")
    import cv2

    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    pieces = sorted((each.reshape(-1, 2).astype(np.int64) for each in contours), key=len, reverse=True)
    polygon = pieces[0] if pieces else np.zeros((0, 2), np.int64)
    for piece in pieces[1:]:
        polygon = _connected(polygon, piece)
    if len(polygon) < _MIN_CORNERS:
        (left, top), (right, bottom) = low_px + _INSET_PX, high_px - _INSET_PX
        return np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    return polygon.astype(np.float64) + HALF_PX


def _connected(polygon: Int64Array, piece: Int64Array) -> Int64Array:
    """The polygon with a further piece, to which a line goes and returns where they are nearest."""
    distance2 = ((polygon[:, None] - piece) ** 2).sum(axis=2)
    at, to = np.unravel_index(np.argmin(distance2), distance2.shape)
    return np.concatenate([polygon[: at + 1], np.roll(piece, -to, axis=0), piece[to : to + 1], polygon[at:]])
