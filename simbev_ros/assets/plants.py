"""Trees, bushes and hedges. Frame: origin at the foot, z up; ready to be turned and scaled into place."""

from collections.abc import Callable, Mapping
from dataclasses import fields, replace

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.palette import Color, pick_color, shaded
from simbev_ros.assets.primitives import Finish, lathe, loft, solid, tube
from simbev_ros.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.semantics import Tag
from simbev_ros.types import Float64Array, Int32Array


def round_tree(rng: np.random.Generator) -> Mesh:
    """A broad-leaved street tree, about 9 m high."""
    return _broad_leaved(rng, height_m=9.2, trunk_m=3.9, radius_m=2.3, clumps=10)


def tall_tree(rng: np.random.Generator) -> Mesh:
    """A tall, slender broad-leaved tree, about 13 m high."""
    return _broad_leaved(rng, height_m=13.0, trunk_m=4.2, radius_m=1.9, clumps=11)


def small_tree(rng: np.random.Generator) -> Mesh:
    """A young or ornamental tree, about 5 m high."""
    return _broad_leaved(rng, height_m=5.0, trunk_m=1.9, radius_m=1.4, clumps=7)


def conifer(rng: np.random.Generator) -> Mesh:
    """A spruce, about 11 m high: skirts of branches around a straight trunk."""
    color = pick_color(rng, "needles", 0.1)
    height_m, layers, around = rng.uniform(9.5, 12.5), 6, 10
    pieces = [_trunk(rng, np.array([[0.0, 0.0, -0.4], [0.0, 0.0, height_m * 0.6]]), 0.2, 0.08)]
    for layer in range(layers):
        low_m = 1.1 + (height_m - 1.6) * (layer / layers)
        reach_m = 0.27 * (height_m - low_m) * rng.uniform(0.9, 1.1) + 0.15
        top_m = min(height_m, low_m + reach_m * 1.15 + 0.9)
        jag = np.where(np.arange(around) % 2, 0.72, 1.0) * rng.uniform(0.88, 1.12, around)
        rings = [(0.12 * reach_m, low_m + 0.35 * reach_m), (reach_m, low_m), (0.0, top_m)]
        skirt = lathe(
            _leaves(shaded(color, rng.uniform(0.88, 1.12))), np.array(rings), segments=around, crease_deg=25.0
        )
        turn = rng.uniform(0.0, 2.0 * np.pi)
        pieces.append(_jagged(skirt, jag, turn, low_m, reach_m))
    return Mesh.merged(pieces)


def bush(rng: np.random.Generator) -> Mesh:
    """A bush, about 1.2 m high."""
    color = pick_color(rng, "hedges", 0.15)
    centers = np.column_stack([rng.normal(0.0, 0.32, (3, 2)), rng.uniform(0.35, 0.65, 3)])
    radii = rng.uniform(0.5, 0.7, 3)
    return Mesh.merged(
        [
            _clump(rng, center, radius, np.array([0.0, 0.0, 0.1]), color)
            for center, radius in zip(centers, radii, strict=True)
        ]
    )


def thicket(rng: np.random.Generator) -> Mesh:
    """The edge of a distant wood, about 12 m high and as wide: to be seen from afar only."""
    color = pick_color(rng, "needles" if rng.random() < 0.3 else "broad_leaves", 0.1)
    sizes = rng.uniform((3.5, 3.5, 4.0), (6.0, 6.0, 8.0), (4, 3))
    spots = np.column_stack([rng.uniform(-6.0, 6.0, (4, 2)), sizes[:, 2] * rng.uniform(0.4, 0.8, 4)])
    roots = np.array([0.0, 0.0, -4.0])
    return Mesh.merged(
        [
            _clump(rng, spot, size, roots, shaded(color, rng.uniform(0.7, 1.0)))
            for spot, size in zip(spots, sizes, strict=True)
        ]
    )


def hedge(rng: np.random.Generator, length_m: float) -> Mesh:
    """A clipped hedge along x from 0, about 1.3 m high and 0.7 m wide."""
    stations = np.linspace(0.0, length_m, max(2, round(length_m / 1.6) + 1))
    outline = np.array([[-0.35, -0.2], [0.35, -0.2], [0.36, 0.9], [0.22, 1.3], [-0.22, 1.3], [-0.36, 0.9]])
    profile = np.tile(outline, (len(stations), 1, 1)) + rng.normal(0.0, 0.035, (len(stations), 6, 2))
    sections = np.concatenate([np.broadcast_to(stations[:, None, None], (len(stations), 6, 1)), profile], axis=2)
    return loft(_leaves(pick_color(rng, "hedges", 0.1)), sections, crease_deg=60.0)


_CORE = 0.8  # size of a crown's core, of the whole crown's
_SURELY_INSIDE_CORE, _SURELY_INSIDE_CLUMP = 0.86, 0.62  # smallest radius of these irregular balls

Plant = Callable[[np.random.Generator], Mesh]
PLANTS: Mapping[str, Plant] = {
    "round": round_tree,
    "tall": tall_tree,
    "small": small_tree,
    "conifer": conifer,
    "bush": bush,
}


