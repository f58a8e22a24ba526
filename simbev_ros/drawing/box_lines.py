"""3D boxes as lines: projected into a camera's picture, clipped to what it can see, or seen from above.

Rows of /ego/boxes and a camera or a frame enter; pixels of line segments, or corners in meters, leave.
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array, Table
from simbev_ros.schema.scene.state import map_from_actors

MIN_DEPTH_M = 0.2
"""Minimum depth at which anything is drawn."""

_MARGIN = 0.1
"""Lines extend beyond the image's border by this share of its size."""

_PIECES, _FISHEYE_PIECES = 12, 64
"""Number of segments into which each line is cut, so that it can follow lens distortion and be partly occluded; in the
view of a fisheye, lines are not clipped before and turn further."""

_CORNERS = np.array([[x, y, z] for x in (0.5, -0.5) for y in (0.5, -0.5) for z in (-0.5, 0.5)])
"""(8, 3) corners of the unit box; the first four are the front face."""

_HEADING = np.array([[0.0, 0.0, -0.5], [0.5, 0.0, -0.5]])
"""(2, 3) ends of the heading line on the unit box's bottom, from the middle to the front."""

_EDGES = np.array([(a, b) for a in range(8) for b in range(a + 1, 8) if (a ^ b).bit_count() == 1] + [(8, 9)])
"""(13, 2) indices of the ends of all lines: the 12 edges (corners that differ along one axis), and the heading."""

_FRONT = np.array([0, 1, 3, 2])
"""(4,) indices of the corners around the front face, in order."""


@dataclass(frozen=True, slots=True)
class Lines:
    """S short straight line segments in a picture.

    Attributes:
        pixels: (S, 2, 2) x and y of both ends; pixel centers are at integers.
        depth_m: (S,) depth of the middle of each segment, as in depth images.
        row: (S,) row of the box that each segment belongs to.
    """

    pixels: Float64Array
    depth_m: Float64Array
    row: Int64Array


def wireframes(boxes: Table, camera: PinholeCamera, optical_from_map: Float64Array) -> Lines:
    """Edges and heading lines of boxes in a camera's picture, clipped to the camera's view.

    Args:
        boxes: (N,) rows of /ego/boxes.
        camera: Model of the camera.
        optical_from_map: (4, 4).
    """
    points = _points_on_boxes(boxes, np.concatenate([_CORNERS, _HEADING]), optical_from_map)
    lines = points[:, _EDGES].reshape(-1, 2, 3)
    row = np.repeat(np.arange(len(boxes)), len(_EDGES))
    if isinstance(camera, FisheyeCamera):
        kept, count, share = np.arange(len(lines)), _FISHEYE_PIECES, _shares_at_even_angles(lines)
    else:
        lines, kept = _clip(lines, _frustum(camera))
        count, share = _PIECES, np.linspace(0.0, 1.0, _PIECES + 1)[:, None]
    ends = lines[:, :1] * (1.0 - share) + lines[:, 1:] * share
    pieces = np.stack([ends[:, :-1], ends[:, 1:]], axis=2).reshape(-1, 2, 3)
    pixels = camera.project(pieces.reshape(-1, 3)).reshape(-1, 2, 2)
    depth_m = camera.depth_m(pieces.mean(axis=1))
    seen = np.isfinite(pixels).all(axis=(1, 2)) & (depth_m > MIN_DEPTH_M)
    return Lines(pixels[seen], depth_m[seen], np.repeat(row[kept], count)[seen])


def front_faces(boxes: Table, camera: PinholeCamera, optical_from_map: Float64Array) -> tuple[Float64Array, Int64Array]:
    """Front faces of boxes that face a camera and lie entirely in front of it.

    Args:
        boxes: (N,) rows of /ego/boxes.
        camera: Model of the camera.
        optical_from_map: (4, 4).

    Returns:
        (F, 4, 2) pixels of the corners, x and y, and (F,) rows of the boxes.
    """
    faces = _points_on_boxes(boxes, _CORNERS[_FRONT], optical_from_map)
    outward = np.cross(faces[:, 1] - faces[:, 0], faces[:, 3] - faces[:, 0])
    is_ahead = camera.depth_m(faces.reshape(-1, 3)).reshape(-1, 4) > MIN_DEPTH_M
    seen = is_ahead.all(axis=1) & ((outward * faces[:, 0]).sum(axis=1) < 0.0)
    pixels = camera.project(faces[seen].reshape(-1, 3)).reshape(-1, 4, 2)
    finite = np.isfinite(pixels).all(axis=(1, 2))
    return pixels[finite], np.flatnonzero(seen)[finite]


