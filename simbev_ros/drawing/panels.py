"""Converts the arrays of sensors and annotators into RGB pictures for display.

Images of each modality, point clouds and bird's-eye-view labels enter; (H, W, 3) uint8 RGB pictures leave.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from simbev_ros.drawing.canvas import ACCENT, DIM, LINE, SURFACE, draw_text
from simbev_ros.foundation.geometry.transforms import apply
from simbev_ros.foundation.types import AnyArray, Float32Array, Float64Array, Table, UInt8Array, UInt16Array
from simbev_ros.schema.palette import bev_color, semantic_color

MIN_DEPTH_M, MAX_DEPTH_M = 2.0, 200.0
"""Range of the depth picture's color scale."""
FULL_FLOW_SHARE = 0.04
"""Length of the flow that has full brightness, as a share of the image's width."""
FULL_SPEED_MPS = 15.0
"""Radial speed from which a radar's detections have their full color."""

_GAMMA = np.rint(255.0 * (np.arange(256) / 255.0) ** (1.0 / 2.2)).astype(np.uint8)
_HEIGHTS_M, _HEIGHT_COLORS = (0.0, 0.3, 2.0, 6.0), ((84, 94, 110), (110, 128, 150), (165, 200, 212), (235, 240, 228))
_APPROACHING, _RECEDING, _NEITHER = (70, 150, 255), (255, 90, 70), (135, 135, 130)


def semantic_picture(tags: UInt8Array, rgb: UInt8Array | None, width_px: int) -> UInt8Array:
    """Picture of (H, W) semantic tags in CARLA's colors; ``rgb`` is not used."""
    return semantic_color(_thin(tags, width_px))


def instance_picture(ids: UInt16Array, rgb: UInt8Array | None, width_px: int) -> UInt8Array:
    """Picture of (H, W) actor ids: one color for each id over a dark gray version of ``rgb``; 0 means no actor."""
    ids = _thin(ids, width_px)
    picture = np.full((*ids.shape, 3), SURFACE, np.uint8)
    if rgb is not None:
        gray = cv2.cvtColor(cv2.resize(rgb, ids.shape[::-1], interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY)
        picture = np.repeat((gray // 3 + 12).astype(np.uint8)[..., None], 3, axis=-1)
    actors = ids > 0
    picture[actors] = _id_colors()[ids[actors]]
    return picture


def depth_picture(depth_m: Float32Array, rgb: UInt8Array | None, width_px: int) -> UInt8Array:
    """Picture of (H, W) depth, Turbo colors on a logarithmic scale: near is red, sky and depth beyond it are dark."""
    depth_m = _thin(depth_m, width_px)
    share = np.log(np.clip(depth_m, MIN_DEPTH_M, MAX_DEPTH_M) / MIN_DEPTH_M) / np.log(MAX_DEPTH_M / MIN_DEPTH_M)
    levels = np.rint(245 - 225 * share).astype(np.uint8)  # the ends of turbo are nearly black
    picture = np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_TURBO)[..., ::-1], np.uint8).copy()
    picture[~(depth_m < MAX_DEPTH_M)] = SURFACE
    return picture


def flow_picture(flow_px: Float32Array, rgb: UInt8Array | None, width_px: int) -> UInt8Array:
    """Picture of (H, W, 2) optical flow, px: hue is the direction, brightness the length; no flow is dark."""
    full_length_px = FULL_FLOW_SHARE * flow_px.shape[1]
    flow_px = _thin(flow_px, width_px)
    u, v = cv2.split(np.nan_to_num(flow_px))
    length_px, angle_deg = cv2.cartToPolar(u, v, angleInDegrees=True)
    strength = np.minimum(np.sqrt(length_px / full_length_px), 1)
    hsv = np.full((*u.shape, 3), (0, 185, 255), np.uint8)
    hsv[..., 0] = angle_deg / 2  # OpenCV counts hue in steps of 2 degrees
    dark = np.full_like(hsv, SURFACE)
    return np.asarray(cv2.blendLinear(cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB), dark, strength, 1 - strength), np.uint8)


