"""Ray casting scene: static tiles around the sensor and the actors of one tick, or of the ticks up to it.

Lidars, radars and labels update a ``RayScene`` with world states and cast rays into it.
"""

from collections.abc import Sequence, Set
from dataclasses import dataclass, fields

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.foundation.types import (
    BoolArray,
    Float32Array,
    Float64Array,
    Int32Array,
    Int64Array,
    Table,
    UInt8Array,
    UInt32Array,
)
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.scene.interpolation import ActorHistory, earlier_rows
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.actors import ActorTriangles
from simbev_ros.simulation.raycast.embree import relative_rays
from simbev_ros.simulation.raycast.motion import body_velocities, part_velocities
from simbev_ros.simulation.raycast.part_stack import PartStack
from simbev_ros.simulation.raycast.static import StaticTriangles


@dataclass(frozen=True, slots=True)
class Hits:
    """First hits of (N,) rays.

    Attributes:
        range_m: (N,) float32 range, inf where nothing was hit; unless stated otherwise other fields are 0 there.
        object_id: (N,) uint32 id of the actor, 0 on static surfaces.
        row: (N,) int32 row of the actor in ``RayScene.actors``, -1 on static surfaces and where nothing was hit.
        part: (N,) int32 rigid part of the actor that was hit, an index into its model's parts; -1 as ``row``.
        tag: (N,) uint8 semantic tag.
        material: (N,) uint8 material.
        normal: (N, 3) float32 unit normal of the triangle on the side of the ray's origin, map axes.
        cos_angle: (N,) float32 cosine of the angle between the ray and the normal, 0 grazing, 1 perpendicular.
        triangle: (N,) int32 static triangle that the ray meets first, -1 for none; an actor may be ahead of it.
        barycentric: (N, 2) float32 weights of the second and third corner of this triangle.
    """

    range_m: Float32Array
    object_id: UInt32Array
    row: Int32Array
    part: Int32Array
    tag: UInt8Array
    material: UInt8Array
    normal: Float32Array
    cos_angle: Float32Array
    triangle: Int32Array
    barycentric: Float32Array

    def of(self, rays: Int64Array) -> "Hits":
        """The hits of some of the rays."""
        return Hits(*(getattr(self, field.name).take(rays, axis=0) for field in fields(self)))


