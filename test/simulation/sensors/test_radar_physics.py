"""Cross-sections and speeds that a radar with a detector measures, against values worked out by hand."""

from typing import Any

import numpy as np
import pytest
from synthetic_world import TICK_NS, actor, ball, box, box_model, cart_model, mesh, static_scene, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.radar import Radar
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.points import RADAR_POINT_DTYPE, RADAR_TARGET_DTYPE
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.radar import RadarModel, scan_radars
from simbev_ros.simulation.sensors.radar_amplitude import load_cross_sections

MODELS = (cart_model(), box_model(Tag.TRUCK, (2.0, 6.0, 3.0), Material.METAL))
EMPTY = StaticScene((), ())
SCANS = 60


def radar(**properties: object) -> Radar:
    values: dict[str, object] = {
        "pose": Pose(z_m=1.0),
        "range_m": 120,
        "horizontal_fov_deg": 10,
        "vertical_fov_deg": 8,
        "points_per_second": 400_000,
        "ray_pattern": "even",
        "range_resolution_m": 1.0,
        "doppler_resolution_mps": 0.25,
        "azimuth_resolution_deg": 3.0,
        "max_doppler_mps": 30.0,
        "detector": {"noise_dbsm": -60},
    }
    return Radar.model_validate({"type": "radar", "name": "front"} | values | properties)


def scan(sensor: Radar, static: StaticScene, state: WorldState) -> Table:
    scene = RayScene(static, MODELS)
    scene.update(state, np.zeros(3), 160.0, state.ego_ids)
    return scan_radars([RadarModel(sensor, 5, TICK_NS * 1e-9)], scene, state, None)[0]


def mean_rcs_dbsm(sensor: Radar, static: StaticScene) -> float:
    """Mean over many scans, which averages the speckle, of the strongest target's cross-section; a scan may miss it."""
    clouds = [scan(sensor, static, world(actor(MODELS[0]), tick=tick)) for tick in range(SCANS)]
    found_m2 = [10.0 ** (cloud["rcs"].max() / 10.0) if len(cloud) else 0.0 for cloud in clouds]
    return float(10.0 * np.log10(np.mean(found_m2)))


def sphere(center_m: tuple[float, float, float], radius_m: float, material: Material = Material.METAL) -> StaticScene:
    return static_scene(mesh(ball(center_m, radius_m), Tag.STATIC, material))


def plate(turned_deg: float) -> StaticScene:
    """One square meter of metal 30 m ahead, turned about the vertical."""
    turned = np.radians(turned_deg)
    turn = np.array([[np.cos(turned), -np.sin(turned), 0], [np.sin(turned), np.cos(turned), 0], [0, 0, 1]])
    return static_scene(mesh(box([0, 0, 0], [0.001, 1.0, 1.0]) @ turn.T + [30.2, 0.3, 1.0], Tag.STATIC, Material.METAL))


@pytest.mark.parametrize("rays_per_second", [100_000, 1_000_000])
@pytest.mark.parametrize("radius_m", [0.25, 0.5])
def test_a_metal_sphere_has_the_area_of_its_disk_with_any_number_of_rays(radius_m: float, rays_per_second: int) -> None:
    measured = mean_rcs_dbsm(radar(points_per_second=rays_per_second), sphere((30.0, 0.4, 1.0), radius_m))
    assert measured == pytest.approx(10.0 * np.log10(np.pi * radius_m**2), abs=1.5)


def test_a_glass_sphere_is_weaker_by_the_reflectance_of_its_index() -> None:
    index = 2.51
    reflectance_db = 20.0 * np.log10((index - 1.0) / (index + 1.0))
    metal, glass = (
        mean_rcs_dbsm(radar(), sphere((30.0, 0.4, 1.0), 0.5, each)) for each in (Material.METAL, Material.GLASS)
    )
    assert glass - metal == pytest.approx(reflectance_db, abs=1.5)


def test_a_plate_has_the_lobe_of_its_roughness_and_not_that_of_a_flat_one() -> None:
    """A flat square meter has 4 π A² / λ² = 59 dBsm, within λ / 2a = 0.1 degrees: a car has no such plate."""
    facing, turned = (mean_rcs_dbsm(radar(), plate(degrees)) for degrees in (0.0, 20.0))
    specular, diffuse, spread = 10.0**1.5, 10.0**0.4, 0.35
    # 2 ∫ (specular exp(-(tan t / spread)²) + diffuse cos² t) d(cos t), the first term as a series in spread²
    disk = specular * spread**2 * (1.0 - 1.5 * spread**2 + 3.75 * spread**4) + 2.0 * diffuse / 3.0
    assert facing == pytest.approx(10.0 * np.log10((specular + diffuse) / disk), abs=1.5)
    lobe = specular * np.exp(-((np.tan(np.radians(20.0)) / spread) ** 2)) + diffuse * np.cos(np.radians(20.0)) ** 2
    assert facing - turned == pytest.approx(10.0 * np.log10((specular + diffuse) / lobe), abs=1.5)


