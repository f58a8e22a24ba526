"""Arrays as a sensor or annotator gives them → RGB pictures to look at."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np

from simbev_ros.geometry.transforms import apply
from simbev_ros.palette import bev_color, semantic_color
from simbev_ros.types import AnyArray, Float32Array, Float64Array, Table, UInt8Array, UInt16Array
from simbev_ros.viz.canvas import ACCENT, DIM, LINE, SURFACE, draw_text

NEAREST_DEPTH_M, FARTHEST_DEPTH_M = 2.0, 200.0
FULL_FLOW_SHARE = 0.04
"""Flow of this share of the image's width has full brightness."""
FULL_SPEED_MPS = 15.0
"""Radial speed from which on a radar's detections have their full colour."""

_APPROACHING, _RECEDING, _NEITHER = (70, 150, 255), (255, 90, 70), (135, 135, 130)


def semantic_picture(tags: UInt8Array, rgb: UInt8Array | None, width_px: int) -> UInt8Array:
    """Picture of (H, W) semantic tags in CARLA's colours."""
    return semantic_color(_thin(tags, width_px))


def instance_picture(ids: UInt16Array, rgb: UInt8Array | None, width_px: int) -> UInt8Array:
    """A colour of its own for every id of (H, W), 0 being no actor, over the camera's picture in dark grey."""
    ids = _thin(ids, width_px)
    picture = np.full((*ids.shape, 3), SURFACE, np.uint8)
    if rgb is not None:
        grey = cv2.cvtColor(cv2.resize(rgb, ids.shape[::-1], interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY)
        picture = np.repeat((grey // 3 + 12).astype(np.uint8)[..., None], 3, axis=-1)
    actors = ids > 0
    picture[actors] = _id_colors()[ids[actors]]
    return picture


def depth_picture(depth_m: Float32Array, rgb: UInt8Array | None, width_px: int) -> UInt8Array:
    """Turbo colours over the logarithm of (H, W) depth, near is red; sky, and what is beyond the scale, is dark."""
    depth_m = _thin(depth_m, width_px)
    share = np.log(np.clip(depth_m, NEAREST_DEPTH_M, FARTHEST_DEPTH_M) / NEAREST_DEPTH_M) / np.log(
        FARTHEST_DEPTH_M / NEAREST_DEPTH_M
    )
    levels = np.rint(245 - 225 * share).astype(np.uint8)  # the ends of turbo are nearly black
    picture = np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_TURBO)[..., ::-1], np.uint8).copy()
    picture[~(depth_m < FARTHEST_DEPTH_M)] = SURFACE
    return picture


def flow_picture(flow_px: Float32Array, rgb: UInt8Array | None, width_px: int) -> UInt8Array:
    """Colour wheel of (H, W, 2) flow: hue is the direction, strength the length; what has none is dark."""
    full_length_px = FULL_FLOW_SHARE * flow_px.shape[1]
    flow_px = _thin(flow_px, width_px)
    u, v = cv2.split(np.nan_to_num(flow_px))
    length_px, angle_deg = cv2.cartToPolar(u, v, angleInDegrees=True)
    strength = np.minimum(np.sqrt(length_px / full_length_px), 1)
    hsv = np.full((*u.shape, 3), (0, 185, 255), np.uint8)
    hsv[..., 0] = angle_deg / 2  # OpenCV counts hue in steps of 2 degrees
    dark = np.full_like(hsv, SURFACE)
    return np.asarray(cv2.blendLinear(cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB), dark, strength, 1 - strength), np.uint8)


ModalityPicture = Callable[[AnyArray, UInt8Array | None, int], UInt8Array]
"""From an image as recorded, the same view in RGB if there is one, and the width at which it will be shown."""


class Modality(NamedTuple):
    """How a modality is shown."""

    title: str
    note: str
    picture: ModalityPicture


MODALITY_PICTURES = {
    "semantic": Modality("Semantic", "", semantic_picture),
    "instance": Modality("Instance", "", instance_picture),
    "depth": Modality("Depth", f"{NEAREST_DEPTH_M:.0f} to {FARTHEST_DEPTH_M:.0f} m", depth_picture),
    "flow": Modality("Optical flow", "", flow_picture),
}


