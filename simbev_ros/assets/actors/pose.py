"""Poses: where a figure's joints are, and how its limbs swing when it walks or pedals."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from simbev_ros.config.base import Model
from simbev_ros.types import Float64Array

# Lengths over the body height: Drillis and Contini, "Body Segment Parameters", 1966.
THIGH, SHIN, ANKLE = 0.245, 0.246, 0.039
UPPER_ARM, FOREARM = 0.172, 0.150
HIP_HALF, SHOULDER_ABOVE_HIP, NECK_ABOVE_HIP, HEAD_ABOVE_HIP = 0.052, 0.252, 0.298, 0.400


@dataclass(frozen=True, slots=True)
class Swing:
    """Turn of a limb about y relative to the modelled pose: offset + amplitude sin(gait + phase), or ``still_rad``."""

    offset_rad: float = 0.0
    amplitude_rad: float = 0.0
    phase_rad: float = 0.0
    still_rad: float | None = None

    def at(self, gait_rad: float) -> float:
        """The turn at a phase of the gait."""
        return float(self.offset_rad + self.amplitude_rad * np.sin(gait_rad + self.phase_rad))


class Oscillation(Model):
    """Degrees: mean + amplitude sin(gait + phase), or ``still`` at rest; positive swings the lower end backward."""

    mean: float
    amplitude: float
    phase: float
    still: float = 0.0


class Gait(Model):
    """How a walker's left limbs move; the right ones are half a turn behind.

    Attributes:
        hip: Thigh against the vertical.
        knee: Shin against the thigh.
        ankle: Foot against the shin; positive turns the toes down.
        shoulder: Upper arm against the vertical.
        elbow: Forearm against the upper arm.
        lift: How much longer the leg under the body is than in mid-stride, over the height.
    """

    hip: Oscillation
    knee: Oscillation
    ankle: Oscillation
    shoulder: Oscillation
    elbow: Oscillation
    lift: float


class Seat(Model):
    """How a rider sits; metres, frame of the vehicle.

    Attributes:
        hip: x, z of the hip joints.
        lean_deg: How far the trunk leans forward.
        hand: x, y, z of the left wrist.
        foot: x, y, z of the left ankle; with ``crank`` that of the middle of its circle.
        crank: Length of the crank; 0 for feet that rest.
        foot_pitch_deg: Toes down.
        push_deg: How far the arms swing, both at once, to push the rims of a wheelchair.
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
    """A pose.

    Attributes:
        hip: (3,) middle of the hip joints.
        neck: (3,) lower end of the neck.
        head: (3,) centre of the head.
        lean_deg: Pitch of the trunk.
        joints: Side → joint → (3,).
        foot_pitch_rad: Side → pitch of the foot, toes down.
        swings: Side → limb → how it swings.
        lift_m: See ``Part``.
    """

    hip: Float64Array
    neck: Float64Array
    head: Float64Array
    lean_deg: float
    joints: Mapping[str, Mapping[str, Float64Array]]
    foot_pitch_rad: Mapping[str, float]
    swings: Mapping[str, Mapping[str, Swing]]
    lift_m: float


def walking_pose(gait: Gait, height_m: float, shoulders: float) -> Pose:
    """A walker in mid-stride, left leg in front: gait = π/2, the longest that the figure ever is."""
    hip = np.array([0.0, 0.0, (THIGH + SHIN + ANKLE) * height_m])
    joints, swings, foot_pitch = {}, {}, {}
    for side, sign, behind in (("left", 1.0, 0.0), ("right", -1.0, np.pi)):
        chain = {
            "thigh": _swing(gait.hip, behind),
            "shin": _swing(gait.knee, behind),
            "foot": _swing(gait.ankle, behind),
            "upper arm": _swing(gait.shoulder, behind),
            "forearm": _swing(gait.elbow, behind),
        }
        thigh, shin = chain["thigh"].at(np.pi / 2), chain["shin"].at(np.pi / 2)
        arm, fore = chain["upper arm"].at(np.pi / 2), chain["forearm"].at(np.pi / 2)
        at_hip = hip + np.array([0.0, sign * HIP_HALF * height_m, 0.0])
        knee = at_hip + _down(thigh, THIGH * height_m)
        shoulder = hip + height_m * np.array([-0.006, sign * (shoulders + 0.012), SHOULDER_ABOVE_HIP])
        elbow = shoulder + _down(arm, UPPER_ARM * height_m) + [0.0, sign * 0.012 * height_m, 0.0]
        joints[side] = {
            "hip": at_hip,
            "knee": knee,
            "ankle": knee + _down(thigh + shin, SHIN * height_m),
            "shoulder": shoulder,
            "elbow": elbow,
            "wrist": elbow + _down(arm + fore, FOREARM * height_m),
        }
        foot_pitch[side] = thigh + shin + chain["foot"].at(np.pi / 2)
        swings[side] = {limb: _from_rest(swing) for limb, swing in chain.items()}
    neck, head = (hip + np.array([0.0, 0.0, above * height_m]) for above in (NECK_ABOVE_HIP, HEAD_ABOVE_HIP))
    return Pose(hip, neck, head, 0.0, joints, foot_pitch, swings, gait.lift * height_m)


