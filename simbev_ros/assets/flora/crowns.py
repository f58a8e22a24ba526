"""What plants are made of: trunks, and irregular balls of leaves. Frame: origin at the foot, z up."""

from dataclasses import replace
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

_LOBES = 8
_SPRIG_SHAPE = np.array([[-0.4, -0.48], [-0.4, 0.48], [0.62, 0.0]])  # along and across it, in its length
_SPRIG_AREA = 0.49


def leaves(color: Color) -> Finish:
    """Finish of foliage."""
    return Finish(Material.FOLIAGE, Tag.VEGETATION, color)


def trunk(rng: np.random.Generator, spine_m: Float64Array, start_m: float, end_m: float, segments: int = 5) -> Mesh:
    """A stem along an (N, 3) spine that grows thinner from radius ``start_m`` to ``end_m``."""
    finish = Finish(Material.BARK, Tag.VEGETATION, pick_color(rng, "barks"))
    return tube(finish, spine_m, np.linspace(start_m, end_m, len(spine_m)), segments=segments, crease_deg=80.0)


def crown(rng: np.random.Generator, middle_m: Float64Array, radii_m: Float64Array, sprigs: int, color: Color) -> Mesh:
    """A big ball of leaves with lobes: sprigs before a dark core."""
    lobes, outward = _spread(rng, _LOBES), _spread(rng, sprigs)
    lobe = lobes[(outward @ lobes.T).argmax(axis=1)]
    direction = _unit(outward - 0.6 * lobe)
    spots_m = middle_m + (0.55 * lobe + direction * rng.uniform(0.38, 0.5, (sprigs, 1))) * radii_m
    length_m = _sprig_m(radii_m, sprigs, cover=1.3)
    core = clump(rng, middle_m, radii_m * 0.8, middle_m, shaded(color, 0.6), irregularity=0.1)
    along = _sprouting(rng, direction, 0.5, -0.3)
    return Mesh.merged([core, foliage(rng, spots_m, direction, along, middle_m, length_m, color)])


def ball(
    rng: np.random.Generator,
    center_m: Float64Array,
    radii_m: Float64Array,
    crown_center_m: Float64Array,
    sprigs: int,
    color: Color,
    rise: float = 0.0,
    cover: float = 0.35,
) -> Mesh:
    """A ball of leaves of few triangles: sprigs on a core.

    Args:
        rng: Drawn from.
        center_m: (3,) of the ball.
        radii_m: (3,) of the ball.
        crown_center_m: (3,) of the crown that it is a part of.
        sprigs: How many.
        color: Of the leaves.
        rise: Slope of the sprigs, negative where they hang.
        cover: Their area, of the core's.
    """
    outward = _spread(rng, sprigs)
    core = clump(rng, center_m, radii_m * 0.93, crown_center_m, shaded(color, 0.87), irregularity=0.16)
    spots_m = center_m + outward * radii_m * rng.uniform(0.74, 0.88, (sprigs, 1))
    facing = _unit(outward / radii_m)
    along, length_m = _sprouting(rng, facing, 0.5, rise), _sprig_m(radii_m, sprigs, cover)
    return Mesh.merged([core, foliage(rng, spots_m, facing, along, crown_center_m, length_m, color)])


def blossom(rng: np.random.Generator, middle_m: Float64Array, radii_m: Float64Array, count: int, color: Color) -> Mesh:
    """Flowers on the upper half of a crown."""
    outward = _spread(rng, count, lowest=0.1)
    return foliage(rng, middle_m + outward * radii_m, outward, _sprouting(rng, outward, 0.2, 0.0), middle_m, 0.3, color)


def foliage(
    rng: np.random.Generator,
    spots_m: Float64Array,
    outward: Float64Array,
    along: Float64Array,
    crown_center_m: Float64Array,
    length_m: float | Float64Array,
    color: Color,
) -> Mesh:
    """Sprigs: pointed triangles, each of a shade of its own.

    Args:
        rng: Drawn from.
        spots_m: (N, 3) where they are.
        outward: (N, 3) unit vectors off what they grow on.
        along: (N, 3) unit vectors towards their tips.
        crown_center_m: (3,) what the normals lean away from, so that the crown shades as one.
        length_m: Of the sprigs, on average; or (N,) of each.
        color: Of the crown.
    """
    count = len(spots_m)
    across = _unit(np.cross(outward, along))
    size_m = (length_m * rng.uniform(0.7, 1.3, count))[:, None, None]
    shape_m = (_SPRIG_SHAPE + rng.normal(0.0, 0.09, (count, 3, 2))) * size_m
    corners_m = spots_m[:, None] + shape_m[..., :1] * along[:, None] + shape_m[..., 1:] * across[:, None]
    normals = _unit(outward[:, None] + 0.6 * _unit(corners_m - crown_center_m))
    mesh = Mesh.indexed(
        corners_m.reshape(-1, 3),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        normals=normals.reshape(-1, 3),
        material=Material.FOLIAGE,
        tag=Tag.VEGETATION,
        color=color,
        uv=_box_projected(corners_m).reshape(-1, 2),
    )
    light = 0.94 + 0.14 * _unit(spots_m - crown_center_m)[:, 2:] + rng.normal(0.0, 0.08, (count, 1))
    shades = np.clip(np.array(color) * light * rng.uniform(0.94, 1.06, (count, 3)), 0.0, 255.0)
    return replace(mesh, color=np.repeat(shades.astype(np.uint8), 3, axis=0))


def _sprouting(rng: np.random.Generator, outward: Float64Array, lean: float, rise: float) -> Float64Array:
    """(N, 3) unit vectors along sprigs that lie like shingles on leaves below, tips out."""
    return _unit(rng.normal(0.0, 0.8, outward.shape) + lean * outward + [0.0, 0.0, rise])


def _sprig_m(radii_m: Float64Array, sprigs: int, cover: float) -> float:
    """So long that sprigs cover an ellipsoid (area after Knud Thomsen) by a factor."""
    a, b, c = radii_m**1.6
    area_m2 = 4.0 * np.pi * ((a * b + a * c + b * c) / 3.0) ** (1.0 / 1.6)
    return float(np.sqrt(cover * area_m2 / (_SPRIG_AREA * sprigs)))


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


def _spread(rng: np.random.Generator, count: int, lowest: float = -1.0) -> Float64Array:
    """(N, 3) directions spread evenly over the sphere above a height (Fibonacci lattice), turned and disturbed."""
    index = np.arange(count) + 0.5
    z, turn = 1.0 - (1.0 - lowest) * index / count, index * np.pi * (1.0 + 5.0**0.5) + rng.uniform(0.0, 2.0 * np.pi)
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
