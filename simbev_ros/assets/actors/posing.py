"""Poses actors' meshes as the world state prescribes and merges them, for ray casting and labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.skeletons import part_poses
from simbev_ros.foundation.geometry.ragged import ragged_starts
from simbev_ros.foundation.types import Float32Array, Float64Array, Int32Array, Table, UInt8Array, UInt32Array
from simbev_ros.schema.scene.state import map_from_actors


@dataclass(frozen=True, slots=True)
class PosedActors:
    """Merged triangles of several posed actors.

    Attributes:
        vertices: (V, 3) float32, meters, map axes, relative to the requested origin.
        triangles: (T, 3) int32 vertex indices.
        triangle_row: (T,) uint32, row of the actor in the table that was posed.
        vertex_model: (V,) int32, index of the vertex in its model's mesh (for material, color, normal).
    """

    vertices: Float32Array
    triangles: Int32Array
    triangle_row: UInt32Array
    vertex_model: Int32Array


def pose_actors(models: Sequence[ActorModel], actors: Table, origin_m: Float64Array) -> PosedActors:
    """Pose the meshes of (N,) ``ACTOR_DTYPE`` rows and merge them in row order.

    Args:
        models: Models of the catalog, indexed by blueprint.
        actors: (N,) ``ACTOR_DTYPE`` rows to pose.
        origin_m: (3,) point of the map frame that becomes the origin (keeps float32 exact on large maps).
    """
    blueprints, kind = np.unique(actors["blueprint"], return_inverse=True)
    meshes = [models[blueprint].mesh for blueprint in blueprints.tolist()]
    vertex_counts = np.array([len(mesh.vertices) for mesh in meshes], np.int64)[kind]
    triangle_counts = np.array([len(mesh.triangles) for mesh in meshes], np.int64)[kind]
    first_vertex, first_triangle = ragged_starts(vertex_counts), ragged_starts(triangle_counts)
    vertices = np.empty((int(vertex_counts.sum()), 3), np.float32)
    triangles = np.empty((int(triangle_counts.sum()), 3), np.int32)
    vertex_model = np.empty(len(vertices), np.int32)
    origin_from_actor = map_from_actors(actors)
    origin_from_actor[:, :3, 3] -= origin_m
    for blueprint, mesh in zip(blueprints.tolist(), meshes, strict=True):
        rows = np.flatnonzero(actors["blueprint"] == blueprint)
        posed = _pose_vertices(models[blueprint], actors[rows], origin_from_actor[rows])
        indices = np.arange(len(mesh.vertices), dtype=np.int32)
        for row, row_vertices in zip(rows, posed, strict=True):
            target = slice(first_vertex[row], first_vertex[row] + len(mesh.vertices))
            vertices[target] = row_vertices
            vertex_model[target] = indices
            target = slice(first_triangle[row], first_triangle[row] + len(mesh.triangles))
            np.add(mesh.triangles, first_vertex[row], out=triangles[target], casting="same_kind")
    return PosedActors(
        vertices, triangles, np.repeat(np.arange(len(actors), dtype=np.uint32), triangle_counts), vertex_model
    )


def _pose_vertices(model: ActorModel, actors: Table, origin_from_actor: Float64Array) -> Float32Array:
    """(N, V, 3) vertices of actors that share a model, at (N, 4, 4) poses."""
    origin_from_part = (origin_from_actor[:, None] @ part_poses(model, actors)).astype(np.float32)
    rotations = origin_from_part[..., :3, :3].swapaxes(-1, -2)
    translations = origin_from_part[..., None, :3, 3]
    posed = np.empty((len(actors), len(model.mesh.vertices), 3), np.float32)
    for start, stop in _runs(model.mesh.part):
        part = model.mesh.part[start]
        np.matmul(model.mesh.vertices[start:stop], rotations[:, part], out=posed[:, start:stop])
        posed[:, start:stop] += translations[:, part]
    return posed


def _runs(part: UInt8Array) -> list[tuple[int, int]]:
    """Ranges of consecutive vertices of the same part; models keep the vertices of a part together."""
    borders = [0, *(np.flatnonzero(np.diff(part)) + 1).tolist(), len(part)]
    return list(pairwise(borders)) if len(part) else []
