"""Renders the static scene from straight above: every pixel shows the topmost surface in slanting sunlight.

Tiles of meshes enter; an RGB picture, north up, leaves. Runs on the CPU, without OpenGL.
"""

from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.foundation.types import Float32Array, Float64Array, Int64Array, UInt8Array

_SUN = np.array([-0.45, 0.55, 0.70]) / np.linalg.norm([-0.45, 0.55, 0.70])
_SKY_SHARE = 0.42
_SHADOW = 0.45
_EXPOSURE = 1.7
_MAX_HEIGHT_M = 60.0
_SAMPLES = 4_000_000
"""Number of pixels that are tested in one batch; limits the memory."""
_OVERSAMPLING = 2
_LAND_RGB = (112, 122, 92)


def orthophoto(tiles: Sequence[Tile], center_m: Float64Array, extent_m: float, size_px: int) -> UInt8Array:
    """Render a square picture, north up.

    Args:
        tiles: Tiles of the static scene; those outside the picture are skipped.
        center_m: (2,) center of the picture, map frame.
        extent_m: Side of the picture in meters.
        size_px: Side of the picture in pixels.

    Returns:
        (size_px, size_px, 3) uint8 RGB.
    """
    count = size_px * _OVERSAMPLING
    cell_m = extent_m / count
    corner_m = np.array([center_m[0] - extent_m / 2.0, center_m[1] + extent_m / 2.0])
    height_m = np.full(count * count, -np.inf, np.float32)
    light = np.zeros((count * count, 3), np.uint8)
    light[:] = _LAND_RGB
    for tile in tiles:
        xyz = tile.mesh.vertices + tile.origin_m
        points = np.column_stack([(xyz[:, 0] - corner_m[0]) / cell_m, (corner_m[1] - xyz[:, 1]) / cell_m, xyz[:, 2]])
        if len(points) and np.all(points[:, :2].max(axis=0) > 0) and np.all(points[:, :2].min(axis=0) < count):
            _draw(points, tile.mesh, height_m, light, count)
    shaded = _draw_shadows(light.reshape(count, count, 3), height_m.reshape(count, count), cell_m)
    picture = cv2.resize(shaded, (size_px, size_px), interpolation=cv2.INTER_AREA)
    return np.asarray(picture, np.uint8)


def _draw(points: Float64Array, mesh: Mesh, height_m: Float32Array, light: UInt8Array, count: int) -> None:
    """Draw one mesh into the height and color buffers; ``points`` are its vertices as column, row and height."""
    corners = points[mesh.triangles]
    color = _lit_colors(mesh)
    for chosen, pixels, depth_m in _covered_pixels(corners, count):
        above = depth_m > height_m[pixels]
        chosen, pixels, depth_m = chosen[above], pixels[above], depth_m[above]
        order = np.argsort(depth_m, kind="stable")  # of equal indices the last assignment remains: the highest
        height_m[pixels[order]] = depth_m[order]
        light[pixels[order]] = color[chosen[order]]


def _lit_colors(mesh: Mesh) -> UInt8Array:
    """(T, 3) uint8 sRGB color of each triangle in sun and sky light."""
    first = mesh.triangles[:, 0]
    normal = mesh.normals[mesh.triangles].mean(axis=1)
    share = _SKY_SHARE + (1.0 - _SKY_SHARE) * np.clip(normal @ _SUN, 0.0, 1.0) / _SUN[2]
    linear = _EXPOSURE * (mesh.color[first] / 255.0) ** 2.2 * share[:, None]
    toned = linear * (1.0 + 0.25 * linear) / (1.0 + linear) * 1.6  # tone mapping, so that bright roofs keep their shape
    return np.asarray(255.0 * np.clip(toned, 0.0, 1.0) ** (1.0 / 2.2), np.uint8)


