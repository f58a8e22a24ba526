"""Ground truth of camera images without OpenGL: Embree rays through the pixels, and the motion of the meshes.

Embree finds the triangle at a pixel's center; the hit point on it is then computed in float64. Rays through the
pixels' corners determine which pixels lie on a silhouette.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, apply, inverse
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array, Int64Array, Table
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.raycast.embree import TriangleSet
from simbev_ros.simulation.render.frame import CameraImages, CameraView

_JUMP = 0.01
"""Relative depth difference from the plane at the pixel's center above which a corner lies beyond a silhouette."""


@dataclass(frozen=True)
class Triangles:
    """Labeled triangles relative to an origin in the map frame, with their positions one frame before.

    Attributes:
        vertices_m: (V, 3) float64 positions now.
        before_m: (V, 3) float64 positions one frame before.
        corners: (T, 3) vertex indices.
        tag: (T,) semantic tag.
        actor: (T,) actor id, 0 for static surfaces.
        jointed: (T,) whether the triangle is on a part that moves relative to its actor.
        embree: The same triangles for rays.
    """

    vertices_m: Float64Array
    before_m: Float64Array
    corners: AnyArray
    tag: AnyArray
    actor: AnyArray
    jointed: BoolArray
    embree: TriangleSet

    @classmethod
    def of_static(cls, static: StaticScene, origin_m: Float64Array) -> Self:
        tiles = [tile for tile in static.tiles if len(tile.mesh.triangles)]
        positions_m = [tile.mesh.vertices + (tile.origin_m - origin_m) for tile in tiles]
        starts = np.cumsum([0, *(len(each) for each in positions_m)])
        vertices_m = np.concatenate(positions_m)
        corners = np.concatenate([tile.mesh.triangles + first for tile, first in zip(tiles, starts, strict=False)])
        tag = np.concatenate([tile.mesh.triangle_tag for tile in tiles])
        still = np.zeros(len(tag), np.int64)
        embree = TriangleSet(vertices_m.astype(np.float32), corners)
        return cls(vertices_m, vertices_m, corners, tag, still, still.astype(bool), embree)

    @classmethod
    def of_actors(
        cls, models: Sequence[ActorModel], state: WorldState, previous: WorldState, origin_m: Float64Array
    ) -> Self:
        """All actors except the ego."""
        actors = state.actors[~np.isin(state.actors["id"], sorted(state.ego_ids))]
        now, before = (pose_actors(models, rows, origin_m) for rows in (actors, _before(actors, previous.actors)))
        part = np.concatenate([models[row["blueprint"]].mesh.part for row in actors])[now.triangles[:, 0]]
        return cls(
            now.vertices.astype(np.float64),
            before.vertices.astype(np.float64),
            now.triangles,
            actors["tag"][now.triangle_row],
            actors["id"][now.triangle_row],
            part > 0,
            TriangleSet(now.vertices, now.triangles),
        )


def _before(actors: Table, previous: Table) -> Table:
    """Actors in their earlier state; actors that were not there before, in their present state."""
    known = {int(row["id"]): row for row in previous}
    return np.array([known.get(int(row["id"]), row) for row in actors], actors.dtype)


@dataclass(frozen=True)
class Truth:
    """Images of one camera; the arrays are (H, W).

    Attributes:
        semantic: Tag.
        instance: Actor id, 0 = none.
        depth_m: Along the optical axis, of a fisheye along the ray; +inf for the sky.
        flow_px: (H, W, 2) position now minus position in the frame before, NaN where the camera did not see that.
        inner: Pixels that are not on a silhouette.
        jointed: Pixels on wheels, limbs, doors.
    """

    semantic: AnyArray
    instance: AnyArray
    depth_m: Float64Array
    flow_px: Float64Array
    inner: BoolArray
    jointed: BoolArray


