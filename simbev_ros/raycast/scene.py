"""What rays hit: the static tiles near a place and the actors of one tick."""

from collections.abc import Sequence, Set
from dataclasses import dataclass

import numpy as np

from simbev_ros.assets.actor_model import ActorModel
from simbev_ros.assets.static_scene import StaticScene
from simbev_ros.raycast.actors import ActorTriangles
from simbev_ros.raycast.static import StaticTriangles
from simbev_ros.scene.state import WorldState
from simbev_ros.types import Float32Array, Float64Array, UInt8Array, UInt32Array


@dataclass(frozen=True, slots=True)
class Hits:
    """First hits of (N,) rays.

    Attributes:
        range_m: (N,) float32, inf where nothing was hit; the other fields are 0 there.
        object_id: (N,) uint32 id of the actor, 0 on static surfaces.
        tag: (N,) uint8 semantic tag.
        material: (N,) uint8 material.
        normal: (N, 3) float32 unit normal of the triangle on the side that the ray comes from, map axes.
    """

    range_m: Float32Array
    object_id: UInt32Array
    tag: UInt8Array
    material: UInt8Array
    normal: Float32Array


class RayScene:
    """Geometry for rays. Its hits are a function of the world state alone; a replay repeats them to the bit."""

    def __init__(self, static: StaticScene, models: Sequence[ActorModel]) -> None:
        """Takes the immobile scene and the catalogue's models, indexed by blueprint."""
        self._static = StaticTriangles(static)
        self._actors = ActorTriangles(models)

    def update(
        self, state: WorldState, center_m: Float64Array, radius_m: float, hidden_ids: Set[int] = frozenset()
    ) -> None:
        """Moves to a tick.

        Args:
            state: The world now.
            center_m: (3,) map frame: where rays start, or the middle of it.
            radius_m: Everything nearer than this to the centre is there (in the ground plane).
            hidden_ids: Actors that rays pass through, such as the one that carries the sensor.
        """
        actors = state.actors
        reach_m = radius_m + np.hypot(actors["length"], actors["width"])
        near = np.hypot(actors["x"] - center_m[0], actors["y"] - center_m[1]) < reach_m
        near &= ~np.isin(actors["id"], sorted(hidden_ids))
        self._rows = actors[near]
        self._origin_m = np.asarray(center_m, np.float64)
        self._static.update(self._origin_m, radius_m)
        self._actors.update(self._rows, self._origin_m)

    def cast(self, origins_m: Float64Array, directions: Float32Array | Float64Array) -> Hits:
        """First hit of each ray.

        Args:
            origins_m: (N, 3) float64 in the map frame, or (1, 3) for rays that start at one point.
            directions: (N, 3) unit vectors, map axes.
        """
        directions = np.ascontiguousarray(directions, np.float32)
        static = self._static
        rays = np.empty((len(directions), 6), np.float32)
        rays[:, :3] = origins_m - static.origin_m
        rays[:, 3:] = directions
        hits = static.triangles.cast(rays)
        hit = hits.triangle >= 0
        range_m, normal = hits.range_m.copy(), hits.normal.copy()
        tag, material = np.zeros((2, len(rays)), np.uint8)
        tag[hit], material[hit] = static.tag[hits.triangle[hit]], static.material[hits.triangle[hit]]
        object_id = np.zeros(len(rays), np.uint32)
        moving = self._actors.cast(origins_m - self._origin_m, directions, range_m)
        range_m[moving.ray], normal[moving.ray] = moving.range_m, moving.normal
        material[moving.ray] = moving.material
        object_id[moving.ray], tag[moving.ray] = self._rows["id"][moving.row], self._rows["tag"][moving.row]
        normal[np.einsum("ni,ni->n", normal, directions) > 0] *= -1.0
        return Hits(range_m, object_id, tag, material, normal)
