"""Gives each point of a lidar cloud its category of nuScenes-lidarseg, from the semantic cloud of the same turn.

Both clouds are made of the same rays. The semantic one has what each ray hits, exactly; in the other, returns are lost,
ranges are noisy, and rain or fog may return a ray before it reaches a surface. Noise moves a point along its ray, so
that its direction identifies its ray. A point has the category of what its ray hits if it is as far away;
else it is an echo from the air, nuScenes' ``noise``. Echoes within the noise of a surface have the surface's category.
"""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from simbev_ros.dataset import columns
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import AnyArray, Float64Array, Int64Array, Table, UInt8Array
from simbev_ros.schema.nuscenes import category_of_blueprint, category_of_tag, point_labels

_MAX_ANGLE_RAD = 1e-5
"""Maximum angle between two directions of one ray; rounding to float32 makes 1e-7, and rays are 1e-4 apart."""

_CELL_RAD = 5e-5
"""Side of the cells in which directions are looked up: so small that a cell holds one ray."""

_NOISE_SIGMAS = 6.0
_ROUNDING_M = 1e-3
_NO_LABEL = 255


def labels_of_points(cloud: Table, semantic_cloud: Table, labels: UInt8Array, range_noise_sigma_m: float) -> UInt8Array:
    """(N,) labels of the points of a cloud.

    Args:
        cloud: (N,) points: x y z, sensor frame.
        semantic_cloud: (M,) points of the semantic cloud of the same turn: x y z, sensor frame.
        labels: (M,) their labels, of ``labels_of_surfaces``.
        range_noise_sigma_m: Standard deviation of the cloud's ranges.
    """
    rays, range_m = _rays(cloud)
    semantic_rays, semantic_range_m = _rays(semantic_cloud)
    result = np.full(len(cloud), point_labels()["noise"], np.uint8)
    if not (len(cloud) and len(semantic_cloud)):
        return result
    row = _rows_of_rays(rays, semantic_rays)
    known = np.flatnonzero(row >= 0)
    offset_m = np.abs(range_m[known] - semantic_range_m[row[known]])
    known = known[offset_m <= _NOISE_SIGMAS * range_noise_sigma_m + _ROUNDING_M]
    result[known] = labels[row[known]]
    return result


def labels_of_surfaces(
    semantic_cloud: Table, actors: Table, blueprints: Sequence[Mapping[str, Any]], ego_id: int
) -> UInt8Array:
    """(M,) labels of the points of a semantic cloud.

    Riders have the category of their vehicle, as in nuScenes.

    Args:
        semantic_cloud: (M,) points: object_id, tag.
        actors: Rows of /world/actors of the same tick.
        blueprints: Those of /world/legend.
        ego_id: Id of the ego.
    """
    by_tag = _labels_by_tag()
    result: UInt8Array = by_tag[np.where(semantic_cloud["tag"] < len(by_tag), semantic_cloud["tag"], Tag.UNLABELED)]
    actors = actors[np.argsort(actors["id"])]
    row = _row_of(actors, semantic_cloud["object_id"])
    is_actor = row >= 0
    result[is_actor] = _labels_of_actors(actors, blueprints, ego_id)[row[is_actor]]
    return result


def _labels_of_actors(actors: Table, blueprints: Sequence[Mapping[str, Any]], ego_id: int) -> UInt8Array:
    """(N,) labels of (N,) actors, which are in order of their ids."""
    names = [category_of_blueprint(each["name"], each["class"] or "") for each in blueprints]
    labels = point_labels()
    by_blueprint = np.array([labels.get(name or "", _NO_LABEL) for name in names], np.uint8)
    vehicle = np.where(actors["parent"] > 0, _row_of(actors, actors["parent"]), -1)
    owner = np.where(vehicle >= 0, vehicle, np.arange(len(actors)))
    kind = actors["blueprint"][owner]
    known = np.where(kind < len(by_blueprint), by_blueprint[np.minimum(kind, len(by_blueprint) - 1)], _NO_LABEL)
    by_tag = _labels_by_tag()[np.minimum(actors["tag"], max(Tag))]
    result: UInt8Array = np.where(known == _NO_LABEL, by_tag, known)
    result[actors["id"][owner] == ego_id] = labels["vehicle.ego"]
    return result


def _row_of(actors: Table, ids: AnyArray) -> Int64Array:
    """(K,) rows of (K,) ids in actors that are in order of their ids; -1: the actor is missing."""
    if not len(actors):
        return np.full(len(ids), -1)
    row = np.minimum(np.searchsorted(actors["id"], ids), len(actors) - 1)
    return np.where(actors["id"][row] == ids, row, -1)


def _labels_by_tag() -> UInt8Array:
    """(T,) labels of static surfaces by semantic tag."""
    labels = point_labels()
    return np.array([labels[category_of_tag(tag)] for tag in Tag], np.uint8)


def _rows_of_rays(rays: Float64Array, known_rays: Float64Array) -> Int64Array:
    """(N,) rows of the known rays that (N, 3) rays are, by (M, 3) directions; -1: none of them."""
    cells = _cells(known_rays)
    order = np.argsort(cells, kind="stable")
    result, nearest_rad = np.full(len(rays), -1), np.full(len(rays), _MAX_ANGLE_RAD)
    for shift in product((-_MAX_ANGLE_RAD, _MAX_ANGLE_RAD), repeat=3):  # all cells that are near enough
        wanted = _cells(rays + np.array(shift))
        row = order[np.minimum(np.searchsorted(cells, wanted, sorter=order), len(order) - 1)]
        angle_rad = np.linalg.norm(known_rays[row] - rays, axis=1)
        is_nearer = (cells[row] == wanted) & (angle_rad < nearest_rad)
        result[is_nearer], nearest_rad[is_nearer] = row[is_nearer], angle_rad[is_nearer]
    return result


def _cells(rays: Float64Array) -> Int64Array:
    """(N,) numbers of the cells that (N, 3) directions are in."""
    x, y, z = np.floor(rays.T / _CELL_RAD).astype(np.int64)
    return (x << 40) + (y << 20) + z


def _rays(cloud: Table) -> tuple[Float64Array, Float64Array]:
    """(N, 3) directions of points, and (N,) their ranges; a point at the sensor has no direction, (0, 0, 0)."""
    points_m = columns(cloud, "x", "y", "z").astype(np.float64)
    range_m = np.linalg.norm(points_m, axis=1)
    return points_m / np.maximum(range_m, 1e-9)[:, None], range_m
