"""Bare branches of deciduous plants: limbs, branches and twigs, each generation along the one before.

Twigs are single pointed triangles, so that a bare crown has about as many triangles as one in full leaf. They are wider
than real ones, because they stand for the finer twigs as well. Frame: origin at the foot, z up.
"""

from dataclasses import replace
from typing import NamedTuple, Self

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.palette import Color
from simbev_ros.config.base import Model
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Int64Array

_UP = np.array([0.0, 0.0, 1.0])
_GOLDEN_RAD = np.pi * (3.0 - 5.0**0.5)
_STOUTNESS = 0.024
"""Maximum radius of a limb, over its length."""
_TWIG_M, _COARSE_TWIG_M = 0.020, 0.12
"""Half width of twigs at their start, and of the triangles that stand for a branch with all its twigs."""


class Habit(Model):
    """How the branches of a species grow; species.yaml explains the fields."""

    limbs: int = 13
    branches: int = 8
    angle_deg: float = 55.0
    leader: float = 0.5
    fork: float = 0.25
    rise: float = 0.25
    hang: float = 0.0
    twig_width: float = 1.0
    twigs: str = "twigs"


class Crown(NamedTuple):
    """Ellipsoid that holds all branches: (3,) center and (3,) radii, meters."""

    middle_m: Float64Array
    radii_m: Float64Array

    def room_m(self, starts_m: Float64Array, directions: Float64Array) -> Float64Array:
        """(N,) distances from (N, 3) points along (N, 3) unit vectors to the ellipsoid's surface."""
        start, along = (starts_m - self.middle_m) / self.radii_m, directions / self.radii_m
        square, ahead = np.sum(along**2, axis=1), np.sum(start * along, axis=1)
        inside = np.maximum(ahead**2 - square * (np.sum(start**2, axis=1) - 1.0), 0.0)
        return np.maximum((np.sqrt(inside) - ahead) / square, 0.25)


class Shoots(NamedTuple):
    """N branches of one generation: (N, 3, 3) starts, bends and tips; (N,) radii at the start, meters."""

    points_m: Float64Array
    radius_m: Float64Array

    @property
    def length_m(self) -> Float64Array:
        """(N,) distances from start to tip."""
        return np.asarray(np.linalg.norm(self.points_m[:, 2] - self.points_m[:, 0], axis=1))

    def at(self, share: Float64Array) -> tuple[Float64Array, Float64Array]:
        """(N, K, 3) points at (N, K) shares of the branches, and (N, K, 3) unit vectors along them there."""
        start, bend, tip = (self.points_m[:, None, k] for k in range(3))
        late = share[..., None] > 0.5
        here = np.where(
            late, bend + (2.0 * share[..., None] - 1.0) * (tip - bend), start + 2.0 * share[..., None] * (bend - start)
        )
        return here, _unit(np.where(late, tip - bend, bend - start))

    def some(self, chosen: Int64Array) -> Self:
        """Some of the branches."""
        return self._replace(points_m=self.points_m[chosen], radius_m=self.radius_m[chosen])


def limbs_of_stem(
    rng: np.random.Generator, habit: Habit, crown: Crown, fork_m: Float64Array, radius_m: float
) -> Shoots:
    """Grow limbs from a stem: from its (3,) fork upward, and the last one as its leader.

    Args:
        rng: Random generator to draw from.
        habit: How the species grows.
        crown: The space for the branches.
        fork_m: Where the lowest limb starts.
        radius_m: Radius of the stem there.
    """
    count = habit.limbs
    height = np.append((np.arange(count - 1) + rng.uniform(0.0, 1.0, count - 1)) / (count - 1), 1.0)
    top_m = crown.middle_m + np.array([0.0, 0.0, (2.0 * habit.leader - 1.0) * crown.radii_m[2]])
    starts_m = fork_m + height[:, None] * (top_m - fork_m)
    turn_rad = np.arange(count) * _GOLDEN_RAD + rng.uniform(0.0, 2.0 * np.pi) + rng.normal(0.0, 0.25, count)
    tilt_rad = np.radians(habit.angle_deg * (1.15 - 0.7 * height) + rng.normal(0.0, 6.0, count)) * (height < 1.0)
    directions = _tilted(np.tile(_UP, (count, 1)), tilt_rad, turn_rad)
    length_m = crown.room_m(starts_m, directions) * rng.uniform(0.7, 0.9, count)
    thick_m = np.minimum(radius_m * (0.5 - 0.25 * height), _STOUTNESS * length_m)
    return _bent(rng, starts_m, directions, length_m, habit.rise, thick_m)


