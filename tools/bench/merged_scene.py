"""Baseline for benchmarks of ray casting: one Embree scene of one merged mesh, rebuilt for each tick."""

from collections.abc import Sequence, Set

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.foundation.types import Float32Array, Float64Array
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.embree import TriangleSet
from simbev_ros.simulation.raycast.static import StaticTriangles


class MergedScene:
    """The same triangles as in ``RayScene``, without its optimizations.

    Attributes:
        triangles: Number of triangles of the last build.
    """

    def __init__(
        self, static: StaticScene, models: Sequence[ActorModel], center_m: Float64Array, radius_m: float
    ) -> None:
        """Collect the static triangles around a point of the map frame, once."""
        self._models = models
        self._static, self._origin_m = StaticTriangles(static).mesh_around(center_m, radius_m)
        self.triangles = 0

    def build(self, state: WorldState, hidden_ids: Set[int]) -> None:
        """Pose all actors except the hidden ones, merge them with the static triangles, and build the scene."""
        actors = state.actors[~np.isin(state.actors["id"], sorted(hidden_ids))]
        posed = pose_actors(self._models, actors, self._origin_m)
        vertices = np.concatenate([self._static.vertices, posed.vertices])
        triangles = np.concatenate([self._static.triangles, posed.triangles + np.int32(len(self._static.vertices))])
        self.triangles = len(triangles)
        self._scene = TriangleSet(vertices, triangles)
        self._scene.build()

    def ranges_m(self, origin_m: Float64Array, directions: Float32Array) -> Float32Array:
        """(N,) ranges of the first hits of rays in (N, 3) directions from one point, inf where nothing is hit."""
        rays = np.empty((len(directions), 6), np.float32)
        rays[:, :3] = origin_m - self._origin_m
        rays[:, 3:] = directions
        return self._scene.cast(rays).range_m
