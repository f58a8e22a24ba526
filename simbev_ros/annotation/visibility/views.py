"""What cameras see of objects: visible pixels, those that each object alone would have, truncation, 2D boxes.

Visible is what the instance image shows. Alone, an object is drawn as the camera did, with the mesh that it took at
that distance; so whatever stands before an object hides it, cars as well as leaves, and the rider on a bicycle too.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.annotation.visibility.contours import Likeness, contours
from simbev_ros.annotation.visibility.shells import Shell
from simbev_ros.annotation.visibility.silhouettes import Silhouettes, silhouettes
from simbev_ros.annotation.visibility.visible import Visible, visible
from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.geometry.camera import PinholeCamera
from simbev_ros.geometry.transforms import inverse
from simbev_ros.render.frame import CameraView
from simbev_ros.render.geometry.level_of_detail import LevelsOfDetail, bounding_spheres
from simbev_ros.render.view import NEAR_M, View
from simbev_ros.scene.state import WorldState, map_from_actors
from simbev_ros.semantics import BOX_CLASSES
from simbev_ros.types import AnyArray, Float32Array, Float64Array, Int64Array, Table, UInt16Array

VIEW_DTYPE = np.dtype(
    [
        ("id", "<u4"),
        ("visible_px", "<u4"),  # pixels of the instance image that show the object
        ("alone_px", "<u4"),  # the same if there were nothing else in the world; at least 1 and at least the visible
        ("visibility", "<f4"),  # visible_px / alone_px
        ("truncation", "<f4"),  # share of the object's silhouette on the canvas that is outside of the image
        ("left", "<f4"),  # pixels, box around the visible pixels, centres of pixels at integers: a box around the
        ("top", "<f4"),  # pixel in column 7 and row 3 alone is 6.5, 2.5, 7.5, 3.5. NaN where nothing is visible
        ("right", "<f4"),
        ("bottom", "<f4"),
        ("amodal_left", "<f4"),  # box around the whole silhouette, whatever is before it, up to the canvas' borders
        ("amodal_top", "<f4"),
        ("amodal_right", "<f4"),
        ("amodal_bottom", "<f4"),
        ("class", "u1"),  # index into BOX_CLASSES
    ]
)
"""One row per object that a camera would see if it were alone. Field names and order are those of /ego/<camera>/boxes.

The canvas is the image with as much again on every side: columns -width … 2 width - 1, rows -height … 2 height - 1.
Nothing nearer than the near plane (0.1 m along the optical axis) belongs to a silhouette, neither there nor in images.
"""

_VISIBLE_BOX = ("left", "top", "right", "bottom")
_NO_CLASS = 255


class ViewAnnotator:
    """Views of the actors of a catalogue."""

    def __init__(self, models: Sequence[ActorModel]) -> None:
        """Takes the catalogue's models, indexed by blueprint."""
        self._skeletons = Skeletons(models)
        self._detail = LevelsOfDetail(models)
        classes = [BOX_CLASSES.index(model.box_class) if model.box_class else _NO_CLASS for model in models]
        self._class = np.array(classes, np.uint8)
        self._shells: dict[tuple[int, int], Shell] = {}

    def views(
        self, state: WorldState, boxes: Table, cameras: Sequence[CameraView], images: Sequence[UInt16Array]
    ) -> list[Table]:
        """What images show of objects.

        Args:
            state: The world at the moment of the images.
            boxes: (N,) ``BOX_DTYPE`` of the objects wanted; of those that are no actors images tell nothing.
            cameras: Of the ego, which do not show the ego.
            images: (H, W) of each camera: id of the actor that a pixel shows, 0 = none.

        Returns:
            (K,) ``VIEW_DTYPE`` per camera, ascending id.
        """
        wanted = np.isin(state.actors["id"], boxes["id"]) & (state.actors["id"] != state.ego_id)
        actors = state.actors[wanted & (self._class[state.actors["blueprint"]] != _NO_CLASS)]
        objects = _Objects.of(self._skeletons, actors, np.array([state.ego["x"], state.ego["y"], state.ego["z"]]))
        return [
            self._view(View.of(camera, state, None, objects.origin_m), camera.camera, objects, image)
            for camera, image in zip(cameras, images, strict=True)
        ]

    def _view(self, view: View, camera: PinholeCamera, objects: "_Objects", image: UInt16Array) -> Table:
        seen = np.flatnonzero(view.sees_spheres(objects.center_m, objects.radius_m))
        if not len(seen):
            return np.zeros(0, VIEW_DTYPE)
        alone = silhouettes(contours(self._alike(objects, seen, view), NEAR_M), camera, len(seen))
        actors = objects.actors[seen]
        return _table(actors["id"], self._class[actors["blueprint"]], visible(image, actors["id"]), alone)

    def _alike(self, objects: "_Objects", seen: Int64Array, view: View) -> list[Likeness]:
        """Some of the objects by mesh, numbered in their order."""
        pixel_m = view.pixel_m(objects.center_m[seen], objects.radius_m[seen])
        level = self._detail.of(objects.actors[seen], pixel_m)
        kinds = np.stack([objects.actors["blueprint"][seen], level], axis=1)
        optical_from_world = inverse(view.world_from_optical)
        alike = []
        for blueprint, level in np.unique(kinds, axis=0).tolist():
            slot = np.flatnonzero((kinds == [blueprint, level]).all(axis=1))
            alike.append(Likeness(self._shell(blueprint, level), slot, optical_from_world @ objects.poses(seen[slot])))
        return alike

    def _shell(self, blueprint: int, level: int) -> Shell:
        if (blueprint, level) not in self._shells:
            self._shells[blueprint, level] = Shell.of(self._detail.meshes[blueprint][level])
        return self._shells[blueprint, level]


