"""Model of an actor: one mesh in its rest pose, and the rigid parts (wheels, doors, limbs) that move."""

from collections.abc import Callable
from dataclasses import dataclass

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float32Array, Float64Array


@dataclass(frozen=True, slots=True)
class Part:
    """A rigid part of an actor. Its pose is that of its parent, rotated about ``pivot_m``.

    Attributes:
        name: Human-readable name.
        parent: Index of the parent, which precedes the part; -1 for the body.
        pivot_m: Fixed point of the rotation, actor frame, rest pose.
        spins: Turns about y (forward roll) per turn of the ``wheel`` angle; not 1 for wheels of another radius.
        steers: Whether the part turns about z with the ``steer`` angle, before it spins.
        cranks: Whether the part turns about y with the ``gait`` angle (pedals of a bicycle).
        door: Bit of the ``doors`` column that opens the part.
        opening_rad: Rotation about z of the open door.
    """

    name: str
    parent: int = -1
    pivot_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spins: float = 0.0
    steers: bool = False
    cranks: bool = False
    door: int = 0
    opening_rad: float = 0.0


@dataclass(frozen=True, slots=True)
class Cycle:
    """Motion cycle of a pedestrian's or rider's limbs, sampled at M speeds and N equal steps of ``gait``.

    Attributes:
        speed_mps: (M,) speeds, ascending.
        turn_rad: (M, N, P) rotation of every part about y.
        rise_m: (M, N) rise of the body with all its parts.
    """

    speed_mps: Float64Array
    turn_rad: Float32Array
    rise_m: Float32Array


@dataclass(frozen=True, slots=True)
class CoarserMesh:
    """Simplified mesh that cameras may draw for a distant model while all its doors are shut.

    Attributes:
        mesh: Mesh with the same frame and parts as the model's.
        error_m: Maximum distance of its surface from the model's; thinner details may be missing.
    """

    mesh: Mesh
    error_m: float


@dataclass(frozen=True, slots=True)
class ActorModel:
    """Model of one blueprint.

    Attributes:
        blueprint: Name of the blueprint, e.g. ``vehicle.sedan``.
        tag: Semantic tag of all triangles.
        box_class: Detection class, or "" for none (riders).
        mesh: Mesh in rest pose, actor frame: x forward, y left, z up, origin at the center of the box's ground plane.
        size_m: Length, width, height: the mesh's extent in rest pose; the box is centered on the origin in x and y.
        parts: Rigid parts; part 0 is the body, and every part comes after its parent.
        wheel_radius_m: Wheel radius that converts distance into the ``wheel`` angle; 0 without wheels.
        cycle: Motion cycle of the limbs, for pedestrians and riders.
        build_coarser: Builds the coarser meshes, by ascending error.
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
