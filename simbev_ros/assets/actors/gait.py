"""Converts gaits (gait.yaml) into joint angles: a foot on the ground stays in place, a swinging leg moves freely.

Angles are absolute and about y: positive moves the lower end backward, or the toes down. Lengths are relative to the
body height; x is measured forward from the hips, and the phase is the fraction of the stride since touchdown.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from simbev_ros.assets.actors.limbs import ANKLE, SHIN, THIGH, bend
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.gait import Gait

PHASES = 64
"""Number of equal steps of a stride at which poses are computed."""
_FLAT = 0.12
"""Fraction of the stance after which the whole sole is on the ground."""
_FINE = 128


@dataclass(frozen=True, slots=True)
class Stride:
    """A stride of the left side; the right side is half a stride behind.

    Attributes:
        hip: (PHASES,) height of the hips.
        lean_rad: Lean of the trunk.
        turn_rad: Limb → (PHASES,) rotation relative to the limb's parent, from standing upright.
    """

    hip: Float64Array
    lean_rad: float
    turn_rad: Mapping[str, Float64Array]


def stride(gait: Gait, length: float, sole: tuple[float, float], max_hip: float = np.inf) -> Stride:
    """Compute a stride of a length, for a sole that extends from x = ``sole[0]`` to ``sole[1]`` off the ankle.

    The mean height of the hips is at most ``max_hip``.
    """
    phase = np.arange(PHASES) / PHASES
    ahead = np.cos(2.0 * np.pi * phase)
    hip, thigh, knee, ankle = _leg(gait, length, sole, phase, max_hip)
    turns = {
        "thigh": thigh - np.radians(gait.lean),
        "shin": knee,
        "foot": ankle,
        "upper arm": np.radians(gait.shoulder + gait.shoulder_swing * ahead),
        "forearm": np.radians(-gait.elbow + gait.elbow_swing * ahead),
    }
    return Stride(hip, float(np.radians(gait.lean)), turns)


def _leg(
    gait: Gait, length: float, sole: tuple[float, float], phase: Float64Array, max_hip: float
) -> tuple[Float64Array, Float64Array, Float64Array, Float64Array]:
    """Height of the hips, angle of the thigh to the vertical, angles of knee and ankle, at (P,) phases."""
    if gait.stance == 1.0:
        return np.full(len(phase), THIGH + SHIN + ANKLE), *np.zeros((3, len(phase)))
    down = np.linspace(0.0, gait.stance, _FINE)
    pitch = _stance_pitch(gait, down / gait.stance)
    ankle = _rolled_ankle(pitch, sole) - np.outer(down, [length, 0.0])
    ahead, mean = _touch_down(gait, down, ankle)
    share = np.clip((phase - gait.stance) / (1.0 - gait.stance), 0.0, 1.0)
    foot = _interpolate_stride(phase, down, pitch, (gait.lift_at, np.radians(gait.tuck)))
    x = _interpolate_stride(phase, down, ankle[:, 0] + ahead)
    hip = _hip(gait, min(mean, max_hip), phase)
    z = _rolled_ankle(foot, sole)[:, 1] + gait.lift * _hump(share, gait.lift_at) - hip
    thigh, shin = bend(np.column_stack([x, np.zeros_like(x), z]), THIGH, SHIN, forward=True)
    return hip, thigh, shin - thigh, foot - shin


def _stance_pitch(gait: Gait, share: Float64Array) -> Float64Array:
    """Pitch of the foot over the stance: it touches down, lies flat, and rises from the heel."""
    setting = np.clip(1.0 - share / _FLAT, 0.0, 1.0) ** 1.5
    rising = np.clip((share - gait.rise) / max(1.0 - gait.rise, 1e-9), 0.0, 1.0) ** 1.8
    return np.radians(gait.strike * setting + gait.toe_off * rising)


def _rolled_ankle(pitch: Float64Array, sole: tuple[float, float]) -> Float64Array:
    """(N, 2) x, z of the ankle of a foot that rolls about its heel or toes, relative to the ankle's x when flat."""
    pivot_x = np.where(pitch < 0.0, sole[0], sole[1])
    x, z = -pivot_x, ANKLE
    cosine, sine = np.cos(pitch), np.sin(pitch)
    return np.column_stack([pivot_x + cosine * x + sine * z, -sine * x + cosine * z])


def _hip(gait: Gait, mean: float, phase: Float64Array) -> Float64Array:
    """Height of the hips, which rise and fall once per step."""
    return mean + gait.bob * np.cos(4.0 * np.pi * (phase - gait.stance / 2.0))


def _touch_down(gait: Gait, down: Float64Array, ankle: Float64Array) -> tuple[float, float]:
    """Touchdown position of the foot ahead of the hips that keeps the hips highest, and the hips' mean height."""
    reach = gait.reach * (THIGH + SHIN)
    ahead = np.linspace(0.0, -ankle[-1, 0], 64)
    x = ankle[:, 0] + ahead[:, None]
    height = ankle[:, 1] + np.sqrt(np.maximum(reach**2 - x**2, 0.0)) - _hip(gait, 0.0, down)
    best = int(np.argmax(height.min(axis=1)))
    return float(ahead[best]), float(height[best].min())


def _interpolate_stride(
    phase: Float64Array, down: Float64Array, stance: Float64Array, *knots: tuple[float, float]
) -> Float64Array:
    """A quantity over the stride: given during the stance, interpolated smoothly through knots during the swing."""
    from scipy.interpolate import CubicSpline  # takes long to load; only those who build figures need it

    start, step = down[-1], down[1] - down[0]
    leaving, landing = ((stance[k] - stance[k - 2]) / (2.0 * step) for k in (-1, 2))
    at, values = zip((0.0, stance[-1]), *knots, (1.0, stance[0]), strict=True)
    swing = CubicSpline(start + np.array(at) * (1.0 - start), values, bc_type=((1, leaving), (1, landing)))
    return np.where(phase <= start, np.interp(phase, down, stance), swing(phase))


def _hump(share: Float64Array, top: float) -> Float64Array:
    """Smooth bump over [0, 1]: 0 at both ends, maximum 1 at ``top``."""
    fall = 1.8
    up = fall * top / (1.0 - top)
    return (share / top) ** up * ((1.0 - share) / (1.0 - top)) ** fall
