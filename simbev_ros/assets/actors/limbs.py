"""Kinematics of human limbs: segment lengths, and joint angles that bring a hand or foot to a point."""

import numpy as np

from simbev_ros.foundation.types import Float64Array

# Lengths relative to the body height: Drillis and Contini, "Body Segment Parameters", 1966.
THIGH, SHIN, ANKLE = 0.245, 0.246, 0.039
UPPER_ARM, FOREARM, HAND = 0.172, 0.150, 0.05  # the last one from the wrist to the middle of the hand
HIP_HALF, SHOULDER_ABOVE_HIP, NECK_ABOVE_HIP, HEAD_ABOVE_HIP = 0.052, 0.252, 0.298, 0.400


def down(angle_rad: float, length_m: float) -> Float64Array:
    """(3,) vector along a hanging limb, rotated about y; positive angles move its end backward."""
    return np.array([-np.sin(angle_rad), 0.0, -np.cos(angle_rad)]) * length_m


def bend(reach_m: Float64Array, upper_m: float, lower_m: float, *, forward: bool) -> tuple[Float64Array, Float64Array]:
    """Angles of upper and lower limb to the vertical that reach (N, 3) points from the joint.

    Args:
        reach_m: (N, 3) target points relative to the upper joint.
        upper_m: Length of the upper limb.
        lower_m: Length of the lower limb.
        forward: Whether the joint bends forward, like a knee; otherwise backward, like an elbow.
    """
    distance = np.minimum(np.hypot(reach_m[:, 0], reach_m[:, 2]), 0.999 * (upper_m + lower_m))
    along = np.arctan2(-reach_m[:, 0], -reach_m[:, 2])
    inner = np.arccos((upper_m**2 + distance**2 - lower_m**2) / (2.0 * upper_m * distance))
    outer = np.arccos((lower_m**2 + distance**2 - upper_m**2) / (2.0 * lower_m * distance))
    sign = -1.0 if forward else 1.0
    return along + sign * inner, along - sign * outer


def bend_toward(
    reach_m: Float64Array, upper_m: float, lower_m: float, toward: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """(3,) positions of the middle joint and the end of a limb, from its start.

    Args:
        reach_m: (3,) target of the end; if it is too far away, the limb is stretched toward it.
        upper_m: Length of the upper limb.
        lower_m: Length of the lower limb.
        toward: (3,) direction in which the middle joint points.
    """
    distance = float(np.linalg.norm(reach_m))
    along = reach_m / distance
    distance = min(distance, 0.999 * (upper_m + lower_m))
    aside = toward - along * (toward @ along)
    share = (upper_m**2 - lower_m**2 + distance**2) / (2.0 * distance)
    off_m = np.sqrt(upper_m**2 - share**2) * aside / np.linalg.norm(aside)
    return along * share + off_m, along * distance
