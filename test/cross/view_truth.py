"""Ground truth of unoccluded objects, by Embree rays through the pixels of an image and of the canvas around it."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.posing import PosedActors, pose_actors
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL
from simbev_ros.foundation.types import AnyArray, BoolArray, Float64Array
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.raycast.embree import TriangleSet
from simbev_ros.simulation.render.frame import CameraView
from simbev_ros.simulation.render.geometry.level_of_detail import bounding_spheres
from simbev_ros.simulation.render.view import NEAR_M


@dataclass(frozen=True)
class Alone:
    """Silhouette of an object's exact mesh without occlusion.

    Attributes:
        image_px: Number of pixels in the image.
        canvas_px: Number of pixels on the canvas.
        box_px: (4,) first column and row, last column and row on the canvas.
    """

    image_px: int
    canvas_px: int
    box_px: AnyArray


class Canvas:
    """An image extended on every side by ``margin`` times its size; without distortion, a margin of 1 is the canvas."""

    def __init__(self, view: CameraView, state: WorldState, margin: int) -> None:
        camera = view.camera
        self._size_px = np.array([camera.width_px, camera.height_px])
        columns, rows = (np.arange(-margin * size, (1 + margin) * size) for size in self._size_px.tolist())
        self._pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        self._pixels = self._pixels[~np.isnan(camera.rays(self._pixels)[:, 0])]  # within the circle of a fisheye
        self._state = state
        ego = state.ego
        self._origin_m = np.array([ego["x"], ego["y"], ego["z"]])
        pose = map_from_actors(ego.reshape(1))[0] @ view.ego_from_sensor @ SENSOR_FROM_OPTICAL
        self._eye_m = pose[:3, 3] - self._origin_m
        self._rays = camera.rays(self._pixels) @ pose[:3, :3].T
        self._directions = self._rays / np.linalg.norm(self._rays, axis=1, keepdims=True)

    def alone(self, models: tuple[ActorModel, ...], actor_id: int) -> Alone:
        """Silhouette of an actor without occlusion, by its front faces beyond the near plane."""
        actor = self._state.actors[self._state.actors["id"] == actor_id]
        (center_m,), (radius_m,) = bounding_spheres(actor, self._origin_m)
        near = np.flatnonzero(self._pass(center_m - self._eye_m, radius_m))
        hit = self._pixels[near[_hits(pose_actors(models, actor, self._origin_m), self._eye_m, self._rays[near])]]
        inside = ((hit >= 0) & (hit < self._size_px)).all(axis=1)
        box_px = np.concatenate([hit.min(axis=0), hit.max(axis=0)]) if len(hit) else np.full(4, np.nan)
        return Alone(int(inside.sum()), len(hit), box_px)

    def _pass(self, center_m: Float64Array, radius_m: float) -> BoolArray:
        """(N,) whether rays pass through a sphere."""
        along_m = self._directions @ center_m
        passes: BoolArray = (center_m @ center_m - along_m**2 < radius_m**2) & (along_m > -radius_m)
        return passes


def _hits(posed: PosedActors, eye_m: Float64Array, rays: Float64Array) -> BoolArray:
    """(N,) whether (N, 3) rays, z = 1, hit a triangle from its outside beyond the near plane."""
    lines = np.concatenate([np.broadcast_to(eye_m, rays.shape), rays], axis=1).astype(np.float32)
    found = TriangleSet(posed.vertices, posed.triangles).crossings(lines)
    a, b, c = posed.vertices[posed.triangles].astype(np.float64).swapaxes(0, 1)
    outward = np.cross(b - a, c - a)[found.triangle]
    seen = (np.einsum("ni,ni->n", outward, rays[found.ray]) < 0.0) & (found.range_m >= NEAR_M)
    hit = np.zeros(len(rays), bool)
    hit[found.ray[seen]] = True
    return hit
