"""Spots for people to rest: kinds, those at things, and rows in the map frame."""

from collections.abc import Mapping
from enum import IntEnum
from functools import lru_cache

import numpy as np

from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import BoolArray, Float64Array, Table

REST_DTYPE = np.dtype([("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("yaw", "<f4"), ("kind", "u1")])
"""A spot, map frame: the ground below the back of a seat or the middle of who stands, heading of the look, RestKind."""


class RestKind(IntEnum):
    """What a person rests on or at; on the first three one sits."""

    BENCH = 0
    CHAIR = 1
    SHELTER_SEAT = 2
    SHELTER = 3
    WINDOW = 4


def seats_among(rests: Table) -> BoolArray:
    """(K,) which of (K,) ``REST_DTYPE`` spots one sits on."""
    return np.asarray(rests["kind"] <= RestKind.SHELTER_SEAT)


@lru_cache(maxsize=1)
def rests_at_things() -> Mapping[str, Float64Array]:
    """(K, 5) spots by name of the thing, in its frame: x, y, z, heading in degrees, kind; from rest_spots.yaml."""
    table = load_table("simbev_ros.assets.street", "rest_spots.yaml")
    return {name: np.array([(*spot, RestKind[kind]) for *spot, kind in rows]) for name, rows in table.items()}
