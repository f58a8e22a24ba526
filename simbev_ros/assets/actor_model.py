"""An actor's shape: one mesh in its rest pose and the rigid parts (wheels, limbs) that move."""

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
    poses = np.tile(np.eye(4), (len(actors), len(model.parts), 1, 1))
    gait = actors["gait"].astype(np.float64)
    motion = np.minimum(np.hypot(actors["vx"], actors["vy"]).astype(np.float64) / _FULL_STRIDE_MPS, 1.0)
    for index, part in enumerate(model.parts):
        angle_y = part.swing_offset_rad + part.swing_rad * np.sin(gait + part.swing_phase_rad)
        if part.still_rad is not None:
            angle_y = motion * angle_y + (1.0 - motion) * part.still_rad
        if part.spins:
            angle_y = angle_y + actors["wheel"]
        if part.cranks:
            angle_y = angle_y + gait
        angle_z = actors["steer"].astype(np.float64) if part.steers else np.zeros(len(actors))
        turn = _turn_about(np.asarray(part.pivot_m), angle_y, angle_z)
        turn[:, 2, 3] += part.lift_m * (1.0 - motion * np.sin(gait) ** 2)
        poses[:, index] = turn if part.parent < 0 else poses[:, part.parent] @ turn
    return poses


def _turn_about(pivot_m: Float64Array, angle_y_rad: Float64Array, angle_z_rad: Float64Array) -> Float64Array:
    """(N, 4, 4) rotations Rz Ry about a fixed point."""
    cy, sy, cz, sz = np.cos(angle_y_rad), np.sin(angle_y_rad), np.cos(angle_z_rad), np.sin(angle_z_rad)
    turn = np.zeros((len(angle_y_rad), 4, 4))
    turn[:, 0, :3] = np.stack([cz * cy, -sz, cz * sy], axis=-1)
    turn[:, 1, :3] = np.stack([sz * cy, cz, sz * sy], axis=-1)
    turn[:, 2, :3] = np.stack([-sy, np.zeros_like(sy), cy], axis=-1)
    turn[:, :3, 3] = pivot_m - turn[:, :3, :3] @ pivot_m
    turn[:, 3, 3] = 1.0
    return turn
