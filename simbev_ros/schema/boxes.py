"""Table of 3D boxes: its columns, its ids, and how difficult a box is."""

from functools import lru_cache

import numpy as np

from simbev_ros.foundation.semantics import BOX_CLASSES, CLASSES, DIFFICULTIES
from simbev_ros.foundation.types import AnyArray, Float64Array, Int64Array, Table
from simbev_ros.schema.messages.message_rows import message_constants, row_dtype
from simbev_ros.schema.scene.state import map_from_actors

BOX_DTYPE = row_dtype("Box")
"""Row of /ego/boxes; ``interfaces/msg/Box.msg`` says what its columns mean."""

_CONSTANTS = message_constants("Box")
LIGHT_IDS, SIGN_IDS = _CONSTANTS["LIGHT_IDS"], _CONSTANTS["SIGN_IDS"]
"""Offsets of the ids of static objects.

A traffic light's id is the first plus its id in /world/signals; a sign's id is the second plus its number in the map's
layout, from 1. Actor ids are smaller, as they must fit instance images.
"""

NO_BLUEPRINT = _CONSTANTS["NO_BLUEPRINT"]
NO_CLASS = 255
"""Class of what has no box."""


def blank_boxes(count: int) -> Table:
    """(count,) ``BOX_DTYPE`` boxes without sensor data: visibility NaN, point counts -1, all else 0."""
    result = np.zeros(count, BOX_DTYPE)
    result["visibility"], result["lidar_points"], result["radar_points"] = np.nan, -1, -1
    return result


def box_centers_m(actors: Table) -> Float64Array:
    """(N, 3) box centers of (N,) ``ACTOR_DTYPE`` rows, map frame."""
    pose = map_from_actors(actors)
    return pose[:, :3, 3] + pose[:, :3, 2] * (actors["height"] / 2.0)[:, None]


def difficulty(box_class: AnyArray, distance_m: AnyArray, points: AnyArray) -> Int64Array:
    """(B,) index into ``DIFFICULTIES`` from class, distance to the ego, and number of lidar and radar points inside.

    A box is hard at or beyond a class-specific distance or below a number of points, else medium at or beyond a smaller
    distance or below a larger number, else easy (SimBEV; the thresholds are in classes.yaml).
    """
    limits = _limits()[box_class]
    within = (distance_m[:, None] < limits[..., 0]) & (points[:, None] >= limits[..., 1])
    return np.where(~within[:, 0], _HARD, np.where(~within[:, 1], _MEDIUM, _EASY))


_EASY, _MEDIUM, _HARD = (DIFFICULTIES.index(name) for name in ("easy", "medium", "hard"))


@lru_cache(maxsize=1)
def _limits() -> Float64Array:
    """(classes, 2, 2) distance and number of points, for hard first, then for medium."""
    return np.array([[CLASSES[name]["hard"], CLASSES[name]["medium"]] for name in BOX_CLASSES], np.float64)
