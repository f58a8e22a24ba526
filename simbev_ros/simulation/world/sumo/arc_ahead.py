"""The path ahead of a vehicle that is driven from outside, as others expect it: on with its present curvature."""

import numpy as np

from simbev_ros.foundation.types import Float64Array

_MAX_CURVATURE_PER_M = 0.2
_MIN_STEP_M = 0.01
_MAX_TURN_RAD = np.pi / 2.0  # then others expect it to drive straight on


def curvature_per_m(
    front_before_m: Float64Array, axle_before_m: Float64Array, front_m: Float64Array, axle_m: Float64Array
) -> float:
    """Curvature of the path of an axle between two poses, of (3,) points each; left positive."""
    before, now = (front_before_m - axle_before_m)[:2], (front_m - axle_m)[:2]
    turn_rad = np.arctan2(before[0] * now[1] - before[1] * now[0], before @ now)
    step_m = (axle_m - axle_before_m)[:2] @ now / np.linalg.norm(now)
    return (
        float(np.clip(turn_rad / step_m, -_MAX_CURVATURE_PER_M, _MAX_CURVATURE_PER_M)) if step_m > _MIN_STEP_M else 0.0
    )


def arc_ahead_m(
    front_m: Float64Array, axle_m: Float64Array, curvature_per_m: float, distance_m: Float64Array
) -> Float64Array:
    """(…, 3) positions of a front, now at (3,), after (…) distances; the rear axle, at (3,), moves on an arc."""
    length_m = float(np.linalg.norm((front_m - axle_m)[:2]))
    ahead = (front_m - axle_m) / length_m
    left = np.array([-ahead[1], ahead[0], 0.0])
    axle_path_m = distance_m / np.hypot(1.0, curvature_per_m * length_m)
    turn_rad = np.clip(curvature_per_m * axle_path_m, -_MAX_TURN_RAD, _MAX_TURN_RAD)
    half_rad = turn_rad / 2.0
    arc_m = axle_path_m if curvature_per_m == 0.0 else turn_rad / curvature_per_m
    chord_m, beyond_m = arc_m * np.sinc(half_rad / np.pi), axle_path_m - arc_m + length_m
    along_m = chord_m * np.cos(half_rad) + beyond_m * np.cos(turn_rad)
    left_m = chord_m * np.sin(half_rad) + beyond_m * np.sin(turn_rad)
    return axle_m + along_m[..., None] * ahead + left_m[..., None] * left