class RayScene:
    """Scene that rays are cast into. Hits depend on the world states alone; a replay repeats them bit by bit.

    Scenes around several centers, such as those of several agents, are updated separately; ``another`` makes them share
    everything that does not move.

    Attributes:
        static: The static triangles.
        parts: The rigid parts of all models.
        actors: (A,) ``ACTOR_DTYPE`` rows, at the tick, of the actors that rays can hit.
    """

    def __init__(self, static: StaticScene | StaticTriangles, models: Sequence[ActorModel] | PartStack) -> None:
        """Create the scene from the static world and the catalog's models, indexed by blueprint, or their parts."""
        self.static = static if isinstance(static, StaticTriangles) else StaticTriangles(static)
        self.parts = models if isinstance(models, PartStack) else PartStack(models)
        self._actors = ActorTriangles(self.parts)

    def another(self) -> "RayScene":
        """A scene of the same world, not updated yet, for another center; both share static triangles and models."""
        return RayScene(self.static.another(), self.parts)

    def update(
        self,
        state: WorldState,
        center_m: Float64Array,
        radius_m: float,
        hidden_ids: Set[int] = frozenset(),
        earlier: Sequence[WorldState] = (),
    ) -> None:
        """Update the scene to a tick.

        Args:
            state: World state now.
            center_m: (3,) origin of the rays, or the center of their origins, map frame.
            radius_m: Distance from the center, in the ground plane, up to which the scene is complete.
            hidden_ids: Ids of actors that rays pass through, such as the one that carries the sensor.
            earlier: World states at the preceding ticks, as far back as rays are cast; empty if all are cast now.
        """
        course = ActorHistory.of(state, earlier)
        near = np.any([_are_near(actors, center_m, radius_m) for actors in course.tables], axis=0)
        course = course.only(near & ~np.isin(state.actors["id"], sorted(hidden_ids)))
        self.actors: Table = course.now
        self._stamp_ns = state.stamp_ns
        self._near = self.static.triangles_around(np.asarray(center_m, np.float64), radius_m)
        self._actors.update(course, np.asarray(center_m, np.float64))

    def build_ahead(self, center_m: Float64Array, radius_m: float) -> None:
        """Prepare the static triangles around a point that will soon be the center of an ``update``."""
        self.static.triangles_around(np.asarray(center_m, np.float64), radius_m)

    def cast(
        self,
        origins_m: Float64Array,
        directions: Float32Array | Float64Array,
        lag_s: Float64Array | None = None,
    ) -> Hits:
        """Find the first hit of each ray.

        Args:
            origins_m: (N, 3) float64 in the map frame, or (1, 3) for rays that start at one point.
            directions: (N, 3) unit vectors, map axes.
            lag_s: (N,) time before the tick at which each ray is cast; None: all at the tick.
        """
        directions = np.ascontiguousarray(directions, np.float32)
        near = self._near
        hits = near.triangles.cast(relative_rays(origins_m, near.origin_m, directions))
        range_m, normal = hits.range_m.copy(), hits.normal.copy()
        tag, material = near.tag.take(hits.triangle), near.material.take(hits.triangle)
        object_id = np.zeros(len(directions), np.uint32)
        row, part = np.full((2, len(directions)), -1, np.int32)
        moving = self._actors.cast(origins_m, directions, range_m, lag_s)
        range_m[moving.ray], normal[moving.ray] = moving.range_m, moving.normal
        material[moving.ray], row[moving.ray], part[moving.ray] = moving.material, moving.row, moving.part
        object_id[moving.ray], tag[moving.ray] = self.actors["id"][moving.row], self.actors["tag"][moving.row]
        facing = -(normal[:, 0] * directions[:, 0] + normal[:, 1] * directions[:, 1] + normal[:, 2] * directions[:, 2])
        normal[np.flatnonzero(facing < 0.0)] *= -1.0
        cos_angle = np.minimum(np.abs(facing), np.float32(1.0))
        return Hits(range_m, object_id, row, part, tag, material, normal, cos_angle, hits.triangle, hits.barycentric)

    def surface_coordinates(self, triangle: Int32Array, barycentric: Float32Array) -> Float32Array:
        """(N, 2) u and v, as ``Material`` defines them, of (N,) static hits since the last ``update``."""
        second, third = barycentric.T[..., None]
        corners = self._near.corners.take(triangle, axis=0)
        first_uv, second_uv, third_uv = (self._near.uv.take(corner, axis=0) for corner in corners.T)
        coordinates: Float32Array = first_uv + second * (second_uv - first_uv) + third * (third_uv - first_uv)
        return coordinates

    def velocities(self, hits: Hits, points_m: Float64Array, previous: WorldState | None = None) -> Float64Array:
        """Velocities of the points that were hit: zero on static surfaces and where nothing was hit.

        Args:
            hits: (N,) hits from ``cast`` since the last ``update``.
            points_m: (N, 3) points that were hit, map frame; ignored where nothing was hit.
            previous: World state one tick ago, for the motion of wheels, steering and limbs since then. If None, every
                point moves with the body of its actor.

        Returns:
            (N, 3) m/s, map axes.
        """
        velocity_mps = np.zeros((len(hits.row), 3))
        moving = np.flatnonzero(hits.row >= 0)
        row, part, position_m = hits.row[moving], hits.part[moving], np.asarray(points_m, np.float64)[moving]
        velocity_mps[moving] = body_velocities(self.actors[row], position_m)
        if previous is not None and len(moving):
            before = earlier_rows(self.actors, previous.actors)
            elapsed_s = (self._stamp_ns - previous.stamp_ns) / NS_PER_S
            velocity_mps[moving] += part_velocities(
                self.parts.skeletons, before, self.actors, elapsed_s, row, part, position_m
            )
        return velocity_mps


def _are_near(actors: Table, center_m: Float64Array, radius_m: float) -> BoolArray:
    """(N,) whether any part of an actor may be within a radius of a point in the ground plane."""
    reach_m = radius_m + np.hypot(actors["length"], actors["width"])
    return np.hypot(actors["x"] - center_m[0], actors["y"] - center_m[1]) < reach_m
