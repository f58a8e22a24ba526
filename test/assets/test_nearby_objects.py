"""Objects of the map replace generated ones of their kind, and only near them."""

import numpy as np
import shapely

from simbev_ros.assets.placement.nearby_objects import REPLACED_M, TREE_KINDS, NearbyObjects
from simbev_ros.maps.land_features import BARRIER_KINDS, MapObject, ObjectKind

REGION = shapely.box(0, 0, 512, 512)
TREE = MapObject(ObjectKind.TREE, np.array([[100.0, 100.0, 0.0]]))
FENCE = MapObject(ObjectKind.FENCE, np.array([[-400.0, 300.0, 0.0], [900.0, 300.0, 0.0]]))
FAR = MapObject(ObjectKind.BENCH, np.array([[700.0, 100.0, 0.0]]))


def test_kinds_are_replaced_up_to_their_distance() -> None:
    nearby = NearbyObjects([TREE, FENCE, FAR], REGION)
    assert nearby.items == (TREE, FENCE)
    at = np.array([[100.0, 99.0 + REPLACED_M], [100.0, 101.0 + REPLACED_M]])
    assert nearby.replace(TREE_KINDS, at).tolist() == [True, False]
    assert not nearby.replace((ObjectKind.BENCH,), at).any()


def test_a_fence_replaces_along_all_of_its_length() -> None:
    nearby = NearbyObjects([FENCE], REGION)
    along = np.column_stack([np.linspace(0.0, 512.0, 50), np.full(50, 300.0 + REPLACED_M - 2.0)])
    assert nearby.replace(BARRIER_KINDS, along).all()
    assert not nearby.replace(BARRIER_KINDS, along + np.array([0.0, 4.0])).any()


def test_a_map_without_objects_replaces_nothing() -> None:
    assert not NearbyObjects([], REGION).replace(TREE_KINDS, np.zeros((3, 2))).any()
