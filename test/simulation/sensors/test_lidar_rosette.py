"""Lidars whose scans do not repeat."""

import numpy as np
import pytest
from synthetic_world import actor, cart_model, sheet, static_scene, world
from synthetic_world import mesh as mesh_of

from simbev_ros.assets.materials import Material
from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.lidar import LidarModel
from simbev_ros.simulation.sensors.lidar_pattern import ScanPattern

CART = cart_model()


def lidar(**properties: object) -> Lidar:
    return Lidar.model_validate(
        {"type": "lidar", "name": "top", "preset": "Mid-360", "pose": {"z_m": 2.0}, "rolling": False} | properties
    )


def angles_deg(pattern: ScanPattern) -> tuple[Float64Array, Float64Array]:
    x, y, z = pattern.directions.astype(np.float64).T
    return np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(z))


def covered(seconds: float) -> float:
    """Share of the field of view's cells of one degree by one that the Mid-360 has looked at, by solid angle."""
    sensor = lidar()
    ends_s = 5.0 + np.arange(round(seconds / 0.1)) * 0.1
    turns = [angles_deg(ScanPattern.from_lidar(sensor, 0.1, end_s)) for end_s in ends_s]
    azimuth, elevation = (np.concatenate(angles) for angles in zip(*turns, strict=True))
    cells, *_ = np.histogram2d(elevation, azimuth, [np.arange(-7.0, 53.0), np.arange(-180.0, 181.0)])
    area = np.cos(np.radians(np.arange(-6.5, 52.5)))
    return float(((cells > 0).mean(axis=1) * area).sum() / area.sum())


def test_a_rosette_never_repeats_and_fills_its_field_of_view() -> None:
    shares = [covered(seconds) for seconds in (0.1, 0.2, 0.5)]
    assert 0.4 < shares[0] < 0.6
    assert shares[1] > 0.75
    assert shares[2] > 0.98


def test_a_rosettes_lines_cross_each_azimuth_40_times_a_frame() -> None:
    azimuth, elevation = angles_deg(ScanPattern.from_lidar(lidar(), 0.1, 3.0))
    ahead = np.abs(azimuth) < 0.36
    assert ahead.sum() == pytest.approx(40, abs=4)
    assert np.ptp(elevation[ahead]) > 55.0
    assert elevation.min() >= -7.0 - 1e-4
    assert elevation.max() <= 52.0 + 1e-4


def test_a_rosette_goes_on_where_the_last_frame_ended() -> None:
    sensor = lidar()
    longer = ScanPattern.from_lidar(lidar(columns=10_000), 0.2, 1.0)
    halves = [ScanPattern.from_lidar(sensor, 0.1, end_s) for end_s in (0.9, 1.0)]
    joined = np.concatenate([half.directions for half in halves])
    assert joined == pytest.approx(longer.directions, abs=1e-5)


def test_the_next_cloud_looks_elsewhere_and_a_repeated_one_is_the_same() -> None:
    scene = RayScene(static_scene(mesh_of(sheet((-60, -60), (60, 60)), Tag.GROUND, Material.ASPHALT)), [CART])
    model = LidarModel(lidar(upper_fov_deg=-2.0), 5, 0.1)

    def cloud(tick: int) -> Table:
        state = world(actor(CART), tick=tick)
        scene.update(state, np.zeros(3), 80.0, state.ego_ids)
        points = model.scan(scene, state).points
        assert points is not None
        return points

    first, second, again = cloud(2), cloud(3), cloud(2)
    assert len(first) > 1000
    assert np.array_equal(first, again)
    cells = [{*map(tuple, np.round(np.column_stack([each["x"], each["y"]]), 2))} for each in (first, second)]
    assert len(cells[0] & cells[1]) < 0.1 * len(cells[0])
