"""Building blocks of plants: trunks, branches, and irregular balls of leaves. Frame: origin at the foot, z up."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.graded import GradedMesh
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.mesh.primitives import Finish, solid, tube
from simbev_ros.assets.palette import Color, pick_color, shade_color
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Int32Array, Int64Array

ROOT_M = -0.4
"""Height at which trunks begin, below the ground."""

_THREE_SIDED = 1.21
"""Factor of the radius by which a triangular cross-section is on average as wide as a circular one."""
_ENVELOPE_COSINES = 0.85, 0.93
_INSIDE_ENVELOPE = 0.85  # share of a crown's vertices that lie inside of its coarse stand-in
_SPRIG_SHAPE = np.array([[-0.42, -0.42], [-0.42, 0.42], [0.6, 0.0]])  # along and across the sprig, over its length
_SPRIG_AREA = 0.43


def leaves(color: Color) -> Finish:
    """Finish of foliage."""
    return Finish(Material.FOLIAGE, Tag.VEGETATION, color)


def trunk(
    rng: np.random.Generator,
    spine_m: Float64Array,
    start_m: float,
    end_m: float,
    segments: int = 6,
    bark: str = "barks",
) -> GradedMesh:
    """Build a stem along an (N, 3) spine that tapers from radius ``start_m`` to ``end_m`` and flares at the root.

    ``bark`` is a palette. A stem of three ``segments`` is simple enough to be its own coarse stand-in.
    """
    finish = Finish(Material.BARK, Tag.VEGETATION, pick_color(rng, bark))
    foot_m, onward = spine_m[0] * [1.0, 1.0, 0.0], spine_m[1:]
    low_m = foot_m + (onward[0] - foot_m) * min(0.5, 0.4 / max(float(onward[0, 2]), 0.1))
    path_m = np.concatenate([np.array([foot_m + np.array([0.0, 0.0, ROOT_M]), foot_m, low_m]), onward])
    radii_m = np.concatenate([start_m * np.array([1.3, 1.25, 0.92]), np.linspace(start_m, end_m, len(onward) + 1)[1:]])
    ends = [0, 2, -1] if len(onward) > 1 else [0, -1]
    coarse = tube(finish, path_m[ends], _THREE_SIDED * radii_m[[2, *ends[1:]]], segments=3, crease_deg=180.0)
    if segments == 3:
        return GradedMesh(coarse, coarse)
    return GradedMesh(tube(finish, path_m, radii_m, segments=segments, crease_deg=80.0), coarse)


def branches(
    rng: np.random.Generator, fork_m: Float64Array, tips_m: Float64Array, radius_m: float, bark: Color
) -> GradedMesh:
    """Build bare three-sided branches, bent upward, from a fork to (N, 3) tips; the coarse mesh leaves them out."""
    finish = Finish(Material.BARK, Tag.VEGETATION, bark)
    bends_m = (fork_m + tips_m) / 2.0 + (tips_m - fork_m) * [0.12, 0.12, -0.08]
    starts_m = fork_m - np.array([0.0, 0.0, 1.0]) * rng.uniform(0.0, 0.5, (len(tips_m), 1))
    radii_m = radius_m * np.array([1.0, 0.7, 0.3])
    paths_m = np.stack([starts_m, bends_m, tips_m], axis=1)
    limbs = [tube(finish, path_m, radii_m, segments=3, crease_deg=180.0) for path_m in paths_m]
    return GradedMesh(Mesh.merge(limbs), Mesh.empty())


def crown(
    rng: np.random.Generator,
    middle_m: Float64Array,
    radii_m: Float64Array,
    sprigs: int,
    color: Color,
    lobes: int = 7,
    cover: float = 0.40,
    coarse_detail: int = 1,
    rise: float = -0.15,
) -> GradedMesh:
    """Build a large crown of several lobes: sprigs on solid cores, darker between the lobes.

    Args:
        rng: Random generator to draw from.
        middle_m: (3,) center of the crown.
        radii_m: (3,) radii of its envelope.
        sprigs: Number of sprigs.
        color: Color of the leaves.
        lobes: Number of smaller balls that form the crown.
        cover: Total area of the sprigs over the envelope's area.
        coarse_detail: Detail of the coarse mesh, see ``envelope``.
        rise: Slope of the sprigs, negative if they hang.
    """
    sizes = rng.uniform(0.38, 0.52, lobes) * (9.0 / lobes) ** 0.33
    lobe_centers = _spread_directions(rng, lobes) * (rng.uniform(0.94, 1.06, lobes) - sizes)[:, None]
    cores = [
        clump(
            rng, middle_m + spot * radii_m, 0.94 * size * radii_m, middle_m, shade_color(color, 0.85), irregularity=0.12
        )
        for spot, size in zip(lobe_centers, sizes, strict=True)
    ]
    cores = [_remove_hidden(core, (core.vertices - middle_m) / radii_m, lobe_centers, 0.75 * sizes) for core in cores]
    outward = _spread_directions(rng, sprigs)
    position, lobe = _lobe_surface(outward, lobe_centers, sizes)
    facing = _unit((position - lobe_centers[lobe]) / radii_m)
    positions_m = middle_m + position * rng.uniform(0.9, 1.0, (sprigs, 1)) * radii_m
    along = sprig_directions(rng, facing, 0.35, rise)
    hollow = np.linalg.norm(position, axis=1)
    tone = 0.78 + 0.34 * np.clip((hollow - 0.62) / 0.38, 0.0, 1.0)
    length_m = sprig_length_m(radii_m, sprigs, cover)
    exact = Mesh.merge([*cores, foliage(rng, positions_m, facing, along, middle_m, length_m, color, tone)])
    return GradedMesh(exact, envelope(exact, middle_m, detail=coarse_detail))


def _remove_hidden(mesh: Mesh, position: Float64Array, lobe_centers: Float64Array, sizes: Float64Array) -> Mesh:
    """Copy of a mesh without the triangles whose corners, at (V, 3) positions, are all inside balls."""
    inside = (np.linalg.norm(position[:, None] - lobe_centers, axis=2) < sizes).any(axis=1)
    return replace(mesh, triangles=mesh.triangles[~inside[mesh.triangles].all(axis=1)])


def _lobe_surface(
    outward: Float64Array, lobe_centers: Float64Array, sizes: Float64Array
) -> tuple[Float64Array, Int64Array]:
    """(N, 3) points where rays from the origin leave a union of balls, and (N,) index of the ball left last."""
    along = outward @ lobe_centers.T
    inside = sizes**2 - np.sum(lobe_centers**2, axis=1) + along**2
    reach = np.where(inside > 0.0, along + np.sqrt(np.maximum(inside, 0.0)), 0.3)
    lobe = reach.argmax(axis=1)
    return outward * np.take_along_axis(reach, lobe[:, None], axis=1), lobe


def ball(
    rng: np.random.Generator,
    center_m: Float64Array,
    radii_m: Float64Array,
    crown_center_m: Float64Array,
    sprigs: int,
    color: Color,
    rise: float = 0.0,
    cover: float = 0.35,
    coarse_detail: int = 1,
) -> GradedMesh:
    """Build a ball of leaves with few triangles: sprigs on one core.

    Args:
        rng: Random generator to draw from.
        center_m: (3,) center of the ball.
        radii_m: (3,) radii of the ball.
        crown_center_m: (3,) center of the crown that the ball is a part of.
        sprigs: Number of sprigs.
        color: Color of the leaves.
        rise: Slope of the sprigs, negative if they hang.
        cover: Total area of the sprigs over the core's area.
        coarse_detail: Detail of the coarse mesh, see ``envelope``.
    """
    outward = _spread_directions(rng, sprigs)
    core = clump(rng, center_m, radii_m * 0.93, crown_center_m, shade_color(color, 0.85), irregularity=0.16)
    positions_m = center_m + outward * radii_m * rng.uniform(0.8, 0.92, (sprigs, 1))
    facing = _unit(outward / radii_m)
    along, length_m = sprig_directions(rng, facing, 0.35, rise), sprig_length_m(radii_m, sprigs, cover)
    exact = Mesh.merge([core, foliage(rng, positions_m, facing, along, crown_center_m, length_m, color)])
    return GradedMesh(exact, envelope(exact, center_m, detail=coarse_detail))


def envelope(leafage: Mesh, middle_m: Float64Array, detail: int) -> Mesh:
    """Build the coarse stand-in of leaves: a closed, star-shaped surface around them in their mean color.

    Args:
        leafage: Mesh of the leaves.
        middle_m: (3,) center of the surface, among the leaves.
        detail: Subdivisions of the surface: 0 gives 20 triangles, 1 gives 80.
    """
    sphere, faces = _icosphere(detail)
    from_middle_m = leafage.vertices - middle_m
    half_m = np.abs(from_middle_m).max(axis=0)
    position = from_middle_m / half_m
    reach = np.linalg.norm(position, axis=1)
    near = (position / np.maximum(reach, 1e-9)[:, None]) @ sphere.T > _ENVELOPE_COSINES[detail]
    rank = np.sort(np.where(near, reach[:, None], -1.0), axis=0)
    last = len(rank) - 1 - np.round((1.0 - _INSIDE_ENVELOPE) * near.sum(axis=0)).astype(int)
    vertices = middle_m + sphere * np.maximum(rank[last, np.arange(len(sphere))], 0.3)[:, None] * half_m
    red, green, blue = leafage.color[leafage.triangles[:, 0]].mean(axis=0).round().astype(int).tolist()
    return solid(leaves((red, green, blue)), vertices, faces, crease_deg=180.0, uv=_box_projected(vertices[faces]))


def blossom(rng: np.random.Generator, middle_m: Float64Array, radii_m: Float64Array, count: int, color: Color) -> Mesh:
    """Build flowers on the upper half of a crown."""
    outward = _spread_directions(rng, count, min_z=0.1)
    positions_m = middle_m + 0.92 * outward * radii_m
    return foliage(rng, positions_m, outward, sprig_directions(rng, outward, 0.2, 0.0), middle_m, 0.16, color)


def foliage(
    rng: np.random.Generator,
    positions_m: Float64Array,
    outward: Float64Array,
    along: Float64Array,
    crown_center_m: Float64Array,
    length_m: float | Float64Array,
    color: Color,
    tone: float | Float64Array = 1.0,
) -> Mesh:
    """Build sprigs: pointed triangles, each with its own shade.

    Args:
        rng: Random generator to draw from.
        positions_m: (N, 3) positions of the sprigs.
        outward: (N, 3) unit normals of the surface that they grow on.
        along: (N, 3) unit vectors toward their tips.
        crown_center_m: (3,) point that the normals lean away from, so that the crown is shaded as a whole.
        length_m: Mean length of the sprigs, or (N,) mean length of each.
        color: Color of the crown.
        tone: Lightness, or (N,) lightness of each: less in hollows, which receive less light.
    """
    count = len(positions_m)
    across = _unit(np.cross(outward, along))
    size_m = (length_m * rng.uniform(0.7, 1.3, count))[:, None, None]
    shape_m = (_SPRIG_SHAPE + rng.normal(0.0, 0.09, (count, 3, 2))) * size_m
    corners_m = positions_m[:, None] + shape_m[..., :1] * along[:, None] + shape_m[..., 1:] * across[:, None]
    normals = outward[:, None] + 0.7 * _unit(corners_m - crown_center_m) + rng.normal(0.0, 0.1, (count, 1, 3))
    shade = np.broadcast_to(tone, count) * rng.normal(1.0, 0.04, count)
    return _leafage(rng, corners_m, _unit(normals), color, shade)


def blades(rng: np.random.Generator, corners_m: Float64Array, away_from_m: Float64Array, color: Color) -> Mesh:
    """Build leaves from (N, 3, 3) corners, shaded as if all faced away from a point."""
    normals = _unit(corners_m - away_from_m)
    return _leafage(rng, corners_m, normals, color, rng.normal(1.0, 0.06, len(corners_m)))


def _leafage(
    rng: np.random.Generator, corners_m: Float64Array, normals: Float64Array, color: Color, shade: Float64Array
) -> Mesh:
    """Triangles from (N, 3, 3) corners and normals, each with its own color, scaled by (N,) shades."""
    count = len(corners_m)
    mesh = Mesh.indexed(
        corners_m.reshape(-1, 3),
        np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        normals=normals.reshape(-1, 3),
        material=Material.FOLIAGE,
        tag=Tag.VEGETATION,
        color=color,
        uv=_box_projected(corners_m).reshape(-1, 2),
    )
    shades = np.clip(np.array(color) * shade[:, None] * rng.uniform(0.97, 1.03, (count, 3)), 0.0, 255.0)
    return replace(mesh, color=np.repeat(shades.astype(np.uint8), 3, axis=0))


def sprig_directions(rng: np.random.Generator, outward: Float64Array, lean: float, rise: float) -> Float64Array:
    """(N, 3) unit vectors along sprigs that overlap like shingles, with their tips outward."""
    along = rng.normal(0.0, 0.8, outward.shape)
    along -= 0.6 * np.sum(along * outward, axis=1, keepdims=True) * outward
    return _unit(along + lean * outward + [0.0, 0.0, rise])


def sprig_length_m(radii_m: Float64Array, sprigs: int, cover: float) -> float:
    """Mean length of sprigs whose total area is ``cover`` times that of an ellipsoid (Knud Thomsen's formula)."""
    a, b, c = radii_m**1.6
    area_m2 = 4.0 * np.pi * ((a * b + a * c + b * c) / 3.0) ** (1.0 / 1.6)
    return float(np.sqrt(cover * area_m2 / (_SPRIG_AREA * sprigs)))


def clump(
    rng: np.random.Generator,
    center_m: Float64Array,
    radii_m: float | Float64Array,
    crown_center_m: Float64Array,
    color: Color,
    irregularity: float = 0.22,
) -> Mesh:
    """Build an irregular ball of leaves; normals lean away from the crown's center, so that it is shaded as a whole."""
    sphere, faces = _icosphere(0)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn = turn * np.sign(np.linalg.det(turn))
    shape = sphere @ turn.T * rng.uniform(1.0 - irregularity, 1.0 + irregularity, (len(sphere), 1)) * radii_m
    vertices = center_m + shape
    mesh = solid(leaves(color), vertices, faces, crease_deg=180.0, uv=_box_projected(vertices[faces]))
    normals = _unit(mesh.normals + 0.5 * _unit(mesh.vertices - crown_center_m))
    return replace(mesh, normals=normals.astype(np.float32))


def _spread_directions(rng: np.random.Generator, count: int, min_z: float = -1.0) -> Float64Array:
    """(N, 3) unit vectors, even over the sphere above a height: a randomly rotated and perturbed Fibonacci lattice."""
    index = np.arange(count) + 0.5
    z, turn = 1.0 - (1.0 - min_z) * index / count, index * np.pi * (1.0 + 5.0**0.5) + rng.uniform(0.0, 2.0 * np.pi)
    radius = np.sqrt(1.0 - z**2)
    lattice = np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)
    return _unit(lattice + rng.normal(0.0, 0.12, (count, 3)))


def _unit(vectors: Float64Array) -> Float64Array:
    """(…, 3) vectors normalized to unit length."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9))


def _box_projected(corners_m: Float64Array) -> Float64Array:
    """(T, 3, 2) surface coordinates: each (3, 3) triangle projected along the axis that it faces most."""
    facing = np.abs(np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])).argmax(axis=1)
    others = np.array([[1, 2], [2, 0], [0, 1]])[facing]
    return np.take_along_axis(corners_m, others[:, None, :], axis=2)


@lru_cache(maxsize=4)
def _icosphere(detail: int) -> tuple[Float64Array, Int32Array]:
    """(V, 3) unit vectors and (T, 3) faces of an icosahedron with faces subdivided ``detail`` times into 4."""
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
