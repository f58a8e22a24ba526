"""An actor's shape: one mesh in its rest pose and the rigid parts (wheels, doors, limbs) that move."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array


@dataclass(frozen=True, slots=True)
class Part:
    """A rigid part. Its pose is that of its parent, turned about ``pivot_m``.

    Attributes:
        name: For people who read the model.
        parent: Index of a part before it; -1 for the body.
        pivot_m: Point that stays in place, actor frame, rest pose.
        spins: Turns about y with the ``wheel`` angle (forward roll).
        steers: Turns about z with the ``steer`` angle, before it spins.
        cranks: Turns about y with the ``gait`` angle (pedals of a bicycle).
        door: Bit of the ``doors`` column that opens it.
        opening_rad: Turn about z when it is open.
    """

    name: str
    parent: int = -1
    pivot_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spins: bool = False
    steers: bool = False
    cranks: bool = False
    door: int = 0
    opening_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Cycle:
    """How a person's limbs turn, at M speeds and N equal steps of ``gait``; between these it is interpolated.

    Attributes:
        speed_mps: (M,) ascending.
        turn_rad: (M, N, P) turn of every part about y.
        rise_m: (M, N) rise of the body, and with it of all its parts.
    """

    speed_mps: Float64Array
    turn_rad: Float64Array
    rise_m: Float64Array

    def at(self, speed_mps: Float64Array, gait_rad: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(A, P) turns and (A,) rises of A people."""
        count, steps = self.rise_m.shape
        row = np.interp(speed_mps, self.speed_mps, np.arange(count))
        slow = np.minimum(row.astype(np.int64), count - 2)
        step = gait_rad / (2.0 * np.pi) * steps
        before = np.floor(step).astype(np.int64)
        faster, later = row - slow, step - before
        turn_rad, rise_m = np.zeros((len(row), self.turn_rad.shape[2])), np.zeros(len(row))
        for m, n, share in (
            (slow, before, (1.0 - faster) * (1.0 - later)),
            (slow, before + 1, (1.0 - faster) * later),
            (slow + 1, before, faster * (1.0 - later)),
            (slow + 1, before + 1, faster * later),
        ):
            turn_rad += share[:, None] * self.turn_rad[m, n % steps]
            rise_m += share * self.rise_m[m, n % steps]
        return turn_rad, rise_m


@dataclass(frozen=True, slots=True)
class CoarserMesh:
    """What cameras may draw instead of a model's mesh from afar, while all doors are shut.

    Attributes:
        mesh: As in the model.
        error_m: How far its surface is from that of the model at most; what is thinner than that may be missing.
    """

    mesh: Mesh
    error_m: float


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
        cycle: How a person moves.
        build_coarser: Makes its coarser meshes, by ascending error.
    """

    blueprint: str
    tag: Tag
    box_class: str
    mesh: Mesh
    size_m: tuple[float, float, float]
    parts: tuple[Part, ...]
    wheel_radius_m: float
    cycle: Cycle | None = None
    build_coarser: Callable[[], tuple[CoarserMesh, ...]] = tuple
