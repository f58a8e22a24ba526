"""Targets of a radar as it is sold, against scatterers and surfaces whose answers are known."""

import numpy as np
import pytest
from synthetic_world import TICK_NS, actor, box_model, cart_model, mesh, sheet, static_scene, world

from simbev_ros.assets.materials import Material
from simbev_ros.config.radar import Radar, RadarDetector
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.radar import RadarModel, scan_radars
from simbev_ros.simulation.sensors.radar_targets import Scatterers, find_targets

MODELS = (cart_model(), box_model(Tag.TRUCK, (2.0, 6.0, 3.0), Material.METAL))


def radar(**properties: object) -> Radar:
    values: dict[str, object] = {
        "pose": Pose(z_m=1.0),
        "range_m": 150,
        "horizontal_fov_deg": 120,
        "vertical_fov_deg": 20,
        "points_per_second": 400_000,
        "ray_pattern": "even",
        "range_resolution_m": 0.5,
        "doppler_resolution_mps": 0.25,
        "azimuth_resolution_deg": 2.0,
        "max_doppler_mps": 30.0,
        "detector": {},
    }
    return Radar.model_validate({"type": "radar", "name": "front"} | values | properties)


def points(*rows: tuple[float, float, float, float], elevation_rad: float = 0.02) -> Scatterers:
    """Scatterers of 1 m² times a factor at range, speed and azimuth in degrees, with power by the radar equation."""
    factor, range_m, speed_mps, azimuth_deg = np.array(rows, np.float64).T
    power = factor * (100.0 / range_m) ** 4
    return Scatterers(power, range_m, speed_mps, np.radians(azimuth_deg), np.full(len(rows), elevation_rad))


def targets(seen: Scatterers, seed: int = 3, **properties: object) -> Scatterers:
    sensor = radar(**properties)
    assert isinstance(sensor.detector, RadarDetector)
    return find_targets(sensor, sensor.detector, seen, np.random.default_rng(seed))


def cross_sections(found: Scatterers) -> Float64Array:
    return 10.0 * np.log10(found.power * (found.range_m / 100.0) ** 4)


def test_one_point_is_one_target_at_its_place_with_its_cross_section() -> None:
    found = targets(points((1.0, 33.3, -4.06, 11.0)))
    assert len(found.power) == 1
    assert found.range_m == pytest.approx([33.3], abs=0.1)
    assert found.speed_mps == pytest.approx([-4.06], abs=0.05)
    assert np.degrees(found.azimuth_rad) == pytest.approx([11.0], abs=0.4)
    assert found.elevation_rad == pytest.approx([0.02])
    assert cross_sections(found) == pytest.approx([0.0], abs=1.7)  # 0.54 dB in each dimension between two cells


@pytest.mark.parametrize(
    ("apart", "count"), [((3.0, 0, 0), 2), ((0, 2.0, 0), 2), ((0, 0, 10.0), 2), ((0.3, 0.1, 1.0), 1)]
)
def test_two_points_are_two_targets_if_cells_lie_between_them(apart: tuple[float, float, float], count: int) -> None:
    first = np.array([30.0, 2.0, -5.0])
    found = targets(points((1.0, *first), (1.0, *(first + apart))))
    assert len(found.power) == count


def test_weak_points_drown_in_noise_and_speeds_are_ambiguous() -> None:
    faint = points((1e-3, 90.0, 0.0, 0.0))
    assert len(targets(faint).power) == 0
    assert len(targets(faint, detector={"noise_dbsm": -50}).power) == 1
    assert targets(points((1.0, 30.0, 33.0, 0.0))).speed_mps == pytest.approx([-27.0], abs=0.05)


def test_a_point_in_clutter_needs_more_power_than_one_beside_it() -> None:
    rng = np.random.default_rng(5)
    count = 4000
    clutter = Scatterers(
        np.full(count, 2e-3 * (100.0 / 40.0) ** 4),
        rng.uniform(30.0, 50.0, count),
        np.zeros(count),
        rng.uniform(-0.1, 0.1, count),
        np.zeros(count),
    )

    def found_at(azimuth_deg: float) -> bool:
        point = points((0.3, 40.0, 0.0, azimuth_deg), elevation_rad=0.3)
        both = Scatterers(*(np.concatenate(pair) for pair in zip(clutter, point, strict=True)))
        found = targets(both)
        return bool(
            np.any((np.abs(found.range_m - 40.0) < 0.3) & (np.abs(found.azimuth_rad - np.radians(azimuth_deg)) < 0.02))
        )

    assert found_at(30.0)
    assert not found_at(0.0)


def test_the_strongest_are_kept_nearest_first() -> None:
    seen = points(*((1.0 + index % 7, 10.0 + 4.0 * index, 0.0, 0.0) for index in range(30)))
    quiet = {"noise_dbsm": -40, "clutter_cells": 2}
    found = targets(seen, detector={"max_targets": 10} | quiet)
    assert len(found.power) == 10
    assert (np.diff(found.range_m) > 0.0).all()
    assert found.power.min() > np.sort(targets(seen, detector=quiet).power)[-11]


def scan(sensor: Radar, state: WorldState, seed: int = 5) -> Table:
    scene = RayScene(static_scene(mesh(sheet([-300, -300], [300, 300]), Tag.ROAD, Material.ASPHALT)), MODELS)
    scene.update(state, np.zeros(3), 160.0, state.ego_ids)
    return scan_radars([RadarModel(sensor, seed, TICK_NS * 1e-9)], scene, state, None)[0]


def test_a_truck_is_several_targets_with_its_speed_and_about_its_cross_section() -> None:
    truck = actor(MODELS[1], blueprint=1, id=9, x=40.0, y=5.0, vx=-6.0)
    cloud = scan(radar(), world(actor(MODELS[0]), truck))
    of_truck = cloud[np.abs(cloud["doppler_velocity"] + 6.0) < 0.5]
    assert 1 <= len(of_truck) <= 40
    assert (np.abs(of_truck["x"] - 39.0) < 1.5).all()
    rcs_dbsm = of_truck["amplitude"] + 40.0 * np.log10(of_truck["range"] / 100.0)
    assert 5.0 < 10.0 * np.log10(np.sum(10.0 ** (rcs_dbsm / 10.0))) < 32.0
    assert np.array_equal(cloud, scan(radar(), world(actor(MODELS[0]), truck)))


def test_cells_of_a_detector_are_configured() -> None:
    with pytest.raises(ValueError, match="detector: cells need azimuth_resolution_deg"):
        radar(azimuth_resolution_deg=None)
    with pytest.raises(ValueError, match="detector: cells need max_doppler_mps"):
        radar(max_doppler_mps=None)
    with pytest.raises(ValueError, match="detector: 108000000 cells"):
        radar(range_resolution_m=0.02)
    with pytest.raises(ValueError, match="ray_pattern even"):
        radar(ray_pattern="cone")
