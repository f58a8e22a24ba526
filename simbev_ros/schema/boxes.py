"""Table of 3D boxes: its columns, its ids, and how difficult a box is."""

from functools import lru_cache

import numpy as np

from simbev_ros.foundation.semantics import BOX_CLASSES, DIFFICULTIES
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import AnyArray, Float64Array, Int64Array, Table
from simbev_ros.schema.scene.state import map_from_actors

BOX_DTYPE = np.dtype(
    [
        ("x", "<f8"),  # m, map frame: center of the box
        ("y", "<f8"),
        ("z", "<f8"),
        ("roll", "<f4"),  # rad, fixed axes x y z (REP-103): R = Rz(yaw) Ry(pitch) Rx(roll)
        ("pitch", "<f4"),
        ("yaw", "<f4"),
        ("length", "<f4"),  # m, along x, y, z of the box
        ("width", "<f4"),
        ("height", "<f4"),
        ("vx", "<f4"),  # m/s, map frame
        ("vy", "<f4"),
        ("vz", "<f4"),
        ("ax", "<f4"),  # m/s², map frame
        ("ay", "<f4"),
        ("az", "<f4"),
        ("wx", "<f4"),  # rad/s, map frame
        ("wy", "<f4"),
        ("wz", "<f4"),
        ("distance", "<f4"),  # m, between the centers of the ego's box and this one
        ("angle", "<f4"),  # rad, direction to the center in the ego frame: 0 ahead, positive to the left
        ("visibility", "<f4"),  # visible pixels over those of the object alone, of all cameras; NaN: in no image
        ("limit", "<f4"),  # m/s, limit shown by a speed limit sign, else 0
        ("lidar_points", "<i4"),  # points of all lidars inside the box; -1: none received at this tick
        ("radar_points", "<i4"),
        ("id", "<u4"),  # actor id; static objects have ids of their own, above ``LIGHT_IDS`` and ``SIGN_IDS``
        ("parent", "<u4"),  # id of the actor that this one belongs to, else 0
        ("color", "<u4"),  # 0xRRGGBB, sRGB
        ("blueprint", "<u2"),  # index into the catalogue, ``NO_BLUEPRINT`` for static objects
        ("lights", "<u2"),  # Light bits
        ("behavior", "<u2"),  # Behavior bits
        ("class", "u1"),  # index into BOX_CLASSES
        ("tag", "u1"),  # semantic Tag
        ("doors", "u1"),  # bit k: door k is open
        ("on_ego_level", "u1"),  # 1: on a road of the ego's level; 0: on a road above or below it
        ("valid", "u1"),  # 1: at least one lidar or radar point is inside
        ("difficulty", "u1"),  # index into DIFFICULTIES
        ("state", "u1"),  # SignalState of a traffic light
        ("sign", "u1"),  # index into SIGN_TYPES of a traffic sign
    ]
)
"""Row of the table of boxes. Field names and order are those of /ego/boxes."""


LIGHT_IDS, SIGN_IDS = 0x10000, 0x20000
"""Offsets of the ids of static objects.

A traffic light's id is the first plus its id in /world/signals; a sign's id is the second plus its number in the map's
layout, from 1. Actor ids are smaller, as they must fit instance images.
"""


NO_CLASS, NO_BLUEPRINT = 255, 65535


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
    distance or below a larger number, else easy (SimBEV; the thresholds are in difficulty.yaml).
    """
    limits = _limits()[box_class]
    within = (distance_m[:, None] < limits[..., 0]) & (points[:, None] >= limits[..., 1])
    return np.where(~within[:, 0], _HARD, np.where(~within[:, 1], _MEDIUM, _EASY))


_EASY, _MEDIUM, _HARD = (DIFFICULTIES.index(name) for name in ("easy", "medium", "hard"))


@lru_cache(maxsize=1)
def _limits() -> Float64Array:
    """(classes, 2, 2) distance and number of points, for hard first, then for medium."""
    table = load_table("simbev_ros.schema", "difficulty.yaml")
    return np.array([[table[name]["hard"], table[name]["medium"]] for name in BOX_CLASSES], np.float64)
