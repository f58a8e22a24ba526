"""Poses of people who sit on a bench or a chair: thighs on the seat, feet on the ground, arms as body.yaml says."""

from collections.abc import Mapping

import numpy as np

from simbev_ros.assets.actors import limbs
from simbev_ros.assets.actors.body import ArmPose, load_body
from simbev_ros.assets.actors.pose import Pose
from simbev_ros.config.base import Model
from simbev_ros.foundation.types import Float64Array

_SIDES = (("left", 1.0), ("right", -1.0))
_PRESSED_M = 0.008  # by which the flesh gives way on the seat


class Sitting(Model):
    """Posture of a person on a seat.

    Attributes:
        seat_m: Height of the seat.
        shins_deg: Forward lean of the left and the right shin, from the knee down.
        knees: Distance by which each knee is farther out than the hip, over the height.
        feet: The same for each ankle.
        heels_deg: Pitch of the feet, toes down, of short people who reach the ground with their toes.
        lean_deg: Forward lean of the trunk.
    """

    seat_m: float = 0.45
    shins_deg: tuple[float, float] = (0.0, 0.0)
    knees: float = 0.02
    feet: float = 0.02
    heels_deg: float = 0.0
    lean_deg: float = -4.0


def sitting_pose(
    sitting: Sitting,
    height_m: float,
    girth: float,
    shoulders: float,
    sole: tuple[float, float],
    held: Mapping[str, ArmPose],
) -> Pose:
    """Pose of a person who sits with the hips above the origin; the other arguments are those of ``standing_pose``."""
    hip = np.array([0.0, 0.0, sitting.seat_m - _PRESSED_M + load_body().thigh[0] * girth * height_m])
    lean, pitch = np.radians(sitting.lean_deg), np.radians(sitting.heels_deg)
    up = np.array([np.sin(lean), 0.0, np.cos(lean)])
    ankle_z_m = height_m * (limbs.ANKLE * np.cos(pitch) + sole[1] * np.sin(pitch))
    joints: dict[str, dict[str, Float64Array]] = {}
    for (side, sign), shin_deg in zip(_SIDES, sitting.shins_deg, strict=True):
        at_hip = hip + np.array([0.0, sign * limbs.HIP_HALF * height_m, 0.0])
        out_m = (sitting.feet - sitting.knees) * height_m
        shin_m = np.sqrt((limbs.SHIN * height_m) ** 2 - out_m**2)
        forward_m, fall_m = shin_m * np.sin(np.radians(shin_deg)), shin_m * np.cos(np.radians(shin_deg))
        knee_m = height_m * np.array([0.0, sign * sitting.knees, 0.0])
        knee_m[2] = ankle_z_m + fall_m - hip[2]
        knee_m[0] = np.sqrt((limbs.THIGH * height_m) ** 2 - knee_m[1] ** 2 - knee_m[2] ** 2)
        shoulder = hip + height_m * (up * limbs.SHOULDER_ABOVE_HIP + [0.0, sign * (shoulders - 0.006), 0.0])
        mirror, arm = np.array([1.0, sign, 1.0]), held[side]
        elbow, wrist = limbs.bend_toward(
            height_m * mirror * arm.wrist, limbs.UPPER_ARM * height_m, limbs.FOREARM * height_m, mirror * arm.elbow
        )
        joints[side] = {
            "hip": at_hip,
            "knee": at_hip + knee_m,
            "ankle": at_hip + knee_m + np.array([forward_m, sign * out_m, -fall_m]),
            "shoulder": shoulder,
            "elbow": shoulder + elbow,
            "wrist": shoulder + wrist,
        }
    neck = hip + up * limbs.NECK_ABOVE_HIP * height_m
    above_neck = np.array([np.sin(lean / 2.0), 0.0, np.cos(lean / 2.0)])
    return Pose(
        hip=hip,
        neck=neck,
        head=neck + above_neck * (limbs.HEAD_ABOVE_HIP - limbs.NECK_ABOVE_HIP) * height_m,
        lean_deg=sitting.lean_deg,
        joints=joints,
        foot_pitch_rad=float(pitch),
    )