def lidar_picture(points: Table, ego_from_lidar: Float64Array, size_px: int, half_extent_m: float) -> UInt8Array:
    """Points from above, the ego looking up, coloured by tag; the higher one hides the lower one.

    Args:
        points: (N,) rows with x, y, z in metres and a semantic tag; the sensor's frame.
        ego_from_lidar: (4, 4).
        size_px: Width and height of the picture.
        half_extent_m: From the centre of the picture to its edge.
    """
    places_lidar = np.stack([points[axis] for axis in "xyz"], axis=1)
    places = cv2.transform(places_lidar[None], ego_from_lidar[:3])[0] if len(points) else places_lidar
    upwards = np.argsort(places[:, 2], kind="stable")
    colors = semantic_color(points["tag"][upwards].astype(np.uint8))
    colors = np.maximum(colors, (colors // 2 + 80).astype(np.uint8))  # dark tags must show on the dark ground
    return _from_above(places[upwards, :2], colors, 3, size_px, half_extent_m)


def radar_picture(clouds: Sequence[tuple[Table, Float64Array]], size_px: int, half_extent_m: float) -> UInt8Array:
    """Detections of all radars from above, the ego looking up: blue approaches, red recedes, what does neither is grey.

    Args:
        clouds: Of each radar its (N,) rows with x, y, z and doppler_velocity, and (4, 4) ego_from_radar.
        size_px: Width and height of the picture.
        half_extent_m: From the centre of the picture to its edge.
    """
    places = [apply(pose, np.stack([cloud[axis] for axis in "xyz"], axis=1)) for cloud, pose in clouds]
    speed_mps = np.concatenate([np.zeros(0), *(cloud["doppler_velocity"] for cloud, _ in clouds)])
    share = np.clip(speed_mps / FULL_SPEED_MPS, -1.0, 1.0)[:, None]
    end = np.where(share < 0, _APPROACHING, _RECEDING)
    strength = np.sqrt(np.abs(share))
    colors = np.rint(end * strength + np.array(_NEITHER) * (1 - strength)).astype(np.uint8)
    fastest_last = np.argsort(np.abs(share[:, 0]), kind="stable")
    xy_m = np.concatenate([np.zeros((0, 3)), *places])[:, :2]
    return _from_above(xy_m[fastest_last], colors[fastest_last], 4, size_px, half_extent_m)


def _from_above(
    xy_m: Float32Array | Float64Array, colors: UInt8Array, dot_px: int, size_px: int, half_extent_m: float
) -> UInt8Array:
    """(N, 2) points in their colours, later ones on top, over range rings; dots have half of ``dot_px`` pixels."""
    fine = 2 * size_px  # drawn finer, then averaged: soft dots
    picture = np.full((fine, fine, 3), SURFACE, np.uint8)
    place = (half_extent_m - xy_m) / (2 * half_extent_m) * fine
    inside = ((place >= 0) & (place < fine - dot_px + 1)).all(axis=1)
    row, column = place[inside].astype(np.intp).T
    for down, right in np.ndindex(dot_px, dot_px):
        picture[row + down, column + right] = colors[inside]
    picture = np.asarray(cv2.resize(picture, (size_px, size_px), interpolation=cv2.INTER_AREA), np.uint8)
    _draw_rings(picture, half_extent_m)
    _draw_ego(picture)
    return picture


def bev_picture(labels: UInt16Array, size_px: int) -> UInt8Array:
    """Bird's-eye-view labels, the ego looking up, in the palette's colours but on a dark ground.

    Args:
        labels: (H, W) uint16, bit k for class k.
        size_px: Width of the picture.
    """
    picture = bev_color(labels)
    picture[labels == 0] = SURFACE
    height = round(size_px * labels.shape[0] / labels.shape[1])
    way = cv2.INTER_AREA if size_px < labels.shape[1] else cv2.INTER_CUBIC
    picture = np.asarray(cv2.resize(picture, (size_px, height), interpolation=way), np.uint8)
    _draw_ego(picture)
    return picture


def _draw_ego(picture: UInt8Array) -> None:
    """The ego: an arrow head in the middle that looks up."""
    height, width = picture.shape[:2]
    arrow = np.array([[0, -1], [0.62, 0.8], [0, 0.45], [-0.62, 0.8]]) * width / 55 + [width / 2, height / 2]
    cv2.fillPoly(picture, [np.rint(arrow * 16).astype(np.int32)], ACCENT, cv2.LINE_AA, 4)


def _draw_rings(picture: UInt8Array, half_extent_m: float) -> None:
    """Range rings every 20 m with their radius."""
    size = len(picture)
    centre, px_per_m = size / 2, size / (2 * half_extent_m)
    lines = picture.copy()
    radii_m = range(20, int(half_extent_m) + 1, 20)
    for radius_m in radii_m:
        _draw_circle(lines, centre, radius_m * px_per_m)
    np.copyto(picture, cv2.addWeighted(picture, 0.45, lines, 0.55, 0))
    for radius_m in radii_m:
        diagonal = radius_m * px_per_m * np.sqrt(0.5)
        draw_text(picture, f"{radius_m} m", centre + diagonal + 3, centre + diagonal + 3, size=size / 40, color=DIM)


def _draw_circle(picture: UInt8Array, centre: float, radius: float) -> None:
    fine = 16  # OpenCV's fixed-point coordinates: 4 bits
    middle = round(centre * fine)
    cv2.circle(picture, (middle, middle), round(radius * fine), LINE, 1, cv2.LINE_AA, 4)


@lru_cache(maxsize=1)
def _id_colors() -> UInt8Array:
    """(65536, 3) bright colours, far apart for neighbouring ids: hues step by the golden angle."""
    ids = np.arange(1 << 16)
    hue = (ids * 111.246 + 17) % 180
    saturation, value = 120 + ids * 37 % 100, 205 + ids * 23 % 51
    hsv = np.stack([hue, saturation, value], axis=-1).astype(np.uint8)
    return np.asarray(cv2.cvtColor(hsv[None], cv2.COLOR_HSV2RGB)[0], np.uint8)


def _thin(image: AnyArray, width_px: int) -> AnyArray:
    """Every n-th pixel and row: labels must not be averaged, and twice the width to show is enough to colour."""
    step = max(1, image.shape[1] // (2 * width_px))
    return np.ascontiguousarray(image[::step, ::step])