def seated_pose(seat: Seat, height_m: float, shoulders: float) -> Pose:
    """A rider at gait = 0: with cranks, the left pedal is at the bottom."""
    hip = np.array([seat.hip[0], 0.0, seat.hip[1]])
    lean, push = np.radians(seat.lean_deg), float(np.radians(seat.push_deg))
    up = np.array([np.sin(lean), 0.0, np.cos(lean)])
    turn = np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)
    joints, swings, foot_pitch = {}, {}, {}
    for side, sign in (("left", 1.0), ("right", -1.0)):
        start = 0.0 if sign > 0 else np.pi
        at_hip = hip + np.array([0.0, sign * HIP_HALF * height_m, 0.0])
        circle = np.array(seat.foot) * [1.0, sign, 1.0] + seat.crank * np.stack(
            [-np.sin(turn + start), np.zeros(36), -np.cos(turn + start)], axis=1
        )
        thigh, shin = _bend(circle - at_hip, THIGH * height_m, SHIN * height_m, forward=True)
        across = [0.0, circle[0, 1] - at_hip[1], 0.0]
        knee = at_hip + _down(thigh[0], THIGH * height_m) + np.multiply(across, 0.5)
        shoulder = hip + up * SHOULDER_ABOVE_HIP * height_m + [0.0, sign * shoulders * height_m, 0.0]
        wrist = np.array(seat.hand) * [1.0, sign, 1.0]
        arm, _ = _bend((wrist - shoulder)[None], UPPER_ARM * height_m, FOREARM * height_m, forward=False)
        joints[side] = {
            "hip": at_hip,
            "knee": knee,
            "ankle": knee + _down(shin[0], SHIN * height_m) + np.multiply(across, 0.5),
            "shoulder": shoulder,
            "elbow": shoulder + _down(arm[0], UPPER_ARM * height_m) + np.array([0.0, 0.5 * (wrist - shoulder)[1], 0.0]),
            "wrist": wrist,
        }
        foot_pitch[side] = np.radians(seat.foot_pitch_deg)
        swings[side] = {
            "thigh": _fitted(turn, thigh),
            "shin": _fitted(turn, shin - thigh),
            "foot": _fitted(turn, -shin),
            "upper arm": Swing(amplitude_rad=push, still_rad=0.0),
            "forearm": Swing(amplitude_rad=0.5 * push, phase_rad=np.pi, still_rad=0.0),
        }
    neck = hip + up * NECK_ABOVE_HIP * height_m
    head = neck + np.array([np.sin(lean / 2), 0.0, np.cos(lean / 2)]) * (HEAD_ABOVE_HIP - NECK_ABOVE_HIP) * height_m
    return Pose(hip, neck, head, seat.lean_deg, joints, foot_pitch, swings, 0.0)


def _down(angle_rad: float, length_m: float) -> Float64Array:
    """(3,) a limb that hangs down, turned about y; positive swings its end backward."""
    return np.array([-np.sin(angle_rad), 0.0, -np.cos(angle_rad)]) * length_m


def _swing(oscillation: Oscillation, behind_rad: float) -> Swing:
    """The swing of a joint, ``behind_rad`` out of step."""
    return Swing(
        offset_rad=float(np.radians(oscillation.mean)),
        amplitude_rad=float(np.radians(oscillation.amplitude)),
        phase_rad=float(np.radians(oscillation.phase)) + behind_rad,
        still_rad=float(np.radians(oscillation.still)),
    )


def _from_rest(swing: Swing) -> Swing:
    """The same swing relative to its own value in mid-stride."""
    rest = swing.at(np.pi / 2)
    still = None if swing.still_rad is None else swing.still_rad - rest
    return Swing(swing.offset_rad - rest, swing.amplitude_rad, swing.phase_rad, still)


def _fitted(turn_rad: Float64Array, angle_rad: Float64Array) -> Swing:
    """The swing nearest to (N,) angles at (N,) equal steps of a full turn, zero at the first of them."""
    sine, cosine = (2.0 / len(turn_rad) * (angle_rad @ wave(turn_rad)) for wave in (np.sin, np.cos))
    amplitude, phase = float(np.hypot(sine, cosine)), float(np.arctan2(cosine, sine))
    return Swing(-amplitude * float(np.sin(phase)), amplitude, phase)


def _bend(reach_m: Float64Array, upper_m: float, lower_m: float, *, forward: bool) -> tuple[Float64Array, Float64Array]:
    """Angles of (upper, lower) limb against the vertical that reach (N, 3) points from the joint; forward: a knee."""
    distance = np.minimum(np.hypot(reach_m[:, 0], reach_m[:, 2]), 0.999 * (upper_m + lower_m))
    along = np.arctan2(-reach_m[:, 0], -reach_m[:, 2])
    inner = np.arccos((upper_m**2 + distance**2 - lower_m**2) / (2.0 * upper_m * distance))
    outer = np.arccos((lower_m**2 + distance**2 - upper_m**2) / (2.0 * lower_m * distance))
    sign = -1.0 if forward else 1.0
    return along + sign * inner, along - sign * outer
