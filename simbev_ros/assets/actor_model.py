"""An actor's shape: one mesh in its rest pose and the rigid parts (wheels, doors, limbs) that move."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.assets.mesh import Mesh
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array, Table


@dataclass(frozen=True, slots=True)
class Part:
    """A rigid part. Its pose is that of its parent, turned about ``pivot_m``.

    Attributes:
        name: For people who read the model.
        parent: Index of a part before it; -1 for the body.
        pivot_m: Point that stays in place, actor frame, rest pose.
        spins: Turns about y with the ``wheel`` angle (forward roll).
        steers: Turns about z with the ``steer`` angle, before it spins.
        swing_rad: Amplitude of the swing about y, with sin(gait + swing_phase_rad).
        swing_phase_rad: Phase of the swing.
        swing_offset_rad: Constant turn about y.
        cranks: Turns about y with the ``gait`` angle (pedals of a bicycle).
        still_rad: Constant turn about y, in place of offset and swing, of an actor that stands still.
        lift_m: Rises by this times cos²(gait), and by all of it when the actor stands still: a leg is longest, and
            reaches deepest into the hip, when it is under the body.
        door: Bit of the ``doors`` column that opens it.
        opening_rad: Turn about z when it is open.
    """

    name: str
    parent: int = -1
    pivot_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spins: bool = False
    steers: bool = False
    swing_rad: float = 0.0
    swing_phase_rad: float = 0.0
    swing_offset_rad: float = 0.0
    cranks: bool = False
    still_rad: float | None = None
    lift_m: float = 0.0
    door: int = 0
    opening_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class ActorModel:
    """Shape of one blueprint.

    Attributes:
        blueprint: Its name, e.g. ``vehicle.sedan``.
        tag: Semantic tag of all its triangles.
        box_class: Detection class, or "" if it has none (riders).
        mesh: Rest pose, actor frame: x forward, y left, z up, origin at the centre of the ground plane of its box.
        size_m: Length, width, height: the mesh's extent in rest pose; the box is centred on the origin in x and y.
        parts: Part 0 is the body; a part comes after its parent.
        wheel_radius_m: For turning distance into the ``wheel`` angle; 0 without wheels.
    """

    blueprint: str
    tag: Tag
    box_class: str
    mesh: Mesh
    size_m: tuple[float, float, float]
    parts: tuple[Part, ...]
    wheel_radius_m: float


_FULL_STRIDE_MPS = 0.6
"""Below this speed walkers take shorter steps; at rest they stand."""


def part_poses(model: ActorModel, actors: Table) -> Float64Array:
    """Poses of every part of actors that share a model.

    Args:
        model: Their model.
        actors: (N,) ``ACTOR_DTYPE`` rows.

    Returns:
        (N, P, 4, 4) transforms actor from actor-at-rest: applied to rest-pose vertices of part p they give posed ones.
    """
    gait = actors["gait"].astype(np.float64)[:, None]
    motion = np.minimum(np.hypot(actors["vx"], actors["vy"]).astype(np.float64) / _FULL_STRIDE_MPS, 1.0)[:, None]
    parts = np.array([_numbers(part) for part in model.parts])
    spins, steers, swing_rad, phase_rad, offset_rad, cranks, is_still, still_rad, lift_m, door, opening_rad = parts[
        :, 3:
    ].T
    angle_y = offset_rad + swing_rad * np.sin(gait + phase_rad)
    angle_y = np.where(is_still, motion * angle_y + (1.0 - motion) * still_rad, angle_y)
    angle_y = angle_y + spins * actors["wheel"][:, None] + cranks * gait
    is_open = actors["doors"][:, None] >> door.astype(np.uint8) & 1
    angle_z = steers * actors["steer"][:, None] + opening_rad * is_open
    poses = _turns_about(parts[:, :3], angle_y, angle_z)
    poses[..., 2, 3] += lift_m * (1.0 - motion * np.sin(gait) ** 2)
    for index, part in enumerate(model.parts):
        if part.parent >= 0:
            poses[:, index] = poses[:, part.parent] @ poses[:, index]
    return poses


def _numbers(part: Part) -> tuple[float, ...]:
    """Everything that says how a part moves."""
    return (
        *part.pivot_m,
        part.spins,
        part.steers,
        part.swing_rad,
        part.swing_phase_rad,
        part.swing_offset_rad,
        part.cranks,
        part.still_rad is not None,
        part.still_rad or 0.0,
        part.lift_m,
        part.door,
        part.opening_rad,
    )


def _turns_about(pivots_m: Float64Array, angle_y_rad: Float64Array, angle_z_rad: Float64Array) -> Float64Array:
    """(N, P, 4, 4) rotations Rz Ry about (P, 3) fixed points."""
    cy, sy, cz, sz = np.cos(angle_y_rad), np.sin(angle_y_rad), np.cos(angle_z_rad), np.sin(angle_z_rad)
    turns = np.zeros((*angle_y_rad.shape, 4, 4))
    turns[..., 0, 0], turns[..., 0, 1], turns[..., 0, 2] = cz * cy, -sz, cz * sy
    turns[..., 1, 0], turns[..., 1, 1], turns[..., 1, 2] = sz * cy, cz, sz * sy
    turns[..., 2, 0], turns[..., 2, 2] = -sy, cy
    turns[..., :3, 3] = pivots_m - (turns[..., :3, :3] @ pivots_m[..., None])[..., 0]
    turns[..., 3, 3] = 1.0
    return turns
