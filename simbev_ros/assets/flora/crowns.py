"""What plants are made of: trunks, and irregular balls of leaves. Frame: origin at the foot, z up."""

from dataclasses import fields, replace
from functools import lru_cache

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.palette import Color, pick_color, shaded
from simbev_ros.assets.primitives import Finish, solid, tube
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array, Int32Array

ROOT_M = -0.4
"""Trunks begin so much below the ground."""

_CORE = 0.8  # size of a crown's core, of the whole crown's
_SURELY_INSIDE_CORE, _SURELY_INSIDE_CLUMP = 0.86, 0.62  # smallest radius of these irregular balls


def leaves(color: Color) -> Finish:
    """Finish of foliage."""
    return Finish(Material.FOLIAGE, Tag.VEGETATION, color)


def trunk(rng: np.random.Generator, spine_m: Float64Array, start_m: float, end_m: float, segments: int = 5) -> Mesh:
    """A stem along an (N, 3) spine that grows thinner from radius ``start_m`` to ``end_m``."""
    finish = Finish(Material.BARK, Tag.VEGETATION, pick_color(rng, "barks"))
    return tube(finish, spine_m, np.linspace(start_m, end_m, len(spine_m)), segments=segments, crease_deg=80.0)


def crown(rng: np.random.Generator, middle_m: Float64Array, radii_m: Float64Array, clumps: int, color: Color) -> Mesh:
    """A core of leaves with clumps around it; what lies inside is left out."""
    pieces = []
    core = clump(rng, middle_m, radii_m * _CORE, middle_m, shaded(color, 0.84), detail=1, irregularity=0.08)
    for direction in _spread(rng, clumps):
        center_m = middle_m + direction * radii_m * rng.uniform(0.62, 0.82)
        size_m = radii_m[0] * rng.uniform(0.36, 0.56)
        light = 0.86 + 0.22 * (direction[2] + 1.0) / 2.0 + rng.uniform(-0.05, 0.05)
        ball = clump(rng, center_m, size_m, middle_m, shaded(color, light))
        pieces.append(_outside(ball, middle_m, radii_m * _CORE * _SURELY_INSIDE_CORE))
        core = _outside(core, center_m, size_m * _SURELY_INSIDE_CLUMP)
    return Mesh.merged([*pieces, core])


def clump(
    rng: np.random.Generator,
    center_m: Float64Array,
    radii_m: float | Float64Array,
    crown_center_m: Float64Array,
    color: Color,
    detail: int = 0,
    irregularity: float = 0.22,
) -> Mesh:
    """An irregular ball of leaves; normals lean away from the middle of the crown, so that the crown shades as one."""
    sphere, faces = _icosphere(detail)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn = turn * np.sign(np.linalg.det(turn))
    shape = sphere @ turn.T * rng.uniform(1.0 - irregularity, 1.0 + irregularity, (len(sphere), 1)) * radii_m
    vertices = center_m + shape
    mesh = solid(leaves(color), vertices, faces, crease_deg=180.0, uv=_box_projected(vertices[faces]))
    normals = _unit(mesh.normals + 0.5 * _unit(mesh.vertices - crown_center_m))
    return replace(mesh, normals=normals.astype(np.float32))


def _outside(mesh: Mesh, center_m: Float64Array, radii_m: float | Float64Array) -> Mesh:
    """The mesh without the triangles that lie wholly in an ellipsoid, where nobody sees them."""
    inside = np.linalg.norm((mesh.vertices - center_m) / radii_m, axis=1) < 1.0
    kept = mesh.triangles[~inside[mesh.triangles].all(axis=1)]
    used, triangles = np.unique(kept, return_inverse=True)
    arrays = {field.name: getattr(mesh, field.name)[used] for field in fields(Mesh) if field.name != "triangles"}
    return Mesh(**arrays, triangles=triangles.reshape(-1, 3).astype(np.int32))


def _spread(rng: np.random.Generator, count: int) -> Float64Array:
    """(N, 3) directions spread evenly over the sphere (Fibonacci lattice), turned and disturbed at random."""
    index = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * index / count, index * np.pi * (1.0 + 5.0**0.5) + rng.uniform(0.0, 2.0 * np.pi)
    radius = np.sqrt(1.0 - z**2)
    lattice = np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)
    return _unit(lattice + rng.normal(0.0, 0.12, (count, 3)))


def _unit(vectors: Float64Array) -> Float64Array:
    """(…, 3) vectors made one long."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9))


def _box_projected(corners_m: Float64Array) -> Float64Array:
    """(T, 3, 2) surface coordinates: each (3, 3) triangle seen along the axis that it faces most."""
    facing = np.abs(np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])).argmax(axis=1)
    others = np.array([[1, 2], [2, 0], [0, 1]])[facing]
    return np.take_along_axis(corners_m, others[:, None, :], axis=2)


@lru_cache(maxsize=4)
def _icosphere(detail: int) -> tuple[Float64Array, Int32Array]:
    """(V, 3) unit vectors and (T, 3) faces of an icosahedron, each face cut into 4 ``detail`` times."""
    phi = (1.0 + 5.0**0.5) / 2.0
    signs = np.array([[0, s, t * phi] for s in (-1.0, 1.0) for t in (-1.0, 1.0)])
    vertices = np.concatenate([np.roll(signs, shift, axis=1) for shift in range(3)])
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    edge = 2.0 / np.sqrt(1.0 + phi**2)
    near = np.abs(np.linalg.norm(vertices[:, None] - vertices[None], axis=2) - edge) < 1e-6
    triples = np.array([(a, b, c) for a in range(12) for b in range(a + 1, 12) for c in range(b + 1, 12)])
    faces = triples[
        near[triples[:, 0], triples[:, 1]] & near[triples[:, 1], triples[:, 2]] & near[triples[:, 0], triples[:, 2]]
    ]
    inward = np.linalg.det(vertices[faces]) < 0
    faces[inward] = faces[inward][:, ::-1]
    for _ in range(detail):
        corners = vertices[faces]
        middles = (corners + np.roll(corners, -1, axis=1)) / 2.0
        a, b, c = np.moveaxis(corners, 1, 0)
        ab, bc, ca = np.moveaxis(middles / np.linalg.norm(middles, axis=2, keepdims=True), 1, 0)
        cut = np.stack([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]])
        points = np.moveaxis(cut, 2, 0).reshape(-1, 3)
        _, first, index = np.unique(np.round(points, 6), axis=0, return_index=True, return_inverse=True)
        vertices, faces = points[first], index.reshape(-1, 3)
    return vertices, faces.astype(np.int32)