def branches_of(
    rng: np.random.Generator, habit: Habit, crown: Crown, parents: Shoots, count: int, length: float, hang: float
) -> Shoots:
    """Grow ``count`` branches from each parent, ``length`` times as long, and hanging by ``hang`` of 0 to 1."""
    total = len(parents.radius_m) * count
    share = (np.arange(count) + rng.uniform(0.1, 0.9, (len(parents.radius_m), count))) / count
    share = 0.2 + 0.8 * share
    starts_m, along = (column.reshape(-1, 3) for column in parents.at(share))
    turn_rad = np.arange(total) * _GOLDEN_RAD + rng.normal(0.0, 0.4, total)
    tilt_rad = np.radians(rng.normal(0.8 * habit.angle_deg, 11.0, total)) * (1.1 - 0.6 * share.reshape(-1))
    directions = _tilted(along, tilt_rad, turn_rad)
    directions = _unit(directions * (1.0 - hang) - [0.0, 0.0, hang])
    own = np.repeat(parents.length_m, count) * length * (1.15 - 0.6 * share.reshape(-1)) * rng.uniform(0.7, 1.25, total)
    own = np.minimum(own, 1.05 * crown.room_m(starts_m, directions))
    radius_m = np.repeat(parents.radius_m, count) * (0.42 - 0.2 * share.reshape(-1))
    return _bent(rng, starts_m, directions, own, habit.rise * (1.0 - hang) - hang, radius_m)


class Skeleton(NamedTuple):
    """The branches of a plant: limbs, branches of these, twigs of those."""

    limbs: Shoots
    branches: Shoots
    twigs: Shoots

    @classmethod
    def grow(cls, rng: np.random.Generator, habit: Habit, crown: Crown, limbs: Shoots, twigs: int) -> Self:
        """Grow branches from limbs, and a number of ``twigs`` from each branch."""
        branches = branches_of(rng, habit, crown, limbs, habit.branches, 0.66, 0.5 * habit.hang)
        longer = 0.9 + 1.1 * habit.hang
        return cls(limbs, branches, branches_of(rng, habit, crown, branches, twigs, longer, habit.hang))

    def mesh(self, rng: np.random.Generator, bark: Color, twig: Color, width: float) -> Mesh:
        """Mesh of all branches in the colors of the bark and the twigs; twigs are ``width`` times as wide as usual."""
        twigs = slivers(rng, self.twigs.points_m[:, ::2], width * _TWIG_M, twig)
        return Mesh.merge([spikes(self.limbs, bark), ribbons(rng, self.branches, width * _TWIG_M, twig), twigs])

    def coarse(self, rng: np.random.Generator, bark: Color, twig: Color) -> Mesh:
        """Mesh for distant views: limbs, and one wide triangle for each branch with its twigs."""
        return Mesh.merge(
            [spikes(self.limbs, bark), slivers(rng, self.branches.points_m[:, ::2], _COARSE_TWIG_M, twig)]
        )


def spikes(shoots: Shoots, color: Color) -> Mesh:
    """Build three-sided branches that end in a point, of 9 triangles each."""
    points_m = shoots.points_m
    count = len(points_m)
    along = _unit(points_m[:, 2] - points_m[:, 0])
    across = _unit(np.cross(along, np.where(np.abs(along[:, 2:]) < 0.8, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])))
    turn = np.arange(3) * 2.0 * np.pi / 3.0
    around = np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * np.cross(along, across)[:, None]
    rings = [
        points_m[:, k, None] + scale * shoots.radius_m[:, None, None] * around for k, scale in ((0, 1.0), (1, 0.62))
    ]
    vertices = np.concatenate([*rings, points_m[:, 2:]], axis=1)
    normals = np.concatenate([around, around, along[:, None]], axis=1)
    ring = np.array(
        [[k, (k + 1) % 3, 3 + (k + 1) % 3] for k in range(3)] + [[k, 3 + (k + 1) % 3, 3 + k] for k in range(3)]
    )
    faces = np.concatenate([ring, [[3 + k, 3 + (k + 1) % 3, 6] for k in range(3)]])
    triangles = 7 * np.arange(count)[:, None, None] + faces
    uv = np.stack([np.zeros(vertices.shape[:2]), vertices[..., 2]], axis=-1)
    return _woody(Material.BARK, vertices, normals, triangles, color, uv)


