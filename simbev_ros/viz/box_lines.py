"""3D boxes as lines: in a camera's picture, cut off where the camera does not see, and from above."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.geometry.camera import PinholeCamera
from simbev_ros.scene.state import map_from_actors
from simbev_ros.types import BoolArray, Float64Array, Int64Array, Table

NEAREST_M = 0.2
"""Nothing closer to the camera's plane than this is drawn."""

_MARGIN = 0.1
"""Lines reach this share of the image beyond its border."""

_PIECES = 12
"""Each line is cut into so many, that it can bend with the lens and vanish behind things."""

_CORNERS = np.array([[x, y, z] for x in (0.5, -0.5) for y in (0.5, -0.5) for z in (-0.5, 0.5)])
"""(8, 3) corners of the unit box; the first four are the front."""

_HEADING = np.array([[0.0, 0.0, -0.5], [0.5, 0.0, -0.5]])
"""(2, 3) ends of a line on the ground, from the middle to the front."""

_EDGES = np.array([(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1] + [(8, 9)])
"""(13, 2) corners that differ along one axis, and the heading."""

_FRONT = np.array([0, 1, 3, 2])
"""Corners around the front face."""


@dataclass(frozen=True, slots=True)
class Lines:
    """Short straight lines in a picture.

    Attributes:
        pixels: (S, 2, 2) x and y of their ends, a pixel's centre at integers.
        depth_m: (S,) of their middles, along the optical axis.
        row: (S,) row of the box that each belongs to.
    """

    pixels: Float64Array
    depth_m: Float64Array
    row: Int64Array


def wireframes(boxes: Table, camera: PinholeCamera, optical_from_map: Float64Array) -> Lines:
    """The edges and headings of (N,) rows of /ego/boxes, as far as a camera has them before it."""
    points = _placed(boxes, np.concatenate([_CORNERS, _HEADING]), optical_from_map)
    lines = points[:, _EDGES].reshape(-1, 2, 3)
    row = np.repeat(np.arange(len(boxes)), len(_EDGES))
    lines, kept = _clipped(lines, _frustum(camera))
    share = np.linspace(0.0, 1.0, _PIECES + 1)[:, None]
    ends = lines[:, :1] * (1.0 - share) + lines[:, 1:] * share
    pieces = np.stack([ends[:, :-1], ends[:, 1:]], axis=2).reshape(-1, 2, 3)
    pixels = camera.project(pieces.reshape(-1, 3)).reshape(-1, 2, 2)
    seen = np.isfinite(pixels).all(axis=(1, 2))
    return Lines(pixels[seen], pieces[seen, :, 2].mean(axis=1), np.repeat(row[kept], _PIECES)[seen])


def fronts(boxes: Table, camera: PinholeCamera, optical_from_map: Float64Array) -> tuple[Float64Array, Int64Array]:
    """The front faces that look towards a camera and lie wholly before it: (F, 4, 2) pixels, and (F,) their rows."""
    faces = _placed(boxes, _CORNERS[_FRONT], optical_from_map)
    outward = np.cross(faces[:, 1] - faces[:, 0], faces[:, 3] - faces[:, 0])
    seen = (faces[..., 2] > NEAREST_M).all(axis=1) & ((outward * faces[:, 0]).sum(axis=1) < 0.0)
    pixels = camera.project(faces[seen].reshape(-1, 3)).reshape(-1, 4, 2)
    finite = np.isfinite(pixels).all(axis=(1, 2))
    return pixels[finite], np.flatnonzero(seen)[finite]


def outlines(boxes: Table, frame_from_map: Float64Array) -> Float64Array:
    """(N, 6, 2) boxes from above, x and y in metres, in a frame whose z points up.

    Of each its left front corner, the other three in turn to the right front one, and the ends of its heading.
    """
    bottom = np.concatenate([_CORNERS[[0, 4, 6, 2]], _HEADING])
    return _placed(boxes, bottom, frame_from_map)[..., :2]


def _placed(boxes: Table, points: Float64Array, frame_from_map: Float64Array) -> Float64Array:
    """(N, P, 3) places in a frame of (P, 3) points of the unit box, of (N,) rows of /ego/boxes, metres."""
    size_m = np.stack([boxes["length"], boxes["width"], boxes["height"]], axis=1).astype(np.float64)
    frame_from_box = frame_from_map @ map_from_actors(boxes)
    placed: Float64Array = (points * size_m[:, None]) @ frame_from_box[:, :3, :3].swapaxes(1, 2)
    return placed + frame_from_box[:, None, :3, 3]


def _clipped(lines: Float64Array, planes: Float64Array) -> tuple[Float64Array, Int64Array]:
    """Parts of (N, 2, 3) lines where p · n + d ≥ 0 for all (P, 4) planes (n, d), and (M,) which lines they are of."""
    kept = np.arange(len(lines))
    for plane in planes:
        height = lines @ plane[:3] + plane[3]
        some: BoolArray = (height > 0.0).any(axis=1)
        lines, height, kept = lines[some], height[some], kept[some]
        share = height[:, :1] / np.where(height[:, :1] == height[:, 1:], 1.0, height[:, :1] - height[:, 1:])
        crossing = lines[:, 0] + share * (lines[:, 1] - lines[:, 0])
        lines = np.where(height[..., None] >= 0.0, lines, crossing[:, None])
    return lines, kept


def _frustum(camera: PinholeCamera) -> Float64Array:
    """(5, 4) planes, n and d, that hold all that a camera sees and a little more, optical frame."""
    x, y = np.linspace(-0.5, camera.width_px - 0.5, 9), np.linspace(-0.5, camera.height_px - 0.5, 9)
    rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))[:, :2]
    low, high = rays.min(axis=0), rays.max(axis=0)
    low, high = low - _MARGIN * (high - low), high + _MARGIN * (high - low)
    return np.array(
        [
            [0.0, 0.0, 1.0, -NEAREST_M],
            [1.0, 0.0, -low[0], 0.0],
            [-1.0, 0.0, high[0], 0.0],
            [0.0, 1.0, -low[1], 0.0],
            [0.0, -1.0, high[1], 0.0],
        ]
    )
