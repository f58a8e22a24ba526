"""Reflectance from spot to spot, against the differences along rings that a real road has."""

import numpy as np
import pytest

from simbev_ros.assets.materials import Material, load_materials
from simbev_ros.foundation.types import Float32Array, Float64Array
from simbev_ros.simulation.raycast.scene import Hits
from simbev_ros.simulation.sensors.lidar_texture import texture_factor


def texture_db(material: Material, point_m: Float64Array, normal: tuple[float, ...], row: int = -1) -> Float32Array:
    count = len(point_m)
    hits = Hits(
        range_m=np.ones(count, np.float32),
        object_id=np.zeros(count, np.uint32),
        row=np.full(count, row, np.int32),
        part=np.full(count, row, np.int32),
        tag=np.zeros(count, np.uint8),
        material=np.full(count, material, np.uint8),
        normal=np.tile(np.array(normal, np.float32), (count, 1)),
        cos_angle=np.ones(count, np.float32),
        triangle=np.zeros(count, np.int32),
        barycentric=np.zeros((count, 2), np.float32),
    )
    level_db: Float32Array = 10.0 * np.log10(texture_factor(hits, point_m.astype(np.float32)))
    return level_db


def road(shift_m: float = 0.0) -> Float64Array:
    rng = np.random.default_rng(4)
    point_m = np.column_stack([rng.uniform(-500.0, 500.0, (40_000, 2)), np.zeros(40_000)])
    point_m[:, 0] += shift_m
    return point_m


def test_asphalt_differs_as_much_over_decimeters_and_meters_as_a_real_road() -> None:
    """Standard deviations of differences over the square root of 2, less the noise of pulses: nuScenes' HDL-32E."""
    here = texture_db(Material.ASPHALT, road(), (0.0, 0.0, 1.0))
    assert here.mean() == pytest.approx(0.0, abs=0.15)
    assert here.std() == pytest.approx(float(load_materials().lidar_texture_db[Material.ASPHALT]), rel=0.1)
    for shift_m, low_db, high_db in ((0.3, 0.2, 0.45), (1.2, 0.6, 1.1)):
        there = texture_db(Material.ASPHALT, road(shift_m), (0.0, 0.0, 1.0))
        assert low_db < (there - here).std() / np.sqrt(2.0) < high_db


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_every_side_of_a_static_surface_has_its_texture_in_its_own_plane(axis: int) -> None:
    along = np.zeros((200, 3))
    along[:, axis] = np.linspace(0.0, 20.0, 200)
    for facing in range(3):
        spread_db = texture_db(Material.BRICK, along, tuple(np.eye(3)[facing])).std()
        assert (spread_db > 0.1) == (facing != axis)


def test_actors_and_smooth_materials_have_none() -> None:
    assert not texture_db(Material.ASPHALT, road(), (0.0, 0.0, 1.0), row=2).any()
    assert not texture_db(Material.GLASS, road(), (0.0, 0.0, 1.0)).any()