def raw_picture(mosaic: UInt8Array, rgb: UInt8Array | None, width_px: int) -> UInt8Array:
    """Picture of an (H, W) mosaic RGGB: its colors as light, coded with a gamma of 2.2; ``rgb`` is not used."""
    colors = cv2.demosaicing(mosaic, cv2.COLOR_BayerBG2RGB)  # OpenCV names mosaics by their second row
    return _thin(np.asarray(cv2.LUT(colors, _GAMMA), np.uint8), width_px)


DrawModality = Callable[[AnyArray, UInt8Array | None, int], UInt8Array]
"""Function that makes a picture from a recorded image, the same view in RGB or None, and the displayed width in px."""


class ModalityPicture(NamedTuple):
    """Display of a modality: the function that makes its picture, and a note next to it."""

    picture: DrawModality
    note: str = ""


MODALITY_PICTURES: Mapping[str, ModalityPicture] = {
    "semantic": ModalityPicture(semantic_picture),
    "instance": ModalityPicture(instance_picture),
    "depth": ModalityPicture(depth_picture, f"{MIN_DEPTH_M:.0f} to {MAX_DEPTH_M:.0f} m"),
    "flow": ModalityPicture(flow_picture),
    "raw": ModalityPicture(raw_picture),
}
"""How each modality but rgb is shown."""


