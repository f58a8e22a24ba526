"""Plazas as stored in region files agree with the meshes of the region."""

import numpy as np
import pytest
import shapely

from simbev_ros.assets.land.plazas import plaza_arrays, plazas_from
from simbev_ros.assets.regions.static_cache import load_static_scene, load_streetside
from simbev_ros.maps.build import load_network
from simbev_ros.maps.source import map_spec


@pytest.mark.slow
def test_no_object_stands_where_pedestrians_may_walk() -> None:
    spec = map_spec("Town15")
    network = load_network(spec)
    plazas = load_streetside(spec, network).plazas
    free = shapely.union_all([plaza.free for plaza in plazas]).buffer(0.4)
    shapely.prepare(free)
    for tile in load_static_scene(spec, network).tiles:
        corner_m = tile.mesh.vertices[tile.mesh.triangles].astype(np.float64) + tile.origin_m
        middle_m = corner_m.mean(axis=1)
        near = shapely.contains_xy(free, middle_m[:, :2])
        for plaza in plazas:
            here = near & shapely.contains_xy(plaza.free.buffer(0.4), middle_m[:, :2])
            above_m = middle_m[here, 2] - plaza.ground.linear(middle_m[here, :2])
            assert not np.any((above_m > 0.2) & (above_m < 0.55))
    assert len(plazas) > 20


@pytest.mark.slow
def test_plazas_come_back_as_they_were_stored() -> None:
    spec = map_spec("Town15")
    plazas = load_streetside(spec, load_network(spec)).plazas
    for stored in (plazas, plazas[:1], ()):
        again = plazas_from(dict(plaza_arrays(stored)))
        assert len(again) == len(stored)
        for one, other in zip(stored, again, strict=True):
            assert one.free.equals_exact(other.free)
            np.testing.assert_array_equal(one.paths_m, other.paths_m)
            np.testing.assert_array_equal(one.ground.values, other.ground.values)
            np.testing.assert_array_equal(one.ground.origin_m, other.ground.origin_m)
