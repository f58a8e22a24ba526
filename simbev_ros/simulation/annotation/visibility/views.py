"""Per-camera visibility of objects: visible pixels, pixels of the object drawn alone, truncation and 2D boxes.

The annotation node passes in the state and each camera's instance image; ``VIEW_DTYPE`` rows per camera leave. Visible
pixels are those of the instance image. Drawn alone, an object has the mesh (level of detail) that the camera used at
that distance. Anything in front of an object occludes it: vehicles, leaves, and also the rider on a bicycle.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.threads import start
from simbev_ros.foundation.types import AnyArray, Float32Array, Float64Array, Int64Array, Table, UInt16Array
from simbev_ros.schema.boxes import NO_CLASS
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.schema.views import VIEW_DTYPE
from simbev_ros.simulation.annotation.visibility.contours import MeshInstances, trace_contours, trace_outlines
from simbev_ros.simulation.annotation.visibility.fisheye_paths import map_outlines
from simbev_ros.simulation.annotation.visibility.shells import Shell
from simbev_ros.simulation.annotation.visibility.silhouettes import Silhouettes, measure_silhouettes
from simbev_ros.simulation.annotation.visibility.visible import VisiblePixels, count_visible_pixels
from simbev_ros.simulation.render.frame import CameraView
from simbev_ros.simulation.render.geometry.level_of_detail import LevelsOfDetail, bounding_spheres
from simbev_ros.simulation.render.view import NEAR_M, View

_VISIBLE_BOX = ("left", "top", "right", "bottom")


class ViewAnnotator:
    """Computes what cameras see of the actors of a catalog."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """Prepare the catalog's models, indexed by blueprint."""
        self._skeletons = Skeletons(models)
        self._detail = LevelsOfDetail(models)
        classes = [BOX_CLASSES.index(model.box_class) if model.box_class else NO_CLASS for model in models]
        self._class = np.array(classes, np.uint8)
        self._shells: dict[tuple[int, int], Shell] = {}

    def views(
        self,
        state: WorldState,
        boxes: Table,
        cameras: Sequence[CameraView],
        images: Sequence[UInt16Array],
        threads: ThreadPoolExecutor | None = None,
    ) -> list[Table]:
        """Visibility of objects in the cameras' images.

        Args:
            state: The world state at the time of the images.
            boxes: (N,) ``BOX_DTYPE`` of the requested objects; boxes that are not actors are ignored.
            cameras: Cameras of the ego; they do not show the ego.
            images: (H, W) per camera: id of the actor that a pixel shows, 0 = none.
            threads: Threads that count the images' pixels while the caller projects the objects.

        Returns:
            (K,) ``VIEW_DTYPE`` per camera, ascending id.
        """
        requested = np.isin(state.actors["id"], boxes["id"]) & (state.actors["id"] != state.ego_id)
        actors = state.actors[requested & (self._class[state.actors["blueprint"]] != NO_CLASS)]
        objects = _PosedObjects.from_actors(
            self._skeletons, actors, np.array([state.ego["x"], state.ego["y"], state.ego["z"]])
        )
        views = [View.of_camera(camera, state, None, objects.origin_m) for camera in cameras]
        in_view = [
            np.flatnonzero(np.any([view.sees_spheres(objects.center_m, objects.radius_m) for view in each], axis=0))
            for each in views
        ]
        visible = [
            start(threads, partial(count_visible_pixels, image, objects.actors["id"][rows]))
            for image, rows in zip(images, in_view, strict=True)
        ]
        return [
            self._view(each[0], camera.camera, objects, rows, pixels)
            for each, camera, rows, pixels in zip(views, cameras, in_view, visible, strict=True)
        ]

    def _view(
        self,
        view: View,
        camera: PinholeCamera,
        objects: "_PosedObjects",
        in_view: Int64Array,
        visible: Callable[[], VisiblePixels],
    ) -> Table:
        if not len(in_view):
            return np.zeros(0, VIEW_DTYPE)
        meshes = self._group_by_mesh(objects, in_view, view)
        if isinstance(camera, FisheyeCamera):
            contours = map_outlines(trace_outlines(meshes), camera)
        else:
            contours = trace_contours(meshes, NEAR_M)
        alone = measure_silhouettes(contours, camera, len(in_view))
        actors = objects.actors[in_view]
        return _table(actors["id"], self._class[actors["blueprint"]], visible(), alone)

    def _group_by_mesh(self, objects: "_PosedObjects", in_view: Int64Array, view: View) -> list[MeshInstances]:
        """Group the objects in view by mesh; their slots are their positions in ``in_view``."""
        pixel_m = view.pixel_m(objects.center_m[in_view], objects.radius_m[in_view])
        level = self._detail.select_levels(objects.actors[in_view], pixel_m)
        kinds = np.stack([objects.actors["blueprint"][in_view], level], axis=1)
        optical_from_world = inverse(view.world_from_optical)
        groups = []
        for blueprint, level in np.unique(kinds, axis=0).tolist():
            slot = np.flatnonzero((kinds == [blueprint, level]).all(axis=1))
            groups.append(
                MeshInstances(self._shell(blueprint, level), slot, optical_from_world @ objects.poses(in_view[slot]))
            )
        return groups

    def _shell(self, blueprint: int, level: int) -> Shell:
        if (blueprint, level) not in self._shells:
            self._shells[blueprint, level] = Shell.from_mesh(self._detail.meshes[blueprint][level])
        return self._shells[blueprint, level]