def _covered_pixels(corners: Float64Array, count: int) -> Iterator[tuple[Int64Array, Int64Array, Float32Array]]:
    """Rasterize triangles in batches of similar size: triangle, pixel index and height of each covered pixel."""
    low = np.maximum(np.ceil(corners[:, :, :2].min(axis=1) - 0.5), 0).astype(np.int64)
    high = np.minimum(np.floor(corners[:, :, :2].max(axis=1) - 0.5), count - 1).astype(np.int64)
    edge_one, edge_two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = edge_one[:, 0] * edge_two[:, 1] - edge_one[:, 1] * edge_two[:, 0]
    side = (high - low + 1).max(axis=1)
    usable = np.all(high >= low, axis=1) & (np.abs(area) > 1e-9)
    size = 1
    while size < 2 * count:
        in_class = np.flatnonzero(usable & (side <= size) & (side > size // 2))
        for chosen in np.array_split(in_class, max(1, len(in_class) * size * size // _SAMPLES)):
            if len(chosen):
                yield _samples(chosen, size, low, high, corners[chosen, 0], edge_one, edge_two, area, count)
        size *= 2


def _samples(
    chosen: Int64Array,
    size: int,
    low: Int64Array,
    high: Int64Array,
    corner: Float64Array,
    edge_one: Float64Array,
    edge_two: Float64Array,
    area: Float64Array,
    count: int,
) -> tuple[Int64Array, Int64Array, Float32Array]:
    """The pixels inside each triangle, of a square of ``size`` pixels at the corner of its bounds."""
    grid = np.stack(np.meshgrid(np.arange(size), np.arange(size)), axis=-1).reshape(1, -1, 2)
    pixel = low[chosen][:, None, :] + grid
    offset = pixel + 0.5 - corner[:, None, :2]
    one, two, twice_area = edge_one[chosen][:, None], edge_two[chosen][:, None], area[chosen][:, None]
    first = (offset[..., 0] * two[..., 1] - offset[..., 1] * two[..., 0]) / twice_area
    second = (one[..., 0] * offset[..., 1] - one[..., 1] * offset[..., 0]) / twice_area
    inside = (first >= 0) & (second >= 0) & (first + second <= 1) & np.all(pixel <= high[chosen][:, None], axis=-1)
    height_m = corner[:, None, 2] + first * one[..., 2] + second * two[..., 2]
    triangle = np.broadcast_to(chosen[:, None], inside.shape)
    return triangle[inside], (pixel[..., 1] * count + pixel[..., 0])[inside], height_m[inside].astype(np.float32)


def _draw_shadows(picture: UInt8Array, height_m: Float32Array, cell_m: float) -> UInt8Array:
    """Darken the pixels that are in the shadow of higher ones toward the sun."""
    run = _SUN[:2] / np.abs(_SUN[:2]).max()
    rise_m = cell_m * float(np.linalg.norm(run)) * _SUN[2] / float(np.linalg.norm(_SUN[:2]))
    shadow = np.zeros(height_m.shape, bool)
    known_m = height_m[np.isfinite(height_m)]
    max_height_m = min(_MAX_HEIGHT_M, float(np.ptp(known_m))) if known_m.size else 0.0
    for step in range(1, int(max_height_m / rise_m) + 1):
        east, south = round(step * run[0]), round(-step * run[1])
        here, there = _overlap(height_m.shape, south, east)
        shadow[here] |= height_m[there] > height_m[here] + step * rise_m + 0.1
    factor = cv2.GaussianBlur(np.where(shadow, _SHADOW, 1.0), (0, 0), 1.0)
    return np.asarray(picture * factor[..., None] ** (1.0 / 1.6), np.uint8)


def _overlap(shape: tuple[int, ...], rows: int, columns: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Overlapping slices of a picture and of the same picture moved up by ``rows`` and left by ``columns`` pixels."""
    shifts = (rows, columns)
    here = tuple(slice(max(0, -shift), size - max(0, shift)) for shift, size in zip(shifts, shape, strict=True))
    there = tuple(slice(max(0, shift), size - max(0, -shift)) for shift, size in zip(shifts, shape, strict=True))
    return here, there
