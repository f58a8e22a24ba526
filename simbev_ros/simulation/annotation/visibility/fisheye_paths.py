"""Outlines of objects in the image of a fisheye: great circles on the sphere of directions become polylines.

Enters: ``Outlines`` in the optical frame; leaves: ``Contours`` that a pinhole camera would map to the same pixels.
Outside the image circle, the radius continues linearly, so that the whole sphere becomes a disk, and the direction
right behind the camera becomes its rim. An object that covers this direction gets the rim as one more contour.
"""

import numpy as np

from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.simulation.annotation.visibility.contours import Contours, Outlines

_FAR_RAD = 2.6
"""Angle to the optical axis beyond which only the topology of a contour matters."""

_STEP_PX = 0.35
"""Length of a piece of a contour in the image where the focal length is 1 pixel; it grows with the square root."""

_MAX_TURN_RAD = 0.1
_RIM_SEGMENTS = 128


def map_outlines(outlines: Outlines, camera: FisheyeCamera) -> Contours:
    """Contours that a pinhole camera of the same intrinsics would see in the same pixels, accurate to 0.05 pixel."""
    start, end = np.moveaxis(outlines.ends_m / np.linalg.norm(outlines.ends_m, axis=0), 1, 0)
    angle = np.arctan2(np.linalg.norm(np.cross(start, end, axis=0), axis=0), (start * end).sum(axis=0))
    step = _STEP_PX / np.sqrt(max(camera.fx_px, camera.fy_px))
    count = np.maximum(np.ceil(angle / step), 1.0).astype(np.int64)
    segment, offset = ragged_indices(count)
    start, end, angle, count = start[:, segment], end[:, segment], angle[segment], count[segment]
    ends = np.stack([_between(start, end, angle, share / count) for share in (offset, offset + 1)], axis=1)
    piece, plane = _around_the_rim(ends, camera)
    original, rim = segment[piece], _rim(camera)
    return Contours(
        np.concatenate([outlines.slot[original], np.repeat(outlines.behind, _RIM_SEGMENTS)]),
        np.concatenate([outlines.sign[original], np.ones(len(outlines.behind) * _RIM_SEGMENTS, np.int64)]),
        np.concatenate([plane, np.tile(rim, len(outlines.behind))], axis=2),
    )


def _between(start: Float64Array, end: Float64Array, angle: Float64Array, share: Float64Array) -> Float64Array:
    """(3, N) directions on great circles from (3, N) ``start`` to ``end``; at share 0 and 1 bit-equal to them."""
    whole = np.sin(angle)
    tiny = whole < 1e-9
    whole = np.where(tiny, 1.0, whole)
    from_start = np.where(tiny, 1.0 - share, np.sin(angle * (1.0 - share)) / whole)
    return start * from_start + end * np.where(tiny, share, np.sin(angle * share) / whole)


def _around_the_rim(ends: Float64Array, camera: FisheyeCamera) -> tuple[Int64Array, Float64Array]:
    """Map (3, 2, N) ends of pieces to the plane z = 1: (2, 2, M) ends, and (M,) the pieces that they are from.

    Near the rim of the disk, short pieces of great circles turn far around the center and are divided further.
    """
    across = np.hypot(ends[0], ends[1])
    angle = np.arctan2(across, ends[2])
    radius = camera.extended_radius(angle)
    plane = ends[:2] * (radius / np.where(across > 0.0, across, 1.0))
    turn = np.arctan2(plane[1], plane[0])
    swing = (turn[1] - turn[0] + np.pi) % (2.0 * np.pi) - np.pi
    count = np.where(angle.min(axis=0) > _FAR_RAD, np.ceil(np.abs(swing) / _MAX_TURN_RAD), 1.0).clip(min=1.0)
    piece, offset = ragged_indices(count.astype(np.int64))
    shares = np.stack([offset, offset + 1]) / count[piece]
    turns = turn[0, piece] + shares * swing[piece]
    radii = radius[0, piece] * (1.0 - shares) + radius[1, piece] * shares
    inner = np.stack([np.cos(turns), np.sin(turns)]) * radii
    start, end = plane[:, 0, piece][:, None], plane[:, 1, piece][:, None]
    return piece, np.where(shares == 0.0, start, np.where(shares == 1.0, end, inner))


def _rim(camera: FisheyeCamera) -> Float64Array:
    """(2, 2, S) segments around the disk, with its inside on their left as the camera sees them."""
    turn = np.linspace(2.0 * np.pi, 0.0, _RIM_SEGMENTS + 1)
    radius = camera.extended_radius(np.array(np.pi)) / np.cos(np.pi / _RIM_SEGMENTS)
    points = radius * np.stack([np.cos(turn), np.sin(turn)])
    points[:, -1] = points[:, 0]
    return np.stack([points[:, :-1], points[:, 1:]], axis=1)
