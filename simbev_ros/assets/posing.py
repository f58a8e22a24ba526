"""Actors' meshes put where the world says: the moving half of the geometry that rays and labels read."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.assets.actor_model import ActorModel, part_poses
from simbev_ros.scene.state import map_from_actors
from simbev_ros.types import Float32Array, Float64Array, Int32Array, Table, UInt32Array


@dataclass(frozen=True, slots=True)
class PosedActors:
    """Merged triangles of several actors.

    Attributes:
        vertices: (V, 3) float32, metres, map axes, relative to the origin asked for.
        triangles: (T, 3) int32.
        triangle_row: (T,) uint32, row of the actor in the table that was posed.
        vertex_model: (V,) int32, index of the vertex in its model's mesh (for material, colour, normal).
    """

    vertices: Float32Array
    triangles: Int32Array
    triangle_row: UInt32Array
    vertex_model: Int32Array


def pose_actors(models: Sequence[ActorModel], actors: Table, origin_m: Float64Array) -> PosedActors:
    """Meshes of (N,) ``ACTOR_DTYPE`` rows, posed and merged in row order.

    Args:
        models: The catalogue's models, indexed by blueprint.
        actors: Rows to pose.
        origin_m: (3,) point of the map frame that becomes the origin (keeps float32 exact on large maps).
    """
    vertices: list[Float32Array] = []
    triangles: list[Int32Array] = []
    rows: list[UInt32Array] = []
    vertex_model: list[Int32Array] = []
    start = 0
    map_from_actor = map_from_actors(actors)
    map_from_actor[:, :3, 3] -= origin_m
    poses_of = {
        int(blueprint): iter(part_poses(models[blueprint], actors[actors["blueprint"] == blueprint]))
        for blueprint in np.unique(actors["blueprint"])
    }
    for row, blueprint in enumerate(actors["blueprint"]):
        mesh = models[blueprint].mesh
        origin_from_part = map_from_actor[row] @ next(poses_of[int(blueprint)])
        transforms = origin_from_part[mesh.part, :3]
        posed = np.einsum("vij,vj->vi", transforms[:, :, :3], mesh.vertices) + transforms[:, :, 3]
        vertices.append(posed.astype(np.float32))
        triangles.append(mesh.triangles + np.int32(start))
        rows.append(np.full(len(mesh.triangles), row, np.uint32))
        vertex_model.append(np.arange(len(mesh.vertices), dtype=np.int32))
        start += len(mesh.vertices)
    if not vertices:
        return PosedActors(
            np.zeros((0, 3), np.float32), np.zeros((0, 3), np.int32), np.zeros(0, np.uint32), np.zeros(0, np.int32)
        )
    return PosedActors(
        np.concatenate(vertices), np.concatenate(triangles), np.concatenate(rows), np.concatenate(vertex_model)
    )