def visibility(ids: AnyArray, views: Iterable[Table]) -> Float32Array:
    """(N,) visible share of objects over all images together (as in nuScenes); NaN: in no image.

    Args:
        ids: (N,) object ids.
        views: (K,) ``VIEW_DTYPE`` of each camera.
    """
    rows = np.concatenate([np.zeros(0, VIEW_DTYPE), *views])
    known, index = np.unique(np.concatenate([ids, rows["id"]]), return_inverse=True)
    visible_px, alone_px = (
        np.bincount(index[len(ids) :], rows[name], len(known))[index[: len(ids)]] for name in ("visible_px", "alone_px")
    )
    return np.where(alone_px > 0, visible_px / np.maximum(alone_px, 1), np.nan).astype(np.float32)


@dataclass(frozen=True, slots=True)
class _PosedObjects:
    """Actors with the poses of their parts, relative to an origin in the map frame."""

    actors: Table
    origin_m: Float64Array
    center_m: Float64Array
    radius_m: Float64Array
    world_from_rest: Float64Array
    first_row: Int64Array

    @classmethod
    def from_actors(cls, skeletons: Skeletons, actors: Table, origin_m: Float64Array) -> "_PosedObjects":
        world_from_actor = map_from_actors(actors)
        world_from_actor[:, :3, 3] -= origin_m
        owner, _ = skeletons.rows(actors)
        world_from_rest = world_from_actor[owner] @ skeletons.poses(actors)
        first_row = np.searchsorted(owner, np.arange(len(actors) + 1))
        return cls(actors, origin_m, *bounding_spheres(actors, origin_m), world_from_rest, first_row)

    def poses(self, rows: Int64Array) -> Float64Array:
        """(K, P, 4, 4) poses of the parts of (K,) objects that share a model."""
        first = self.first_row[rows]
        parts = self.first_row[rows[0] + 1] - first[0]
        return self.world_from_rest[first[:, None] + np.arange(parts)]


def _table(ids: AnyArray, classes: AnyArray, visible: VisiblePixels, alone: Silhouettes) -> Table:
    """Rows of the objects that are at least partly in the image.

    Rendering rounds in its last bits, so a visible pixel may lie just outside the silhouette; it is added to
    ``alone_px``.
    """
    alone_px = np.maximum(alone.image_px, visible.pixels)
    outside_px = alone.canvas_px - alone.image_px
    kept = np.flatnonzero(alone_px > 0)
    table = np.zeros(len(kept), VIEW_DTYPE)
    table["id"], table["class"] = ids[kept], classes[kept]
    table["visible_px"], table["alone_px"] = visible.pixels[kept], alone_px[kept]
    table["visibility"] = visible.pixels[kept] / alone_px[kept]
    table["truncation"] = (outside_px / np.maximum(outside_px + alone_px, 1))[kept]
    for column, name in enumerate(_VISIBLE_BOX):
        table[name], table[f"amodal_{name}"] = visible.box_px[kept, column], alone.box_px[kept, column]
    return table