def visibility(ids: AnyArray, views: Iterable[Table]) -> Float32Array:
    """(N,) share of objects that is visible in all images together (as nuScenes counts it); NaN: out of all images.

    Args:
        ids: (N,) of objects.
        views: (K,) ``VIEW_DTYPE`` of each camera.
    """
    rows = np.concatenate([np.zeros(0, VIEW_DTYPE), *views])
    known, index = np.unique(np.concatenate([ids, rows["id"]]), return_inverse=True)
    visible_px, alone_px = (
        np.bincount(index[len(ids) :], rows[name], len(known))[index[: len(ids)]] for name in ("visible_px", "alone_px")
    )
    share: Float32Array = np.where(alone_px > 0, visible_px / np.maximum(alone_px, 1), np.nan).astype(np.float32)
    return share


@dataclass(frozen=True, slots=True)
class _Objects:
    """Actors where they are, relative to an origin in the map frame."""

    actors: Table
    origin_m: Float64Array
    center_m: Float64Array
    radius_m: Float64Array
    world_from_rest: Float64Array
    first_row: Int64Array

    @classmethod
    def of(cls, skeletons: Skeletons, actors: Table, origin_m: Float64Array) -> "_Objects":
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
        poses: Float64Array = self.world_from_rest[first[:, None] + np.arange(parts)]
        return poses


def _table(ids: AnyArray, classes: AnyArray, seen: Visible, alone: Silhouettes) -> Table:
    """Rows of the objects of which anything is in the image.

    Drawing rounds in its last bits, so a pixel can be seen that the silhouette just misses; it is counted to it.
    """
    alone_px = np.maximum(alone.image_px, seen.pixels)
    outside_px = alone.canvas_px - alone.image_px
    kept = np.flatnonzero(alone_px > 0)
    table = np.zeros(len(kept), VIEW_DTYPE)
    table["id"], table["class"] = ids[kept], classes[kept]
    table["visible_px"], table["alone_px"] = seen.pixels[kept], alone_px[kept]
    table["visibility"] = seen.pixels[kept] / alone_px[kept]
    table["truncation"] = (outside_px / np.maximum(outside_px + alone_px, 1))[kept]
    for column, name in enumerate(_VISIBLE_BOX):
        table[name], table[f"amodal_{name}"] = seen.box_px[kept, column], alone.box_px[kept, column]
    return table
