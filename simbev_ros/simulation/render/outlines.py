"""Semantic images as people draw them in data sets of photographs: outlines, with what is seen through small gaps.

A crown, a railing or a wheel with spokes is labeled there as one area. So gaps that are narrow for a class are closed,
at the distance of what is around them, unless something shows through that people outline on its own. Poles are drawn
a pixel wider on each side, as nobody draws less than three.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import NamedTuple

import cv2
import numpy as np

from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float32Array, UInt8Array
from simbev_ros.simulation.render.frame import CameraImages, CameraView


class _Gap(NamedTuple):
    """Gaps that are closed: a width below which all are, and by how much farther what shows through is, meters."""

    width_m: float
    behind_m: float


_GAPS: Mapping[Tag, _Gap] = MappingProxyType(
    {
        Tag.VEGETATION: _Gap(0.7, 0.8),
        Tag.FENCE: _Gap(0.2, 0.1),
        Tag.GUARD_RAIL: _Gap(0.3, 0.1),
        Tag.BICYCLE: _Gap(0.35, 0.2),
        Tag.MOTORCYCLE: _Gap(0.2, 0.2),
    }
)
_ON_ITS_OWN = np.isin(
    np.arange(256),
    [
        *(Tag.PEDESTRIAN, Tag.RIDER, Tag.CAR, Tag.TRUCK, Tag.BUS, Tag.TRAIN, Tag.MOTORCYCLE, Tag.BICYCLE),
        *(Tag.POLE, Tag.TRAFFIC_LIGHT, Tag.TRAFFIC_SIGN),
    ],
)
"""(256,) whether a tag is outlined on its own where it shows through a gap."""
_MAX_RADIUS_PX = 24
_OVERLAP = 1.25
"""Factor by which ranges of distance overlap, so that nothing is cut where one ends."""


def outline_images(view: CameraView, images: CameraImages) -> CameraImages:
    """The images of a view that asks for outlines, with these in its semantic image; others stay as they are."""
    if not view.outlines or images.semantic is None or images.depth is None:
        return images
    semantic = outlined(images.semantic, images.depth, view.camera.fx_px)
    return replace(images, semantic=semantic, depth=images.depth if "depth" in view.modalities else None)


def outlined(semantic: UInt8Array, depth_m: Float32Array, focal_px: float) -> UInt8Array:
    """Close the gaps of a semantic image.

    Args:
        semantic: (H, W) tags of the surfaces at the pixels.
        depth_m: (H, W) distances of these surfaces.
        focal_px: Focal length, or pixels per radian of a fisheye.

    Returns:
        (H, W) tags.
    """
    closed, nearest_m = semantic.copy(), depth_m.copy()
    is_open = ~_ON_ITS_OWN[semantic]
    _widen(closed, nearest_m, is_open, semantic == Tag.POLE)
    for tag, gap in _GAPS.items():
        mask = semantic == tag
        if not mask.any():
            continue
        farthest_m = float(depth_m[mask].max())
        radius_px = _MAX_RADIUS_PX
        while radius_px >= 1:
            first_m = focal_px * gap.width_m / 2.0 / radius_px  # where discs of this radius just close the gaps
            in_range = mask & (depth_m < 2.0 * first_m * _OVERLAP)
            if radius_px < _MAX_RADIUS_PX:
                in_range &= depth_m > first_m / _OVERLAP
            _close(closed, nearest_m, depth_m, in_range, is_open, tag, gap, radius_px)
            if farthest_m < 2.0 * first_m:
                break
            radius_px //= 2
    return closed


def _close(
    closed: UInt8Array,
    nearest_m: Float32Array,
    depth_m: Float32Array,
    mask: BoolArray,
    is_open: BoolArray,
    tag: Tag,
    gap: _Gap,
    radius_px: int,
) -> None:
    """Close the gaps of a class in one range of distances, in place; the nearest of several classes counts."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return
    part = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    disc = _disc(radius_px)
    inside = cv2.morphologyEx(mask[part].astype(np.uint8), cv2.MORPH_CLOSE, disc) > 0
    around_m = cv2.erode(np.where(mask[part], depth_m[part], np.float32(np.inf)), disc)
    fills = inside & ~mask[part] & is_open[part] & (depth_m[part] > around_m + gap.behind_m)
    fills &= nearest_m[part] > around_m
    closed[part][fills], nearest_m[part][fills] = tag, around_m[fills]


def _widen(closed: UInt8Array, nearest_m: Float32Array, is_open: BoolArray, poles: BoolArray) -> None:
    """Label the pixels beside poles that show something farther, in place."""
    around_m = cv2.erode(np.where(poles, nearest_m, np.float32(np.inf)), np.ones((3, 3), np.uint8))
    fills = ~poles & is_open & (nearest_m > around_m)
    closed[fills], nearest_m[fills] = Tag.POLE, around_m[fills]


@lru_cache(maxsize=8)
def _disc(radius_px: int) -> UInt8Array:
    side = 2 * radius_px + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), np.uint8)