@pytest.mark.parametrize(("material", "reflectance_db"), [(Material.METAL, 0.0), (Material.CONCRETE, -8.0)])
def test_lobes_reflect_what_the_table_says(material: Material, reflectance_db: float) -> None:
    """Rings of a unit sphere: its cross-section over that of its disk."""
    edges = np.radians(np.linspace(0.0, 90.0, 2001))
    cosine = np.cos((edges[1:] + edges[:-1]) / 2.0)
    rings_m2 = 2.0 * np.pi * (np.cos(edges[:-1]) - np.cos(edges[1:]))
    per_m2 = load_cross_sections().per_m2(np.full(2000, material, np.uint8), cosine)
    assert 10.0 * np.log10(np.sum(per_m2 * rings_m2) / np.pi) == pytest.approx(reflectance_db, abs=0.01)


def test_targets_have_cross_sections_by_amplitude_and_range_and_detections_have_none() -> None:
    ball = sphere((30.0, 0.4, 1.0), 0.5)
    cloud = scan(radar(reference_range_m=50.0), ball, world(actor(MODELS[0])))
    assert cloud.dtype == RADAR_TARGET_DTYPE
    range_m = cloud["range"].astype(np.float64)
    assert cloud["rcs"] == pytest.approx(cloud["amplitude"] + 40.0 * np.log10(range_m / 50.0), abs=1e-4)
    assert scan(radar(detector=None), ball, world(actor(MODELS[0]))).dtype == RADAR_POINT_DTYPE


def test_a_radar_without_elevations_reports_all_targets_in_its_plane() -> None:
    cloud = scan(radar(measures_elevation=False), sphere((30.0, 0.4, 2.0), 0.5), world(actor(MODELS[0])))
    assert len(cloud) and not cloud["elevation"].any() and not cloud["z"].any()
    assert np.hypot(cloud["x"], cloud["y"]) == pytest.approx(cloud["range"])


def speed_of_strongest(sensor: Radar, static: StaticScene, *rows: Any) -> Float64Array:
    cloud = scan(sensor, static, world(*rows))
    return np.asarray(cloud["doppler_velocity"][cloud["amplitude"].argmax()], np.float64)


def test_a_truck_ahead_has_its_speed_less_that_of_the_ego() -> None:
    truck = actor(MODELS[1], blueprint=1, id=9, x=40.0, vx=13.0)
    assert speed_of_strongest(radar(), EMPTY, actor(MODELS[0], vx=8.0), truck) == pytest.approx(5.0, abs=0.1)


def test_a_turning_ego_moves_a_radar_at_its_corner() -> None:
    """Arm (2, -1), turn rate 0.5: the radar moves by 0.5 · (1, 2) = (0.5, 1) beside the ego's 6 ahead."""
    sensor = radar(pose=Pose(x_m=2.0, y_m=-1.0, z_m=1.0, yaw_deg=90.0))
    ahead_of_radar = sphere((2.0, 29.0, 1.0), 0.5)
    ego = actor(MODELS[0], vx=6.0, wz=0.5)
    assert speed_of_strongest(sensor, ahead_of_radar, ego) == pytest.approx(-1.0, abs=0.1)


BALLS = static_scene(
    *(mesh(ball([x, y, 1.0], 0.5), Tag.STATIC, Material.METAL) for x, y in ((30.0, 0.2), (34.0, 20.0), (120.0, -3.0)))
)
"""Balls ahead, to the left and far ahead."""


def test_a_second_scan_sees_further_in_the_same_cloud() -> None:
    far = {"range_m": 200, "horizontal_fov_deg": 4, "range_resolution_m": 2.0}
    both = radar(range_m=60, horizontal_fov_deg=60, points_per_second=1_000_000, second_scan=far)
    near = scan(radar(range_m=60, horizontal_fov_deg=60, points_per_second=1_000_000), BALLS, world(actor(MODELS[0])))
    cloud = scan(both, BALLS, world(actor(MODELS[0])))
    assert both.scans_of_cycle[1].azimuth_resolution_deg == both.azimuth_resolution_deg
    assert cloud[: len(near)].tobytes() == near.tobytes()
    assert near["range"] == pytest.approx([29.8, 39.8], abs=1.0)
    assert cloud[len(near) :]["range"] == pytest.approx([29.8, 119.8], abs=2.0)


def test_what_does_not_fit_in_a_second_scan_is_refused() -> None:
    with pytest.raises(ValueError, match=r"second_scan: detector: \d+ cells of range"):
        radar(second_scan={"range_resolution_m": 0.0001})
    with pytest.raises(ValueError, match=r"second_scan: min_range_m 10 is not below range_m 5"):
        radar(min_range_m=10, second_scan={"range_m": 5})
    with pytest.raises(ValueError, match=r"second_scan: detector: the radar has none"):
        radar(detector=None, second_scan={"detector": {}})


def test_cross_sections_below_the_smallest_are_not_reported() -> None:
    own_dbsm = 10.0 * np.log10(np.pi * 0.5**2)
    for limit_dbsm, count in ((own_dbsm - 12.0, 1), (own_dbsm + 12.0, 0)):
        detector = {"noise_dbsm": -60, "min_rcs_dbsm": limit_dbsm}
        assert len(scan(radar(detector=detector), sphere((30.0, 0.4, 1.0), 0.5), world(actor(MODELS[0])))) == count
