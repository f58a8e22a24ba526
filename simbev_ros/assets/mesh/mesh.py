"""Triangle mesh with per-vertex attributes. Cameras, lidar and labels all read its arrays, so they agree."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float32Array, Float64Array, Int32Array, UInt8Array


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles with per-vertex attributes; the three corners of a triangle share material, tag, color and part.

    Attributes:
        vertices: (V, 3) float32, meters, in the mesh's own frame (z up).
        normals: (V, 3) float32, unit length, outward.
        uv: (V, 2) float32, surface coordinates; their meaning depends on the material (see ``Material``).
        color: (V, 3) uint8, sRGB albedo.
        material: (V,) uint8, a ``Material``.
        tag: (V,) uint8, a semantic ``Tag``.
        part: (V,) uint8, index of the rigid part that moves the vertex; 0 is the body.
        triangles: (T, 3) int32, counter-clockwise seen from outside.
    """

    vertices: Float32Array
    normals: Float32Array
    uv: Float32Array
    color: UInt8Array
    material: UInt8Array
    tag: UInt8Array
    part: UInt8Array
    triangles: Int32Array

    @classmethod
    def flat(
        cls,
        corners: Float64Array,
        *,
        material: Material,
        tag: Tag,
        color: tuple[int, int, int],
        uv: Float64Array | None = None,
        part: int = 0,
    ) -> Self:
        """Create a flat-shaded mesh from separate triangles.

        Args:
            corners: (T, 3, 3) triangle corners, meters, counter-clockwise seen from outside.
            material: Material of all triangles.
            tag: Semantic tag of all triangles.
            color: sRGB albedo 0..255.
            uv: (T, 3, 2) surface coordinates; x, y of the corners when omitted.
            part: Rigid part of all vertices.
        """
        corners = np.asarray(corners, np.float64).reshape(-1, 3, 3)
        face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        face_normals /= np.maximum(np.linalg.norm(face_normals, axis=1, keepdims=True), 1e-20)
        return cls.indexed(
            corners.reshape(-1, 3),
            np.arange(corners.shape[0] * 3, dtype=np.int32).reshape(-1, 3),
            normals=np.repeat(face_normals, 3, axis=0),
            material=material,
            tag=tag,
            color=color,
            uv=None if uv is None else np.asarray(uv).reshape(-1, 2),
            part=part,
        )

    @classmethod
    def indexed(
        cls,
        vertices: Float64Array,
        triangles: Int32Array,
        *,
        normals: Float64Array,
        material: Material,
        tag: Tag,
        color: tuple[int, int, int],
        uv: Float64Array | None = None,
        part: int = 0,
    ) -> Self:
        """Create a mesh of one material from shared vertices.

        Args:
            vertices: (V, 3) positions, meters.
            triangles: (T, 3) vertex indices, counter-clockwise seen from outside.
            normals: (V, 3) unit normals.
            material: Material of all triangles.
            tag: Semantic tag of all triangles.
            color: sRGB albedo 0..255.
            uv: (V, 2) surface coordinates; x, y of the vertices when omitted.
            part: Rigid part of all vertices.
        """
        count = len(vertices)
        return cls(
            vertices=np.ascontiguousarray(vertices, np.float32),
            normals=np.ascontiguousarray(normals, np.float32),
            uv=np.ascontiguousarray(vertices[:, :2] if uv is None else uv, np.float32),
            color=np.full((count, 3), color, np.uint8),
            material=np.full(count, int(material), np.uint8),
            tag=np.full(count, int(tag), np.uint8),
            part=np.full(count, part, np.uint8),
            triangles=np.ascontiguousarray(triangles, np.int32).reshape(-1, 3),
        )

    @classmethod
    def empty(cls) -> Self:
        """Create a mesh without triangles."""
        return cls.flat(np.zeros((0, 3, 3)), material=Material.PLAIN, tag=Tag.UNLABELED, color=(0, 0, 0))

    @classmethod
    def merge(cls, meshes: Sequence["Mesh"]) -> Self:
        """Merge meshes into one that has the triangles of all, in order."""
        if not meshes:
            return cls.empty()
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
        return cls(
            vertices=np.concatenate([mesh.vertices for mesh in meshes]),
            normals=np.concatenate([mesh.normals for mesh in meshes]),
            uv=np.concatenate([mesh.uv for mesh in meshes]),
            color=np.concatenate([mesh.color for mesh in meshes]),
            material=np.concatenate([mesh.material for mesh in meshes]),
            tag=np.concatenate([mesh.tag for mesh in meshes]),
            part=np.concatenate([mesh.part for mesh in meshes]),
            triangles=np.concatenate(
                [mesh.triangles + np.int32(start) for mesh, start in zip(meshes, starts, strict=True)]
            ),
        )

    def transform(self, target_from_mesh: Float64Array) -> "Mesh":
        """Copy of the mesh under a (4, 4) rigid or scaling transform (normals are renormalized; uv stays)."""
        linear = target_from_mesh[:3, :3]
        (a, b, c), (d, e, f), (g, h, i) = linear.tolist()
        cofactors = np.array(
            [
                [e * i - f * h, f * g - d * i, d * h - e * g],
                [c * h - b * i, a * i - c * g, b * g - a * h],
                [b * f - c * e, c * d - a * f, a * e - b * d],
            ]
        )
        keeps_hand = a * cofactors[0, 0] + b * cofactors[0, 1] + c * cofactors[0, 2] > 0.0
        normals = self.normals @ (cofactors.T if keeps_hand else -cofactors.T)
        normals /= np.maximum(np.sqrt(np.einsum("ij,ij->i", normals, normals)), 1e-20)[:, None]
        return replace(
            self,
            vertices=(self.vertices @ linear.T + target_from_mesh[:3, 3]).astype(np.float32),
            normals=normals.astype(np.float32),
            triangles=self.triangles if keeps_hand else np.ascontiguousarray(self.triangles[:, ::-1]),
        )

    def shift(self, x_m: float, y_m: float, z_m: float) -> "Mesh":
        """Copy of the mesh, moved."""
        return replace(self, vertices=(self.vertices + np.array([x_m, y_m, z_m])).astype(np.float32))

    def copies(self, target_from_mesh: Float64Array, tint: Float64Array | None = None) -> list["Mesh"]:
        """Transformed copies of the mesh, all in one step.

        Args:
            target_from_mesh: (N, 4, 4) rigid, mirroring or uniformly scaling transforms.
            tint: (N, 3) factors of the copies' colors; all ones when omitted.
        """
        linear = np.asarray(target_from_mesh, np.float64)[:, :3, :3]
        transposed = np.swapaxes(linear, 1, 2)
        handedness = np.linalg.det(linear)
        vertices = self.vertices.astype(np.float64) @ transposed + target_from_mesh[:, None, :3, 3]
        normals = self.normals.astype(np.float64) @ (transposed / np.cbrt(np.abs(handedness))[:, None, None])
        mirrored = np.ascontiguousarray(self.triangles[:, ::-1])
        vertices, normals = vertices.astype(np.float32), normals.astype(np.float32)
        colors = [self.color] * len(linear)
        if tint is not None:
            colors = list(np.clip(self.color * np.asarray(tint)[:, None, :], 0, 255).astype(np.uint8))
        return [
            Mesh(v, n, self.uv, c, self.material, self.tag, self.part, mirrored if det < 0 else self.triangles)
            for v, n, c, det in zip(vertices, normals, colors, handedness, strict=True)
        ]

    @property
    def triangle_tag(self) -> UInt8Array:
        """(T,) semantic tag per triangle."""
        return self.tag[self.triangles[:, 0]]

    @property
    def bounds_m(self) -> Float64Array:
        """(2, 3) minimum and maximum corner, meters; zeros if the mesh is empty."""
        if len(self.vertices) == 0:
            return np.zeros((2, 3))
        # Column by column: along the first of two axes, numpy takes 40 times as long.
        return np.array([[x.min(), x.max()] for x in self.vertices.T], np.float64).T