def ribbons(rng: np.random.Generator, shoots: Shoots, min_half_width_m: float, color: Color) -> Mesh:
    """Build flat, bent branches that end in a point, of 3 triangles each, turned at random."""
    points_m, count = shoots.points_m, len(shoots.points_m)
    along = _unit(points_m[:, 2] - points_m[:, 0])
    across = _unit(np.cross(along, rng.normal(size=(count, 3))))
    wide = across * np.maximum(shoots.radius_m, min_half_width_m)[:, None]
    start, bend, tip = np.moveaxis(points_m, 1, 0)
    vertices = np.stack([start - wide, start + wide, bend - 0.7 * wide, bend + 0.7 * wide, tip], axis=1)
    normals = np.repeat(_unit(np.cross(across, along) + 0.3 * _UP)[:, None], 5, axis=1)
    triangles = 5 * np.arange(count)[:, None, None] + np.array([[0, 1, 3], [0, 3, 2], [2, 3, 4]])
    return _woody(Material.TWIG, vertices, normals, triangles, color, vertices[..., :2])


def slivers(rng: np.random.Generator, ends_m: Float64Array, half_width_m: float, color: Color) -> Mesh:
    """Build pointed triangles from (N, 2, 3) starts and tips, each turned and shaded at random."""
    count = len(ends_m)
    along = _unit(ends_m[:, 1] - ends_m[:, 0])
    across = _unit(np.cross(along, rng.normal(size=(count, 3)))) * half_width_m * rng.uniform(0.7, 1.3, (count, 1))
    vertices = np.stack([ends_m[:, 0] - across, ends_m[:, 0] + across, ends_m[:, 1]], axis=1)
    normals = np.repeat(
        _unit(np.cross(across, along) + 0.6 * rng.normal(size=(count, 3)) + [0.0, 0.0, 0.3])[:, None], 3, axis=1
    )
    mesh = _woody(Material.TWIG, vertices, normals, np.arange(3 * count), color, vertices[..., :2])
    shades = np.clip(np.array(color) * rng.normal(1.0, 0.12, (count, 1)), 0.0, 255.0)
    return replace(mesh, color=np.repeat(shades.astype(np.uint8), 3, axis=0))


def _woody(
    material: Material,
    vertices: Float64Array,
    normals: Float64Array,
    triangles: Int64Array,
    color: Color,
    uv: Float64Array,
) -> Mesh:
    return Mesh.indexed(
        vertices.reshape(-1, 3),
        triangles.reshape(-1, 3).astype(np.int32),
        normals=normals.reshape(-1, 3),
        material=material,
        tag=Tag.VEGETATION,
        color=color,
        uv=uv.reshape(-1, 2),
    )


def _bent(
    rng: np.random.Generator,
    starts_m: Float64Array,
    directions: Float64Array,
    length_m: Float64Array,
    rise: float,
    radius_m: Float64Array,
) -> Shoots:
    """Branches that turn upward in their second half by the slope ``rise``, downward if it is negative."""
    half_m = length_m[:, None] / 2.0
    bends_m = starts_m + half_m * _unit(directions + rng.normal(0.0, 0.12, directions.shape))
    tips_m = bends_m + half_m * _unit(directions + rise * _UP + rng.normal(0.0, 0.12, directions.shape))
    return Shoots(np.stack([starts_m, bends_m, tips_m], axis=1), np.maximum(radius_m, 0.008))


def _tilted(along: Float64Array, tilt_rad: Float64Array, turn_rad: Float64Array) -> Float64Array:
    """(N, 3) unit vectors at (N,) angles from (N, 3) unit vectors, at (N,) angles around them."""
    side = _unit(np.cross(along, np.where(np.abs(along[:, 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])))
    outward = np.cos(turn_rad)[:, None] * side + np.sin(turn_rad)[:, None] * np.cross(along, side)
    return np.cos(tilt_rad)[:, None] * along + np.sin(tilt_rad)[:, None] * outward


def _unit(vectors: Float64Array) -> Float64Array:
    """(…, 3) vectors normalized to unit length."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9))
