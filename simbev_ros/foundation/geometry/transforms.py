"""Rigid transforms as (4, 4) float64 matrices, and their conversion from and to roll-pitch-yaw and quaternions.

Matrices are named target_from_source. Angles follow REP-103: right-handed, roll pitch yaw about the fixed axes x y z.
"""

import numpy as np

from simbev_ros.foundation.types import Float64Array


def rotations_from_rpy(rpy_rad: Float64Array) -> Float64Array:
    """(…, 3, 3) rotation matrices Rz(yaw) Ry(pitch) Rx(roll) of (…, 3) roll, pitch, yaw in radians."""
    rpy_rad = np.asarray(rpy_rad, np.float64)
    (cr, cp, cy), (sr, sp, sy) = np.moveaxis(np.cos(rpy_rad), -1, 0), np.moveaxis(np.sin(rpy_rad), -1, 0)
    return np.stack(
        [
            np.stack([cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], axis=-1),
            np.stack([sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], axis=-1),
            np.stack([-sp, cp * sr, cp * cr], axis=-1),
        ],
        axis=-2,
    )


def matrices_from_xyz_rpy(xyz_m: Float64Array, rpy_rad: Float64Array) -> Float64Array:
    """(…, 4, 4) transforms, parent from child, of (…, 3) positions in meters and (…, 3) roll, pitch, yaw in radians."""
    xyz_m = np.asarray(xyz_m, np.float64)
    matrices = np.zeros((*xyz_m.shape[:-1], 4, 4))
    matrices[..., :3, :3] = rotations_from_rpy(rpy_rad)
    matrices[..., :3, 3] = xyz_m
    matrices[..., 3, 3] = 1.0
    return matrices


def inverse(target_from_source: Float64Array) -> Float64Array:
    """(…, 4, 4) inverses (source from target) of (…, 4, 4) rigid transforms."""
    rotation_t = np.swapaxes(target_from_source[..., :3, :3], -1, -2)
    result = np.zeros_like(target_from_source)
    result[..., :3, :3] = rotation_t
    result[..., :3, 3] = -(rotation_t @ target_from_source[..., :3, 3:])[..., 0]
    result[..., 3, 3] = 1.0
    return result


def apply(target_from_source: Float64Array, points_source: Float64Array) -> Float64Array:
    """Transform (N, 3) points from the source frame to the target frame."""
    return points_source @ target_from_source[:3, :3].T + target_from_source[:3, 3]


def with_signs_of(quaternions: Float64Array, before: Float64Array) -> Float64Array:
    """(N, 4) the same rotations in order of time, each with the sign that is nearer to the one before it.

    q and -q are the same rotation, but readers interpolate and subtract them.

    Args:
        quaternions: (N, 4) unit quaternions.
        before: (4,) the one before the first; the identity gives it a real part of 0 or more.
    """
    previous = np.concatenate([before[None], quaternions[:-1]])
    flips = np.where(np.einsum("ni,ni->n", quaternions, previous) < 0.0, -1.0, 1.0)
    return quaternions * np.cumprod(flips)[:, None] + 0.0


def quaternion_from_rpy(rpy_rad: Float64Array) -> Float64Array:
    """(…, 4) unit quaternions x y z w of (…, 3) roll, pitch, yaw in radians (Rz Ry Rx)."""
    half = np.asarray(rpy_rad, np.float64) / 2.0
    (cr, cp, cy), (sr, sp, sy) = np.moveaxis(np.cos(half), -1, 0), np.moveaxis(np.sin(half), -1, 0)
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy,
        ],
        axis=-1,
    )


def matrices_from_xyz_quaternion(xyz_m: Float64Array, xyzw: Float64Array) -> Float64Array:
    """(…, 4, 4) transforms, parent from child, of (…, 3) positions in meters and (…, 4) unit quaternions x y z w."""
    xyz_m, xyzw = np.asarray(xyz_m, np.float64), np.asarray(xyzw, np.float64)
    x, y, z, w = np.moveaxis(xyzw, -1, 0)
    matrices = np.zeros((*xyz_m.shape[:-1], 4, 4))
    matrices[..., 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=-1)
    matrices[..., 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=-1)
    matrices[..., 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=-1)
    matrices[..., :3, 3] = xyz_m
    matrices[..., 3, 3] = 1.0
    return matrices


def rpy_from_rotation(rotation: Float64Array) -> Float64Array:
    """(…, 3) roll, pitch, yaw in radians of (…, 3, 3) rotation matrices; pitch is in [-π/2, π/2]."""
    return np.stack(
        [
            np.arctan2(rotation[..., 2, 1], rotation[..., 2, 2]),
            -np.arcsin(np.clip(rotation[..., 2, 0], -1.0, 1.0)),
            np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0]),
        ],
        axis=-1,
    )


SENSOR_FROM_OPTICAL = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
"""(4, 4) camera body frame (x forward, y left, z up) from optical frame (x right, y down, z forward), REP-103."""