def _broad_leaved(rng: np.random.Generator, height_m: float, trunk_m: float, radius_m: float, clumps: int) -> Mesh:
    """Trunk, a core of leaves and clumps around it."""
    height_m *= rng.uniform(0.9, 1.15)
    color = pick_color(rng, "autumn_leaves" if rng.random() < 0.06 else "broad_leaves", 0.1)
    middle = np.array([*rng.normal(0.0, 0.15, 2), (height_m + trunk_m) / 2.0])
    radii = np.array([radius_m, radius_m, (height_m - trunk_m) / 2.0])
    spine = np.array([[0, 0, -0.4], [*rng.normal(0, 0.06, 2), trunk_m * 0.6], middle - [0, 0, radii[2] * 0.2]])
    thickness = 0.018 * height_m
    pieces = [_trunk(rng, spine, thickness, thickness * 0.45)]
    core = _clump(rng, middle, radii * _CORE, middle, shaded(color, 0.84), detail=1, irregularity=0.08)
    directions = _spread(rng, clumps)
    for direction in directions:
        center = middle + direction * radii * rng.uniform(0.62, 0.82)
        size = radius_m * rng.uniform(0.36, 0.56)
        light = 0.86 + 0.22 * (direction[2] + 1.0) / 2.0 + rng.uniform(-0.05, 0.05)
        clump = _clump(rng, center, size, middle, shaded(color, light))
        pieces.append(_outside(clump, middle, radii * _CORE * _SURELY_INSIDE_CORE))
        core = _outside(core, center, size * _SURELY_INSIDE_CLUMP)
    return Mesh.merged([*pieces, core])


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


def _clump(
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
    mesh = solid(_leaves(color), vertices, faces, crease_deg=180.0, uv=_box_projected(vertices[faces]))
    normals = _unit(mesh.normals + 0.5 * _unit(mesh.vertices - crown_center_m))
    return replace(mesh, normals=normals.astype(np.float32))


def _unit(vectors: Float64Array) -> Float64Array:
    """(…, 3) vectors made one long."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9))


def _box_projected(corners_m: Float64Array) -> Float64Array:
    """(T, 3, 2) surface coordinates: each (3, 3) triangle seen along the axis that it faces most."""
    facing = np.abs(np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])).argmax(axis=1)
    others = np.array([[1, 2], [2, 0], [0, 1]])[facing]
    return np.take_along_axis(corners_m, others[:, None, :], axis=2)


def _trunk(rng: np.random.Generator, spine_m: Float64Array, start_m: float, end_m: float) -> Mesh:
    finish = Finish(Material.BARK, Tag.VEGETATION, pick_color(rng, "barks"))
    return tube(finish, spine_m, np.linspace(start_m, end_m, len(spine_m)), segments=5, crease_deg=80.0)


def _leaves(color: Color) -> Finish:
    return Finish(Material.FOLIAGE, Tag.VEGETATION, color)


def _jagged(skirt: Mesh, jag: Float64Array, turn_rad: float, low_m: float, reach_m: float) -> Mesh:
    """The skirt with its rim pulled in and out, and turned about z."""
    rim = np.hypot(skirt.vertices[:, 0], skirt.vertices[:, 1]) > 0.9 * reach_m
    spoke = np.round(np.arctan2(skirt.vertices[:, 1], skirt.vertices[:, 0]) / (2.0 * np.pi) * len(jag)).astype(int)
    skirt.vertices[rim, :2] *= jag[spoke[rim] % len(jag), None]
    skirt.vertices[rim, 2] = low_m + (1.0 - jag[spoke[rim] % len(jag)]) * 0.8 * reach_m
    cosine, sine = np.cos(turn_rad), np.sin(turn_rad)
    skirt.uv[:] = skirt.vertices[:, :2] * 1.6
    return skirt.transformed(np.array([[cosine, -sine, 0, 0], [sine, cosine, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))


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


class Grove:
    """Stock of a few trees of each kind, of which turned, scaled and tinted copies are planted."""

    _VARIANTS = 4

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._stock = {kind: [make(rng) for _ in range(self._VARIANTS)] for kind, make in PLANTS.items()}

    def plant(self, kind: str, foot_m: Float64Array) -> tuple[Mesh, Float64Array]:
        """A copy of a plant of a kind, and its (4, 4) pose at a (3,) place."""
        mesh = self._stock[kind][int(self._rng.integers(self._VARIANTS))]
        pose = matrices_from_xyz_rpy(foot_m, np.array([0.0, 0.0, self._rng.uniform(0.0, 2.0 * np.pi)]))
        pose[:3, :3] *= self._rng.uniform(0.88, 1.12)
        tint = np.array([1.0, 1.0, 1.0]) + self._rng.uniform(-0.1, 0.1) + self._rng.uniform(-0.04, 0.04, 3)
        leaves = np.clip(mesh.color * tint, 0, 255).astype(np.uint8)
        return replace(mesh, color=np.where(mesh.material[:, None] == Material.FOLIAGE, leaves, mesh.color)), pose