def lidar_picture(points: Table, ego_from_lidar: Float64Array, size_px: int, half_extent_m: float) -> UInt8Array:
    """Picture of a point cloud from above, the ego facing up, colored by tag; higher points cover lower ones.

    Args:
        points: (N,) rows with x, y, z in meters and a semantic tag; the sensor's frame.
        ego_from_lidar: (4, 4).
        size_px: Width and height of the picture.
        half_extent_m: Distance from the center of the picture to its edge.
    """
    points_lidar = np.stack([points[axis] for axis in "xyz"], axis=1)
    points_ego = cv2.transform(points_lidar[None], ego_from_lidar[:3])[0] if len(points) else points_lidar
    upwards = np.argsort(points_ego[:, 2], kind="stable")
    colors = semantic_color(points["tag"][upwards].astype(np.uint8))
    colors = np.maximum(colors, (colors // 2 + 80).astype(np.uint8))  # dark tags must show on the dark ground
    return _from_above(points_ego[upwards, :2], colors, 3, size_px, half_extent_m)


def heights_picture(points_level: Float32Array, size_px: int, half_extent_m: float) -> UInt8Array:
    """Picture of (N, 3) points above level ground, like ``lidar_picture``, but colored by height: light is high."""
    upwards = points_level[np.argsort(points_level[:, 2], kind="stable")]
    colors = [np.interp(upwards[:, 2], _HEIGHTS_M, channel) for channel in np.transpose(_HEIGHT_COLORS)]
    return _from_above(upwards[:, :2], np.stack(colors, axis=1).astype(np.uint8), 3, size_px, half_extent_m)


def radar_picture(clouds: Sequence[tuple[Table, Float64Array]], size_px: int, half_extent_m: float) -> UInt8Array:
    """Picture of all radars' detections from above, the ego facing up: blue approaches, red recedes, gray does neither.

    Args:
        clouds: For each radar its (N,) rows with x, y, z and doppler_velocity, and (4, 4) ego_from_radar.
        size_px: Width and height of the picture.
        half_extent_m: Distance from the center of the picture to its edge.
    """
    points_ego = [apply(pose, np.stack([cloud[axis] for axis in "xyz"], axis=1)) for cloud, pose in clouds]
    speed_mps = np.concatenate([np.zeros(0), *(cloud["doppler_velocity"] for cloud, _ in clouds)])
    fastest_last = np.argsort(np.minimum(np.abs(speed_mps), FULL_SPEED_MPS), kind="stable")
    xy_m = np.concatenate([np.zeros((0, 3)), *points_ego])[:, :2]
    return _from_above(xy_m[fastest_last], doppler_color(speed_mps[fastest_last]), 4, size_px, half_extent_m)


def doppler_color(speed_mps: AnyArray) -> UInt8Array:
    """(N, 3) colors of (N,) radial speeds, m/s: blue approaches, red recedes, gray does neither."""
    share = np.clip(speed_mps / FULL_SPEED_MPS, -1.0, 1.0)[:, None]
    end = np.where(share < 0, _APPROACHING, _RECEDING)
    strength = np.sqrt(np.abs(share))
    return np.rint(end * strength + np.array(_NEITHER) * (1 - strength)).astype(np.uint8)


def _from_above(
    xy_m: Float32Array | Float64Array, colors: UInt8Array, dot_px: int, size_px: int, half_extent_m: float
) -> UInt8Array:
    """Picture of (N, 2) points in their colors, later ones on top, below range rings; dots are ``dot_px / 2`` wide."""
    fine = 2 * size_px  # drawn finer, then averaged: soft dots
    picture = np.full((fine, fine, 3), SURFACE, np.uint8)
    position_px = (half_extent_m - xy_m) / (2 * half_extent_m) * fine
    inside = ((position_px >= 0) & (position_px < fine - dot_px + 1)).all(axis=1)
    row, column = position_px[inside].astype(np.intp).T
    for down, right in np.ndindex(dot_px, dot_px):
        picture[row + down, column + right] = colors[inside]
    picture = np.asarray(cv2.resize(picture, (size_px, size_px), interpolation=cv2.INTER_AREA), np.uint8)
    _draw_rings(picture, half_extent_m)
    _draw_ego(picture)
    return picture


def bev_picture(labels: UInt16Array, size_px: int) -> UInt8Array:
    """Picture of bird's-eye-view labels, the ego facing up, in the palette's colors on a dark background.

    Args:
        labels: (H, W) uint16, bit k for class k.
        size_px: Width of the picture; its height keeps the aspect ratio.
    """
    picture = bev_color(labels)
    picture[labels == 0] = SURFACE
    height = round(size_px * labels.shape[0] / labels.shape[1])
    interpolation = cv2.INTER_AREA if size_px < labels.shape[1] else cv2.INTER_CUBIC
    picture = np.asarray(cv2.resize(picture, (size_px, height), interpolation=interpolation), np.uint8)
    _draw_ego(picture)
    return picture


def _draw_ego(picture: UInt8Array) -> None:
    """Draw the ego, an arrow head in the middle that points up."""
    height, width = picture.shape[:2]
    arrow = np.array([[0, -1], [0.62, 0.8], [0, 0.45], [-0.62, 0.8]]) * width / 55 + [width / 2, height / 2]
    cv2.fillPoly(picture, [np.rint(arrow * 16).astype(np.int32)], ACCENT, cv2.LINE_AA, 4)


def _draw_rings(picture: UInt8Array, half_extent_m: float) -> None:
    """Draw range rings every 20 m, labeled with their radius."""
    size = len(picture)
    center, px_per_m = size / 2, size / (2 * half_extent_m)
    lines = picture.copy()
    radii_m = range(20, int(half_extent_m) + 1, 20)
    for radius_m in radii_m:
        _draw_circle(lines, center, radius_m * px_per_m)
    np.copyto(picture, cv2.addWeighted(picture, 0.45, lines, 0.55, 0))
    for radius_m in radii_m:
        diagonal = radius_m * px_per_m * np.sqrt(0.5)
        draw_text(picture, f"{radius_m} m", center + diagonal + 3, center + diagonal + 3, size=size / 40, color=DIM)


def _draw_circle(picture: UInt8Array, center: float, radius: float) -> None:
    fine = 16  # OpenCV's fixed-point coordinates: 4 bits
    middle = round(center * fine)
    cv2.circle(picture, (middle, middle), round(radius * fine), LINE, 1, cv2.LINE_AA, 4)


@lru_cache(maxsize=1)
def _id_colors() -> UInt8Array:
    """(65536, 3) bright colors, very different for neighboring ids: hues step by the golden angle."""
    ids = np.arange(1 << 16)
    hue = (ids * 111.246 + 17) % 180
    saturation, value = 120 + ids * 37 % 100, 205 + ids * 23 % 51
    hsv = np.stack([hue, saturation, value], axis=-1).astype(np.uint8)
    return np.asarray(cv2.cvtColor(hsv[None], cv2.COLOR_HSV2RGB)[0], np.uint8)


def _thin(image: AnyArray, width_px: int) -> AnyArray:
    """Every Nth row and column of an image, at least ``width_px`` wide: labels must not be averaged."""
    step = max(1, image.shape[1] // (2 * width_px))
    return np.ascontiguousarray(image[::step, ::step])
