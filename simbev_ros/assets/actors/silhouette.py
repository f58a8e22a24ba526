"""Approximates an actor's mesh by boxes, for displays that draw primitives only.

The mesh is cut at equally spaced heights. Along each cut, neighboring stretches of nearly the same width become one
box.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.materials import Material
from simbev_ros.foundation.types import AnyArray, Float64Array

_LAYERS = 16
_STATION_M = 0.1
_WIDTH_TOLERANCE_M = 0.12
_MIN_SIDE_M = 0.02
"""Stretches that are shorter or narrower are antennas, wipers and the like."""
_GLASS_RGB = (40, 44, 48)
_GLASS_SHARE = 0.25
"""Share of glass in a cut from which on the layer is drawn as windows; pillars and seats are cut as well."""


class SilhouetteBox(NamedTuple):
    """A box in the actor frame, aligned with its axes.

    Attributes:
        center_m: Center.
        size_m: Length, width, height.
        rgb: Color 0..255, sRGB.
    """

    center_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    rgb: tuple[int, int, int]


class WheelCylinder(NamedTuple):
    """A wheel in the actor frame, with its axis parallel to y."""

    center_m: tuple[float, float, float]
    radius_m: float
    width_m: float


class _Stretch(NamedTuple):
    """A rectangle around a part of an outline, in the actor frame."""

    start_m: float
    end_m: float
    right_m: float
    left_m: float

    @property
    def width_m(self) -> float:
        """Extent in y."""
        return self.left_m - self.right_m

    @property
    def center_m(self) -> tuple[float, float]:
        """Center in x and y."""
        return (self.start_m + self.end_m) / 2.0, (self.right_m + self.left_m) / 2.0


def silhouette_boxes(model: ActorModel, paint: int) -> list[SilhouetteBox]:
    """Boxes that approximate a vehicle in rest pose without its wheels.

    Args:
        model: Model of the vehicle.
        paint: Color of the paint, 0xRRGGBB.
    """
    mesh = model.mesh
    wheels = [index for index, part in enumerate(model.parts) if part.spins]
    triangles = mesh.triangles[~np.isin(mesh.part[mesh.triangles[:, 0]], wheels)]
    corners_m = mesh.vertices[triangles].astype(np.float64)
    bottom_m, top_m = corners_m[..., 2].min(), corners_m[..., 2].max()
    height_m = (top_m - bottom_m) / _LAYERS
    boxes = []
    for layer in range(_LAYERS):
        middle_m = bottom_m + (layer + 0.5) * height_m
        segments_m, cut = _section(corners_m, middle_m)
        points_m, source = _points_along(segments_m)
        is_glass = mesh.material[triangles[cut, 0]] == Material.GLASS
        rgb = _GLASS_RGB if np.mean(is_glass[source]) > _GLASS_SHARE else (paint >> 16, paint >> 8 & 255, paint & 255)
        for stretch in _stretches(points_m):
            size_m = (stretch.end_m - stretch.start_m, stretch.width_m, height_m)
            if min(size_m) > _MIN_SIDE_M:
                boxes.append(SilhouetteBox((*stretch.center_m, middle_m), size_m, rgb))
    return boxes


def wheel_cylinders(model: ActorModel) -> list[WheelCylinder]:
    """Wheels of a vehicle, straight ahead."""
    cylinders = []
    for index, part in enumerate(model.parts):
        if part.spins:
            vertices_m = model.mesh.vertices[model.mesh.part == index].astype(np.float64)
            low_m, high_m = vertices_m.min(axis=0), vertices_m.max(axis=0)
            x_m, y_m, z_m = ((low_m + high_m) / 2.0).tolist()
            _, width_m, height_m = (high_m - low_m).tolist()
            cylinders.append(WheelCylinder((x_m, y_m, z_m), height_m / 2.0, width_m))
    return cylinders


def _section(corners_m: Float64Array, height_m: float) -> tuple[Float64Array, AnyArray]:
    """Cut (T, 3, 3) triangles at a height: (S, 2, 2) segments in x and y, and the S indices of the triangles."""
    above = corners_m[..., 2] > height_m
    cut = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    # The corner that is alone on its side is the end of both edges that cross.
    lone_above = above[cut].sum(axis=1) == 1
    alone = np.where(lone_above, above[cut].argmax(axis=1), above[cut].argmin(axis=1))
    rows = np.arange(len(cut))
    lone_m = corners_m[cut, alone]
    ends_m = np.stack([corners_m[cut[rows], (alone + step) % 3] for step in (1, 2)], axis=1)
    share = (height_m - lone_m[:, None, 2]) / (ends_m[..., 2] - lone_m[:, None, 2])
    segments_m = lone_m[:, None, :2] + share[..., None] * (ends_m[..., :2] - lone_m[:, None, :2])
    return segments_m, cut


def _points_along(segments_m: Float64Array) -> tuple[Float64Array, AnyArray]:
    """(P, 2) points on (S, 2, 2) segments, at most half a station apart, and the P indices of their segments."""
    lengths_m = np.linalg.norm(segments_m[:, 1] - segments_m[:, 0], axis=1)
    counts = np.ceil(lengths_m / (_STATION_M / 2.0)).astype(np.int64) + 1
    source = np.repeat(np.arange(len(counts)), counts)
    step = np.arange(len(source)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = step / np.maximum(counts - 1, 1)[source]
    return segments_m[source, 0] + share[:, None] * (segments_m[source, 1] - segments_m[source, 0]), source


def _stretches(points_m: Float64Array) -> Iterator[_Stretch]:
    """Divide (P, 2) points of an outline into stretches of nearly constant width."""
    station = np.floor(points_m[:, 0] / _STATION_M).astype(np.int64)
    station -= station.min()
    low_m, high_m = np.full((2, int(station.max()) + 1, 2), [[[np.inf]], [[-np.inf]]])
    np.minimum.at(low_m, station, points_m)
    np.maximum.at(high_m, station, points_m)
    current: _Stretch | None = None
    for (start_m, right_m), (end_m, left_m) in zip(low_m.tolist(), high_m.tolist(), strict=True):
        if start_m > end_m:  # a gap
            following = None
        elif current is not None and abs(left_m - right_m - current.width_m) < _WIDTH_TOLERANCE_M:
            current = _Stretch(current.start_m, end_m, min(current.right_m, right_m), max(current.left_m, left_m))
            continue
        else:
            following = _Stretch(start_m, end_m, right_m, left_m)
        if current is not None:  # neighbors meet, so that the outline has no slits
            yield current if following is None else current._replace(end_m=start_m)
        current = following
    if current is not None:
        yield current
