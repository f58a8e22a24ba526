"""Motions in closed form, reported as the world does: poses at ticks, central differences, columns of float32."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation
from synthetic_world import TICK_NS, actor, box_model, world

from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.scene.state import WorldState

TICK_S = TICK_NS / 1e9
_COLUMNS = ("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az", "roll", "pitch", "yaw", "wx", "wy", "wz")
CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))

Path = Callable[[float], tuple[Float64Array, Float64Array]]
"""Function from a time (s) to position (m) and roll, pitch, yaw (rad)."""


def state_at(path: Path, tick: int) -> WorldState:
    """World state of an ego on a path at a tick."""
    (before_m, before_rad), (now_m, now_rad), (after_m, after_rad) = (
        map(np.asarray, path((tick + step) * TICK_S)) for step in (-1, 0, 1)
    )
    velocity = (after_m - before_m) / (2 * TICK_S)
    acceleration = (after_m - 2 * now_m + before_m) / TICK_S**2
    roll_rate, pitch_rate, yaw_rate = (after_rad - before_rad) / (2 * TICK_S)
    yaw_only, yaw_and_pitch = Rotation.from_euler("z", now_rad[2]), Rotation.from_euler("yz", now_rad[1:])
    spin = yaw_and_pitch.apply([roll_rate, 0, 0]) + yaw_only.apply([0, pitch_rate, 0]) + [0, 0, yaw_rate]
    values = [now_m, velocity, acceleration, now_rad, spin]
    columns = dict(zip(_COLUMNS, np.concatenate(values).tolist(), strict=True))
    return world(actor(CAR, **columns), tick=tick)


def circle(speed_mps: float, radius_m: float) -> Path:
    """Level left-hand circle about the origin, heading along the path."""

    def at(time_s: float) -> tuple[Float64Array, Float64Array]:
        angle = speed_mps / radius_m * time_s
        position_m = np.array([radius_m * np.sin(angle), -radius_m * np.cos(angle), 0.0])
        return position_m, np.array([0.0, 0.0, angle])

    return at


def straight(speed_mps: float, acceleration_mps2: float, yaw_rad: float) -> Path:
    """Straight path with constant acceleration, heading along the path."""

    def at(time_s: float) -> tuple[Float64Array, Float64Array]:
        distance_m = speed_mps * time_s + acceleration_mps2 * time_s**2 / 2
        return distance_m * np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0]), np.array([0.0, 0.0, yaw_rad])

    return at


def hilly(time_s: float) -> tuple[Float64Array, Float64Array]:
    """Winding road over hills, on which the car rolls, far from the map's origin."""
    position_m = np.array([1200 + 9 * time_s, -3100 + 40 * np.sin(0.1 * time_s), 60 + 4 * np.sin(0.2 * time_s)])
    ahead_mps, left_mps, up_mps = 9.0, 4 * np.cos(0.1 * time_s), 0.8 * np.cos(0.2 * time_s)
    pitch_rad = -np.arctan2(up_mps, np.hypot(ahead_mps, left_mps))
    return position_m, np.array([0.03 * np.sin(time_s), pitch_rad, np.arctan2(left_mps, ahead_mps)])


def screw(spin_radps: float, climb_mps: float, roll_rad: float, pitch_rad: float) -> Path:
    """Tilted ego that rotates about the vertical through the origin and rises along it."""
    return lambda time_s: (
        np.array([0.0, 0.0, climb_mps * time_s]),
        np.array([roll_rad, pitch_rad, spin_radps * time_s]),
    )


def rolling(spin_radps: float) -> Path:
    """Rotation about the ego's own x axis, without translation."""
    return lambda time_s: (np.zeros(3), np.array([spin_radps * time_s, 0.0, 0.0]))