def truth_of(
    view: CameraView, still: Triangles, moving: Triangles, states: tuple[WorldState, WorldState], origin_m: Float64Array
) -> Truth:
    """Ground-truth images of a view, from the present state and that of the frame before."""
    now, before = (_origin_from_optical(view, state, origin_m) for state in states)
    camera, shape = view.camera, (view.camera.height_px, view.camera.width_px)
    pixels = _grid(shape)
    rays, outside = _rays(camera, pixels)
    kind, triangle, _ = _cast((still, moving), now, rays)
    depth_m, slope, before_m = np.full(len(rays), np.inf), np.zeros((len(rays), 3)), rays @ now[:3, :3].T
    tag, actor, jointed = np.full(len(rays), Tag.SKY), np.zeros(len(rays), np.int64), np.zeros(len(rays), bool)
    for index, triangles in enumerate((still, moving)):
        chosen = np.flatnonzero(kind == index)
        found = triangle[chosen]
        tag[chosen], actor[chosen], jointed[chosen] = (
            triangles.tag[found],
            triangles.actor[found],
            triangles.jointed[found],
        )
        corners = triangles.vertices_m[triangles.corners[found]]
        weights, depth_m[chosen], slope[chosen] = _arrival(now, rays[chosen], corners)
        before_m[chosen] = np.einsum("nk,nki->ni", weights, triangles.before_m[triangles.corners[found]])
    optical_from_map_before = inverse(before)
    sky = np.isinf(depth_m)[:, None]  # infinitely far: only rotation of the camera moves it
    seen = np.where(sky, before_m @ optical_from_map_before[:3, :3].T, apply(optical_from_map_before, before_m))
    with np.errstate(divide="ignore", invalid="ignore"):
        flow_px = pixels - camera.project(seen)
    if not isinstance(camera, FisheyeCamera):
        flow_px[seen[:, 2] <= 0.0] = np.nan
    tag[outside], actor[outside], depth_m[outside], flow_px[outside] = Tag.UNLABELED, 0, np.inf, np.nan
    inner = _inner((still, moving), now, camera, _code(tag, actor).reshape(shape), slope.reshape(*shape, 3))
    return Truth(
        tag.reshape(shape),
        actor.reshape(shape),
        depth_m.reshape(shape),
        flow_px.reshape(*shape, 2),
        inner & ~outside.reshape(shape),
        jointed.reshape(shape),
    )


def _origin_from_optical(view: CameraView, state: WorldState, origin_m: Float64Array) -> Float64Array:
    pose: Float64Array = map_from_actors(state.ego.reshape(1))[0] @ view.ego_from_sensor @ SENSOR_FROM_OPTICAL
    pose[:3, 3] -= origin_m
    return pose


def _rays(camera: PinholeCamera, pixels: Float64Array) -> tuple[Float64Array, BoolArray]:
    """Rays of pixels; and which pixels are outside the image circle of a fisheye, so that their rays mean nothing."""
    rays = camera.rays(pixels)
    outside = np.isnan(rays[:, 0])
    return np.where(outside[:, None], [0.0, 0.0, 1.0], rays), outside


def _grid(shape: tuple[int, int], shift_px: float = 0.0) -> Float64Array:
    """(H·W, 2) pixel coordinates, row by row."""
    rows, columns = np.mgrid[: shape[0], : shape[1]]
    return np.stack([columns.ravel(), rows.ravel()], axis=1) + shift_px


def _cast(
    both: tuple[Triangles, Triangles], pose: Float64Array, rays: Float64Array
) -> tuple[Int64Array, AnyArray, Float64Array]:
    """Per ray: which of both sets it hits first (-1: none), the triangle, and the depth in multiples of the ray."""
    lines = np.empty((len(rays), 6), np.float32)
    lines[:, :3], lines[:, 3:] = pose[:3, 3], rays @ pose[:3, :3].T
    hits = [triangles.embree.cast(lines) for triangles in both]
    ranges = np.stack([hit.range_m for hit in hits])
    nearest = ranges.argmin(axis=0)
    depth_m = ranges.min(axis=0).astype(np.float64)
    triangle = np.where(nearest == 0, hits[0].triangle, hits[1].triangle)
    return np.where(np.isfinite(depth_m), nearest, -1), triangle, depth_m


