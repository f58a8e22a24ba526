"""Poses of human figures: joint positions in the modeled pose, and rotations of limbs in walking, running, pedaling."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from simbev_ros.assets.actors.body import ArmPose
from simbev_ros.assets.actors.gait import PHASES
from simbev_ros.assets.actors.limbs import (
    ANKLE,
    FOREARM,
    HAND,
    HEAD_ABOVE_HIP,
    HIP_HALF,
    NECK_ABOVE_HIP,
    SHIN,
    SHOULDER_ABOVE_HIP,
    THIGH,
    UPPER_ARM,
    bend,
    bend_toward,
    down,
)
from simbev_ros.assets.actors.limping import both_strides, stick_turns
from simbev_ros.config.base import Model
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.gait import Gait, unit_mps

LIMBS = ("thigh", "shin", "foot", "upper arm", "forearm")
_ARM = LIMBS[3:]
_SIDES = (("left", 1.0), ("right", -1.0))
_PUSHING_MPS = 0.6
_TURN = np.linspace(0.0, 2.0 * np.pi, PHASES, endpoint=False)
_STANDING = THIGH + SHIN + ANKLE


class Seat(Model):
    """Sitting posture of a rider; meters, vehicle frame.

    Attributes:
        hip: x, z of the hip joints.
        lean_deg: Forward lean of the trunk.
        hand: x, y, z of the left wrist.
        foot: x, y, z of the left ankle; with ``crank``, of the center of its circle.
        crank: Length of the crank; 0 for resting feet.
        foot_pitch_deg: Pitch of the feet, toes down.
        push_deg: Swing of both arms that push the rims of a wheelchair.
    """

    hip: tuple[float, float]
    lean_deg: float
    hand: tuple[float, float, float]
    foot: tuple[float, float, float]
    crank: float = 0.0
    foot_pitch_deg: float = 0.0
    push_deg: float = 0.0


@dataclass(frozen=True, slots=True)
class Pose:
    """Modeled pose of a figure, and rotations from that pose at M speeds and N equal steps of ``gait``.

    A figure that never moves has M = 0.

    Attributes:
        hip: (3,) midpoint of the hip joints.
        neck: (3,) lower end of the neck.
        head: (3,) center of the head.
        lean_deg: Pitch of the trunk.
        joints: Side → joint → (3,) position.
        foot_pitch_rad: Pitch of the feet, toes down.
        speed_mps: (M,) speeds, ascending.
        turn_rad: Side → limb → (M, N) rotation relative to the limb's parent.
        trunk_rad: (M, N) rotation of the trunk about the hips.
        rise_m: (M, N) rise of the whole body.
    """

    hip: Float64Array
    neck: Float64Array
    head: Float64Array
    lean_deg: float
    joints: Mapping[str, Mapping[str, Float64Array]]
    foot_pitch_rad: float
    speed_mps: Float64Array = field(default_factory=lambda: np.empty(0))
    turn_rad: Mapping[str, Mapping[str, Float64Array]] = field(default_factory=dict)
    trunk_rad: Float64Array = field(default_factory=lambda: np.empty((0, PHASES)))
    rise_m: Float64Array = field(default_factory=lambda: np.empty((0, PHASES)))


def standing_pose(
    gaits: Sequence[Gait],
    height_m: float,
    tall_m: float,
    shoulders: float,
    sole: tuple[float, float],
    held: Mapping[str, ArmPose],
    limps: bool = False,
    stick: tuple[float, float, float] | None = None,
) -> Pose:
    """Pose of a figure on foot, standing upright.

    Args:
        gaits: Gaits by ascending speed.
        height_m: Height that the limbs' lengths refer to.
        tall_m: Height that the gaits' speeds and strides refer to.
        shoulders: Half the shoulder distance over the height.
        sole: x of the sole's ends from the ankle, over the height.
        held: Side → pose of an arm that does not swing.
        limps: Whether the left leg hurts.
        stick: Tip of a stick in the right hand, from the hand and over the height, that is set down with that leg.
    """
    hip = np.array([0.0, 0.0, _STANDING * height_m])
    joints = _standing_joints(hip, height_m, shoulders, held)
    lengths = [gait.stride * tall_m / height_m for gait in gaits]
    rows = zip(gaits, lengths, strict=True)
    strides, right = zip(*(both_strides(gait, own, sole, limps=limps) for gait, own in rows), strict=True)
    turns: dict[str, dict[str, Float64Array]] = {
        side: {limb: np.stack([each[limb] for each in of_side]) for limb in LIMBS}
        for side, of_side in (("left", [each.turn_rad for each in strides]), ("right", right))
    }
    for side in held:
        turns[side] |= {limb: np.zeros((len(gaits), PHASES)) for limb in _ARM}
    if stick is not None:
        elbow, wrist = ((joints["right"][name] - joints["right"]["shoulder"]) / height_m for name in ("elbow", "wrist"))
        tip = wrist + HAND * (wrist - elbow) / FOREARM + stick
        arms = [stick_turns(*row, elbow, tip) for row in zip(gaits, lengths, strides, strict=True)]
        turns["right"] |= {limb: np.stack([arm[limb] for arm in arms]) for limb in _ARM}
    return Pose(
        hip=hip,
        neck=hip + np.array([0.0, 0.0, NECK_ABOVE_HIP * height_m]),
        head=hip + np.array([0.0, 0.0, HEAD_ABOVE_HIP * height_m]),
        lean_deg=0.0,
        joints=joints,
        foot_pitch_rad=0.0,
        speed_mps=np.array([gait.speed for gait in gaits]) * unit_mps(tall_m),
        turn_rad=turns,
        trunk_rad=np.stack([np.full(PHASES, each.lean_rad) for each in strides]),
        rise_m=np.stack([(each.hip - _STANDING) * height_m for each in strides]),
    )


def _standing_joints(
    hip: Float64Array, height_m: float, shoulders: float, held: Mapping[str, ArmPose]
) -> dict[str, dict[str, Float64Array]]:
    """Joints of both sides of an upright figure; arguments as for ``standing_pose``."""
    joints: dict[str, dict[str, Float64Array]] = {}
    for side, sign in _SIDES:
        at_hip = hip + np.array([0.0, sign * HIP_HALF * height_m, 0.0])
        knee = at_hip + down(0.0, THIGH * height_m)
        shoulder = hip + height_m * np.array([-0.006, sign * (shoulders - 0.006), SHOULDER_ABOVE_HIP])
        elbow = shoulder + down(0.0, UPPER_ARM * height_m) + [0.0, sign * 0.020 * height_m, 0.0]
        wrist = elbow + down(0.0, FOREARM * height_m)
        if side in held:
            mirror, arm = np.array([1.0, sign, 1.0]), held[side]
            reach_m, toward = height_m * mirror * arm.wrist, mirror * arm.elbow
            elbow, wrist = shoulder + bend_toward(reach_m, UPPER_ARM * height_m, FOREARM * height_m, toward)
        joints[side] = {
            "hip": at_hip,
            "knee": knee,
            "ankle": knee + down(0.0, SHIN * height_m),
            "shoulder": shoulder,
            "elbow": elbow,
            "wrist": wrist,
        }
    return joints


def seated_pose(seat: Seat, height_m: float, shoulders: float) -> Pose:
    """Pose of a rider at gait = 0; with cranks, the left pedal is at the bottom."""
    hip = np.array([seat.hip[0], 0.0, seat.hip[1]])
    lean = np.radians(seat.lean_deg)
    up = np.array([np.sin(lean), 0.0, np.cos(lean)])
    joints, turns = {}, {}
    for side, sign in _SIDES:
        start = 0.0 if sign > 0 else np.pi
        at_hip = hip + np.array([0.0, sign * HIP_HALF * height_m, 0.0])
        circle = np.array(seat.foot) * [1.0, sign, 1.0] + seat.crank * np.stack(
            [-np.sin(_TURN + start), np.zeros(PHASES), -np.cos(_TURN + start)], axis=1
        )
        thigh, shin = bend(circle - at_hip, THIGH * height_m, SHIN * height_m, forward=True)
        across = [0.0, circle[0, 1] - at_hip[1], 0.0]
        knee = at_hip + down(thigh[0], THIGH * height_m) + np.multiply(across, 0.5)
        shoulder = hip + up * SHOULDER_ABOVE_HIP * height_m + [0.0, sign * shoulders * height_m, 0.0]
        wrist = np.array(seat.hand) * [1.0, sign, 1.0]
        arm, _ = bend((wrist - shoulder)[None], UPPER_ARM * height_m, FOREARM * height_m, forward=False)
        joints[side] = {
            "hip": at_hip,
            "knee": knee,
            "ankle": knee + down(shin[0], SHIN * height_m) + np.multiply(across, 0.5),
            "shoulder": shoulder,
            "elbow": shoulder + down(arm[0], UPPER_ARM * height_m) + np.array([0.0, 0.5 * (wrist - shoulder)[1], 0.0]),
            "wrist": wrist,
        }
        push = np.radians(seat.push_deg) * np.array([[0.0], [1.0]]) * np.sin(_TURN)
        turns[side] = {
            "thigh": _at_any_speed(thigh - thigh[0]),
            "shin": _at_any_speed((shin - thigh) - (shin - thigh)[0]),
            "foot": _at_any_speed(shin[0] - shin),
            "upper arm": push,
            "forearm": -0.5 * push,
        }
    neck = hip + up * NECK_ABOVE_HIP * height_m
    head = neck + np.array([np.sin(lean / 2), 0.0, np.cos(lean / 2)]) * (HEAD_ABOVE_HIP - NECK_ABOVE_HIP) * height_m
    return Pose(
        hip=hip,
        neck=neck,
        head=head,
        lean_deg=seat.lean_deg,
        joints=joints,
        foot_pitch_rad=float(np.radians(seat.foot_pitch_deg)),
        speed_mps=np.array([0.0, _PUSHING_MPS]),
        turn_rad=turns,
        trunk_rad=np.zeros((2, PHASES)),
        rise_m=np.zeros((2, PHASES)),
    )


def _at_any_speed(turn_rad: Float64Array) -> Float64Array:
    """(2, N) equal rotations at rest and in motion."""
    return np.stack([turn_rad, turn_rad])