def box_outlines(boxes: Table, frame_from_map: Float64Array) -> Float64Array:
    """Footprints and headings of (N,) boxes from above: (N, 6, 2) x and y in meters, in a frame whose z points up.

    For each box: its left front corner, the other three in turn up to the right front one, and both ends of the heading
    line.
    """
    bottom = np.concatenate([_CORNERS[[0, 4, 6, 2]], _HEADING])
    return _points_on_boxes(boxes, bottom, frame_from_map)[..., :2]


def _points_on_boxes(boxes: Table, points: Float64Array, frame_from_map: Float64Array) -> Float64Array:
    """(N, P, 3) positions, meters, in a frame, of (P, 3) points of the unit box on each of (N,) rows of /ego/boxes."""
    size_m = np.stack([boxes["length"], boxes["width"], boxes["height"]], axis=1).astype(np.float64)
    frame_from_box = frame_from_map @ map_from_actors(boxes)
    rotated_m: Float64Array = (points * size_m[:, None]) @ frame_from_box[:, :3, :3].swapaxes(1, 2)
    return rotated_m + frame_from_box[:, None, :3, 3]


def _clip(lines: Float64Array, planes: Float64Array) -> tuple[Float64Array, Int64Array]:
    """Clip (N, 2, 3) lines to p · n + d ≥ 0 for all (P, 4) planes (n, d): (M, 2, 3) lines, and (M,) their indices."""
    kept = np.arange(len(lines))
    for plane in planes:
        height = lines @ plane[:3] + plane[3]
        some: BoolArray = (height > 0.0).any(axis=1)
        lines, height, kept = lines[some], height[some], kept[some]
        share = height[:, :1] / np.where(height[:, :1] == height[:, 1:], 1.0, height[:, :1] - height[:, 1:])
        crossing = lines[:, 0] + share * (lines[:, 1] - lines[:, 0])
        lines = np.where(height[..., None] >= 0.0, lines, crossing[:, None])
    return lines, kept


def _shares_at_even_angles(lines: Float64Array) -> Float64Array:
    """(N, P + 1, 1) shares of the way along (N, 2, 3) lines to which the direction turns evenly (law of sines)."""
    start_m, end_m = np.linalg.norm(lines, axis=2).T[..., None]
    across = np.linalg.norm(np.cross(lines[:, 0], lines[:, 1]), axis=1)
    angle = np.maximum(np.arctan2(across, (lines[:, 0] * lines[:, 1]).sum(axis=1)), 1e-9)[:, None]
    turned = np.linspace(0.0, 1.0, _FISHEYE_PIECES + 1) * angle
    before, after = start_m * np.sin(turned), end_m * np.sin(angle - turned)
    return (before / np.maximum(before + after, 1e-300))[..., None]


def _frustum(camera: PinholeCamera) -> Float64Array:
    """(5, 4) planes, n and d, optical frame, that enclose a camera's view and a small margin."""
    x, y = np.linspace(-0.5, camera.width_px - 0.5, 9), np.linspace(-0.5, camera.height_px - 0.5, 9)
    rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))[:, :2]
    low, high = rays.min(axis=0), rays.max(axis=0)
    low, high = low - _MARGIN * (high - low), high + _MARGIN * (high - low)
    return np.array(
        [
            [0.0, 0.0, 1.0, -MIN_DEPTH_M],
            [1.0, 0.0, -low[0], 0.0],
            [-1.0, 0.0, high[0], 0.0],
            [0.0, 1.0, -low[1], 0.0],
            [0.0, -1.0, high[1], 0.0],
        ]
    )
