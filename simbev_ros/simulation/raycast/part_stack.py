"""Rigid parts of all actor models in one immutable Embree scene, built once and shared by all ticks."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.foundation.types import Float32Array, Float64Array, Int32Array, Int64Array
from simbev_ros.simulation.raycast.embree import TriangleSet

_SKIN_M = 0.01
"""Margin of bounding boxes and spheres around a part, so that a ray can start on them outside of the part."""


class PartStack:
    """Every part of every model once, in its rest pose, stacked along z so that no bounding sphere meets another part.

    Arrays are per part, (P,), unless stated otherwise; the parts of a model are consecutive.

    Nothing of it depends on a scene, so ray casting scenes of different agents and nodes share one, threads included.

    Attributes:
        skeletons: Kinematics of the parts.
        first: (M + 1,) index of each model's first part, and the number of parts at the end.
        part: Index of the part in its model.
        center_m: (P, 3) center of the part's bounding box and sphere, actor frame.
        half_m: (P, 3) half sizes of the box.
        radius_m: Radius of the sphere.
        height_m: Position of the center in the stack, along z.
        triangles: Triangles of all parts, each part shifted to its position in the stack.
        triangle_part: (T,) part of each triangle.
        triangle_material: (T,) material of each triangle.
    """

    def __init__(self, models: Sequence[ActorModel]) -> None:
        self.skeletons = Skeletons(models)
        first, part, center_m, half_m, radius_m, vertices, triangles, material = [0], [], [], [], [], [], [], []
        for model in models:
            mesh = model.mesh
            owner = mesh.part[mesh.triangles[:, 0]]
            for index in np.unique(owner):
                used, own = np.unique(mesh.triangles[owner == index], return_inverse=True)
                points = mesh.vertices[used].astype(np.float64)
                low, high = points.min(axis=0), points.max(axis=0)
                center = (low + high) / 2.0
                part.append(int(index))
                center_m.append(center)
                half_m.append((high - low) / 2.0 + _SKIN_M)
                radius_m.append(float(np.linalg.norm(points - center, axis=1).max()) + _SKIN_M)
                vertices.append(points - center)
                triangles.append(own.reshape(-1, 3))
                material.append(mesh.material[used][own.reshape(-1, 3)[:, 0]])
            first.append(len(part))
        self.first = np.array(first)
        self.part = np.array(part, np.int64)
        self.center_m = np.array(center_m).reshape(-1, 3)
        self.half_m = np.array(half_m).reshape(-1, 3)
        self.radius_m = np.array(radius_m, np.float32)
        self.height_m: Float32Array = 2.0 * np.cumsum(self.radius_m) - self.radius_m
        self.height_m -= self.height_m[-1:] / 2.0
        self.triangle_part = np.repeat(np.arange(len(part)), [len(each) for each in triangles])
        self.triangle_material = np.concatenate([*material, np.zeros(0, np.uint8)])
        self.triangles = TriangleSet(*_stack_meshes(vertices, triangles, self.height_m))
        self.triangles.build()  # before threads of several nodes cast at the same time


@cache
def load_part_stack() -> PartStack:
    """The part stack of the catalog's models, which all nodes of a process share."""
    return PartStack(load_models())


def _stack_meshes(
    vertices: Sequence[Float64Array], triangles: Sequence[Int64Array], height_m: Float32Array
) -> tuple[Float32Array, Int32Array]:
    """(V, 3) vertices and (T, 3) triangles of all parts, each raised to its height in the stack."""
    starts = np.cumsum([0, *(len(each) for each in vertices)])[: len(triangles)]
    points = [each + np.array([0.0, 0.0, height]) for each, height in zip(vertices, height_m, strict=True)]
    corners = [each + start for each, start in zip(triangles, starts, strict=True)]
    return (
        np.concatenate([*points, np.zeros((0, 3))]).astype(np.float32),
        np.concatenate([*corners, np.zeros((0, 3), np.int64)]).astype(np.int32),
    )
