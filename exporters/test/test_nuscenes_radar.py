"""Columns of nuScenes' radar files, by hand."""

import numpy as np

from simbev_exporters.nuscenes.sensor_files import radar_rows
from simbev_ros.config.radar import Radar
from simbev_ros.schema.points import RADAR_POINT_DTYPE, RADAR_TARGET_DTYPE

LIMITS_OF_ARS408 = [
    0.005, 0.006, 0.008, 0.011, 0.014, 0.018, 0.023, 0.029, 0.038, 0.049, 0.063, 0.081, 0.105, 0.135, 0.174, 0.224,
    0.288, 0.371, 0.478, 0.616, 0.794, 1.023, 1.317, 1.697, 2.187, 2.817, 3.630, 4.676, 6.025, 7.762, 10.0,
]  # fmt: skip
"""Upper limits of the classes of its errors, as drivers of ARS 408-21 list them, m or m/s."""


def radar(**properties: str) -> Radar:
    return Radar.model_validate({"type": "radar", "name": "radar_front"} | properties)


def test_radar_velocities_are_compensated_for_the_radars_own() -> None:
    cloud = np.zeros(3, RADAR_POINT_DTYPE)
    cloud["x"], cloud["y"] = [30.0, 0.0, 40.0], [0.0, 20.0, 30.0]
    cloud["doppler_velocity"] = [-10.0, 0.0, -10.0]  # at 10 m/s: a wall ahead, a wall at the side, an oncoming car
    rows = radar_rows(cloud, np.array([10.0, 0.0, 0.0]), radar())
    np.testing.assert_allclose(rows["vx"], [-10, 0, -8], atol=1e-5)
    np.testing.assert_allclose(rows["vx_comp"], [0, 0, -1.6], atol=1e-5)
    np.testing.assert_allclose(rows["vy_comp"], [0, 0, -1.2], atol=1e-5)
    assert rows["dyn_prop"].tolist() == [1, 1, 2]


def test_radar_cross_sections_do_not_depend_on_range() -> None:
    cloud = np.zeros(2, RADAR_POINT_DTYPE)
    cloud["x"] = cloud["range"] = [100.0, 10.0]
    cloud["amplitude"] = [3.0, 43.0]  # the same 2 m²: ten times as near is ten thousand times as strong
    np.testing.assert_allclose(radar_rows(cloud, np.zeros(3), radar())["rcs"], 3.0, atol=1e-4)


def test_radar_rows_of_a_product_have_its_cross_sections_and_classes_of_errors() -> None:
    product = radar(preset="ARS408-21")
    cloud = np.zeros(3, RADAR_TARGET_DTYPE)
    cloud["x"], cloud["y"], cloud["range"] = [50.0, 0.0, 30.0], [0.0, 50.0, 40.0], 50.0
    cloud["doppler_velocity"], cloud["rcs"] = 10.0, [7.0, -3.0, 12.0]
    cloud["amplitude"] = cloud["rcs"] + 40.0 * np.log10(100.0 / 50.0)
    rows = radar_rows(cloud, np.zeros(3), product)
    np.testing.assert_allclose(rows["rcs"], cloud["rcs"], atol=1e-4)
    # 0.1 m along the ray, 50 m · 0.3° = 0.262 m across it; at 3 : 4 the roots of 0.06² + 0.209² and 0.08² + 0.157²
    assert [LIMITS_OF_ARS408[index] for index in rows["x_rms"]] == [0.105, 0.288, 0.224]
    assert [LIMITS_OF_ARS408[index] for index in rows["y_rms"]] == [0.288, 0.105, 0.224]
    # 0.03 m/s along the ray, 10 m/s · 0.3° = 0.052 m/s across it
    assert [LIMITS_OF_ARS408[index] for index in rows["vx_rms"]] == [0.038, 0.063, 0.049]
    same = ("is_quality_valid", "ambig_state", "invalid_state", "pdh0")
    assert [set(rows[name].tolist()) for name in same] == [{1}, {3}, {0}, {1}]
    assert not radar_rows(cloud, np.zeros(3), radar())["x_rms"].any(), "an ideal radar is exact"
    cloud["x"], cloud["y"], cloud["range"] = 200.0, 0.0, 200.0
    far = radar_rows(cloud, np.zeros(3), product)[0]
    # 0.4 m along the ray, 200 m · 0.1° = 0.349 m across it
    assert [LIMITS_OF_ARS408[far[name]] for name in ("x_rms", "y_rms")] == [0.478, 0.371]
