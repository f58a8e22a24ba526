"""Converts poses to CARLA's left-handed frames, in which OPV2V's files are: x forward, y to the right, z up.

Ours have y to the left, so both differ in the sign of y alone. CARLA's rotation is Rz(yaw) Ry(-pitch) Rx(-roll) in a
right-handed reading of its axes (documentation of ``carla.Rotation``: positive pitch looks up, positive yaw turns to
the right, positive roll leans to the right).
"""

import numpy as np

from simbev_ros.foundation.geometry.transforms import rpy_from_rotation
from simbev_ros.foundation.types import Float64Array

_MIRROR = np.array([1.0, -1.0, 1.0])
_VERTICAL = 1.0 - 1e-9
"""Sine of the pitch from which roll and yaw turn about the same axis."""


def mirrored(vectors: Float64Array) -> Float64Array:
    """(…, 3) vectors with y to the right, from y to the left, and the other way round."""
    return vectors * _MIRROR


def mirrored_transform(target_from_source: Float64Array) -> Float64Array:
    """(4, 4) transform between left-handed frames, from that between the right-handed ones."""
    signs = np.append(_MIRROR, 1.0)
    return target_from_source * np.outer(signs, signs)


def carla_pose(map_from_frame: Float64Array) -> Float64Array:
    """(6,) x, y, z in meters and roll, yaw, pitch in degrees of CARLA, from a (4, 4) pose in our map frame."""
    return np.concatenate([mirrored(map_from_frame[:3, 3]), carla_angles_deg(_rpy_rad(map_from_frame[:3, :3]))])


def carla_angles_deg(rpy_rad: Float64Array) -> Float64Array:
    """(…, 3) roll, yaw, pitch of CARLA, degrees, from (…, 3) roll, pitch, yaw in our frame."""
    roll_rad, pitch_rad, yaw_rad = np.moveaxis(np.asarray(rpy_rad, np.float64), -1, 0)
    return np.degrees(np.stack([roll_rad, -yaw_rad, -pitch_rad], axis=-1))


def _rpy_rad(rotation: Float64Array) -> Float64Array:
    """(3,) roll, pitch, yaw of a (3, 3) rotation; the roll of a sensor that looks straight up or down is 0."""
    roll_rad, pitch_rad, yaw_rad = rpy_from_rotation(rotation)
    if abs(rotation[2, 0]) > _VERTICAL:
        return np.array([0.0, pitch_rad, np.arctan2(-rotation[0, 1], rotation[1, 1])])
    return np.array([roll_rad, pitch_rad, yaw_rad])