def _arrival(
    pose: Float64Array, rays: Float64Array, corners: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Intersections of rays with the planes of (N, 3, 3) triangles (Möller, Trumbore 1997).

    Returns:
        (N, 3) weights of the corners, (N,) depths, and (N, 3) vectors whose product with any other ray is the inverse
        of that ray's depth on the same plane.
    """
    lines = rays @ pose[:3, :3].T
    edge1, edge2, start = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], pose[:3, 3] - corners[:, 0]
    p, q = np.cross(lines, edge2), np.cross(start, edge1)
    determinant = (p * edge1).sum(axis=1)
    u, v, depth_m = (p * start).sum(axis=1), (lines * q).sum(axis=1), (edge2 * q).sum(axis=1)
    u, v = u / determinant, v / determinant
    normal = np.cross(edge1, edge2)
    slope = -normal @ pose[:3, :3] / (normal * start).sum(axis=1)[:, None]
    return np.stack([1.0 - u - v, u, v], axis=1), depth_m / determinant, slope


def _inner(
    both: tuple[Triangles, Triangles], pose: Float64Array, camera: PinholeCamera, code: AnyArray, slope: Float64Array
) -> BoolArray:
    """(H, W) pixels whose corners show the same object as the center, without a jump in depth."""
    height, width = code.shape
    rays, _ = _rays(camera, _grid((height + 1, width + 1), -0.5))
    kind, triangle, depth_m = _cast(both, pose, rays)
    corner_code = np.full(len(rays), _code(np.array(Tag.SKY), np.array(0)))
    for index, triangles in enumerate(both):
        chosen = kind == index
        corner_code[chosen] = _code(triangles.tag[triangle[chosen]], triangles.actor[triangle[chosen]])
    rays, corner_code = rays.reshape(height + 1, width + 1, 3), corner_code.reshape(height + 1, width + 1)
    nearness = (1.0 / depth_m).reshape(height + 1, width + 1)
    inner = np.ones(code.shape, bool)
    for row in (slice(0, -1), slice(1, None)):
        for column in (slice(0, -1), slice(1, None)):
            inner &= corner_code[row, column] == code
            expected = np.einsum("ijk,ijk->ij", rays[row, column], slope)
            inner &= np.abs(nearness[row, column] - expected) <= _JUMP * np.abs(expected)
    return inner


def _code(tag: AnyArray, actor: AnyArray) -> AnyArray:
    """One number per combination of both labels."""
    return actor.astype(np.int64) << 8 | tag.astype(np.int64)


@dataclass(frozen=True)
class Agreement:
    """Agreement of a camera's images with the ground truth; shares are of pixels.

    Attributes:
        inner: Share of pixels that are not on a silhouette.
        depth: Share of inner pixels whose depth is right within 1 cm or 0.1 %.
        semantic: Share of pixels with the right tag.
        instance: Share of pixels with the right actor.
        labels: Share of inner pixels with both labels right.
        unseen: Share of pixels without flow.
        flow_px: Errors of the flow on inner pixels that have one.
        jointed_flow_px: Errors of the flow on wheels, limbs and doors alone.
    """

    inner: float
    depth: float
    semantic: float
    instance: float
    labels: float
    unseen: float
    flow_px: Float64Array
    jointed_flow_px: Float64Array


def agreement(images: CameraImages, truth: Truth) -> Agreement:
    """Compare the four exact modalities with the ground truth."""
    assert images.depth is not None and images.flow is not None
    inner, depth_m = truth.inner, images.depth.astype(np.float64)
    sky = np.isinf(truth.depth_m)
    with np.errstate(invalid="ignore"):
        near = np.abs(depth_m - truth.depth_m) <= np.maximum(0.01, 0.001 * truth.depth_m)
    right = np.where(sky, np.isinf(depth_m), near)
    error_px = np.linalg.norm(images.flow - truth.flow_px, axis=2)
    unseen = np.isnan(images.flow[..., 0])  # also what the frame before did not show, which the rays do not say
    error_px[np.isnan(error_px) & ~unseen] = np.inf
    semantic, instance = images.semantic == truth.semantic, images.instance == truth.instance
    return Agreement(
        inner=float(inner.mean()),
        depth=float(right[inner].mean()),
        semantic=float(semantic.mean()),
        instance=float(instance.mean()),
        labels=float((semantic & instance)[inner].mean()),
        unseen=float(unseen.mean()),
        flow_px=error_px[inner & ~unseen],
        jointed_flow_px=error_px[inner & truth.jointed & ~unseen],
    )
