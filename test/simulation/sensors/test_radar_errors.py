"""Amplitude, noise, threshold and resolution cells of the radar, checked on a wall at a known distance."""

import numpy as np
import pytest
from pydantic import ValidationError
from synthetic_world import actor, box, box_model, mesh, sheet, static_scene, world

from simbev_ros.assets.materials import Material
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.radar import Radar
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.scene.air import extinction_per_m
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors import radar_amplitude
from simbev_ros.simulation.sensors.radar import RadarModel, scan_radars

EGO = box_model(Tag.CAR, (4.0, 2.0, 1.5))
LORRY = box_model(Tag.TRUCK, (2.0, 6.0, 3.0), Material.METAL)
RAYS = 40_000


def radar(**properties: object) -> Radar:
    defaults: dict[str, object] = {"pose": {"z_m": 1.0}, "points_per_second": RAYS}
    return Radar.model_validate({"type": "radar", "name": "front"} | defaults | properties)


def wall(ahead_m: float, material: Material = Material.METAL, tag: Tag = Tag.WALL) -> StaticScene:
    """A wall before the radar that fills its view; the ego drives towards it with 20 m/s."""
    return static_scene(mesh(box([ahead_m + 0.5, 0.0, 0.0], [1.0, 900.0, 300.0]), tag, material))


def driving(**weather: float) -> WorldState:
    state = world(actor(EGO, vx=20.0))
    return WorldState(0, 0, state.ego_id, state.actors, state.signals, state.weather.model_copy(update=weather))


def scan(sensor: Radar, static: StaticScene, state: WorldState | None = None) -> Table:
    state = state or driving()
    scene = RayScene(static, [EGO, LORRY])
    scene.update(state, np.zeros(3), 130.0, state.ego_ids)
    return scan_radars([RadarModel(sensor, 5, 1.0)], scene, state, None)[0]


def errors_of(sensor: Radar, static: StaticScene) -> tuple[Table, dict[str, Float64Array]]:
    """Detections of a sensor, and their differences from the ideal ones of the same rays."""
    ideal, measured = scan(radar(), static), scan(sensor, static)
    names = ("range", "azimuth", "elevation", "doppler_velocity", "amplitude")
    return measured, {name: measured[name].astype(float) - ideal[name] for name in names}


def test_every_material_has_one_surface() -> None:
    data = load_table("simbev_ros.simulation.sensors", "radar_surfaces.yaml")
    named = [material for surface in data["surfaces"].values() for material in surface["materials"]]
    assert sorted(named) == sorted(material.name for material in Material)


def test_amplitude_falls_with_the_fourth_power_of_the_range() -> None:
    narrow = {"horizontal_fov_deg": 0.5, "vertical_fov_deg": 0.5}
    near_db, far_db, reference_db = (scan(radar(**narrow), wall(m))["amplitude"].mean() for m in (25.0, 50.0, 100.0))
    assert near_db - far_db == pytest.approx(40.0 * np.log10(2.0), abs=0.01)
    square_m2 = 10.0**1.5 + 10.0**0.4  # of metal, in radar_surfaces.yaml
    assert reference_db == pytest.approx(10.0 * np.log10(square_m2), abs=0.01), "0 dB: 1 m² at 100 m"


def test_amplitude_follows_the_cross_section_under_the_angle_of_incidence() -> None:
    cloud = scan(radar(), wall(10.0))
    cosine = 10.0 / cloud["range"].astype(float)
    cross_section_m2 = 10.0**0.4 * cosine**2 + 10.0**1.5 * np.exp(-((np.sqrt(1 - cosine**2) / cosine / 0.35) ** 2))
    expected_db = 10.0 * np.log10(cross_section_m2) + 40.0 * np.log10(100.0 / cloud["range"])
    assert cosine.min() < 0.7
    assert cloud["amplitude"] == pytest.approx(expected_db, abs=0.02)


def test_metal_returns_more_than_pedestrians_and_these_more_than_the_road_at_grazing_incidence() -> None:
    sections = radar_amplitude.load_cross_sections()
    materials = np.array([Material.CAR_PAINT, Material.CLOTH, Material.FOLIAGE, Material.ASPHALT], np.uint8)
    tags = np.array([Tag.CAR, Tag.PEDESTRIAN, Tag.VEGETATION, Tag.ROAD], np.uint8)
    dbsm = 10.0 * np.log10(sections.at_incidence(materials, tags, np.array([0.95, 0.95, 0.95, 0.05])))
    assert 8.0 < dbsm[0] < 16.0
    assert -8.0 < dbsm[1] < 0.0
    assert -15.0 < dbsm[2] < 0.0
    assert dbsm[3] < -25.0
    lorry, car = sections.at_incidence(
        materials[[0, 0]], np.array([Tag.TRUCK, Tag.CAR], np.uint8), np.array([0.5, 0.5])
    )
    assert lorry / car == pytest.approx(10.0)


def test_edge_on_surfaces_return_little_but_more_than_zero() -> None:
    sections = radar_amplitude.load_cross_sections()
    materials = np.arange(len(Material), dtype=np.uint8)
    for cosine in (0.0, -1e-7, 1.0):
        m2 = sections.at_incidence(materials, np.zeros(len(materials), np.uint8), np.full(len(materials), cosine))
        assert (m2 > 0.0).all() and np.isfinite(m2).all()


def test_rain_attenuates_over_twice_the_range() -> None:
    state = driving(precipitation=100.0)
    dry, wet = scan(radar(), wall(60.0), state), scan(radar(rain_attenuation=True), wall(60.0), state)
    loss_db = (dry["amplitude"] - wet["amplitude"]).astype(float)
    rate_mmph = radar_amplitude.rain_rate_mmph(state.weather)
    # Drops of N0 exp(-4.1 rate^-0.21 D), N0 = 8000 per m³ and mm, extinguish light by twice their cross-section.
    assert 8e6 * np.pi / (4100.0 * rate_mmph**-0.21) ** 3 == pytest.approx(extinction_per_m(state.weather, 0.0)[1])
    assert 10.0 < rate_mmph < 20.0
    assert loss_db == pytest.approx(2e-3 * dry["range"] * 1.13 * rate_mmph**0.712, abs=1e-4)
    assert loss_db.min() > 0.8
    assert scan(radar(rain_attenuation=True), wall(60.0)).tobytes() == scan(radar(), wall(60.0)).tobytes()


def test_noise_has_the_configured_sigmas_and_xyz_follow_it() -> None:
    sensor = radar(
        range_noise_sigma_m=0.2,
        azimuth_noise_sigma_deg=0.5,
        elevation_noise_sigma_deg=0.8,
        doppler_noise_sigma_mps=0.1,
        amplitude_noise_sigma_db=1.5,
    )
    cloud, errors = errors_of(sensor, wall(30.0))
    assert len(cloud) == RAYS
    sigmas = [0.2, np.radians(0.5), np.radians(0.8), 0.1, 1.5]
    for error, sigma in zip(errors.values(), sigmas, strict=True):
        assert error.std() == pytest.approx(sigma, rel=0.03)
        assert abs(error.mean()) < 0.02 * sigma
    correlation = np.corrcoef(list(errors.values()))
    assert np.abs(correlation - np.eye(5)).max() < 0.03
    level = np.cos(cloud["elevation"]) * cloud["range"]
    assert cloud["x"] == pytest.approx(level * np.cos(cloud["azimuth"]), abs=1e-4)
    assert cloud["y"] == pytest.approx(level * np.sin(cloud["azimuth"]), abs=1e-4)
    assert cloud["z"] == pytest.approx(np.sin(cloud["elevation"]) * cloud["range"], abs=1e-4)


def test_every_ray_has_its_own_noise_whatever_else_returns() -> None:
    sensor = radar(range_noise_sigma_m=0.2, points_per_second=4000)
    free = scan(sensor, wall(30.0))
    obstructed = scan(sensor, wall(30.0), world(actor(EGO, vx=20.0), actor(LORRY, 1, id=9, x=10.0)))
    assert 0.1 < np.isin(obstructed, free).mean() < 0.95
    assert (obstructed["range"] < 12.0).any()


def test_detections_below_the_threshold_are_lost() -> None:
    ideal = scan(radar(), wall(20.0))
    kept = scan(radar(threshold_db=30.0), wall(20.0))
    assert 0 < len(kept) < len(ideal)
    assert kept.tobytes() == ideal[ideal["amplitude"] >= 30.0].tobytes()


def test_speeds_beyond_the_unambiguous_range_are_aliased() -> None:
    cloud, error = errors_of(radar(max_doppler_mps=8.0), wall(30.0))
    assert np.abs(cloud["doppler_velocity"]).max() <= 8.0
    wraps = error["doppler_velocity"] / 16.0
    assert wraps == pytest.approx(np.round(wraps), abs=1e-5)
    assert set(np.round(wraps)) == {1.0}, "all are between -20 and -12.8 m/s"
    assert errors_of(radar(max_doppler_mps=25.0), wall(30.0))[1]["doppler_velocity"] == pytest.approx(np.zeros(RAYS))


def test_values_are_the_centers_of_their_cells() -> None:
    cells = {"range": 0.4, "doppler_velocity": 0.25, "azimuth": np.radians(2.0), "elevation": np.radians(3.0)}
    sensor = radar(
        range_resolution_m=0.4, doppler_resolution_mps=0.25, azimuth_resolution_deg=2.0, elevation_resolution_deg=3.0
    )
    cloud, errors = errors_of(sensor, wall(30.0))
    for name, cell in cells.items():
        number = cloud[name] / cell - (0.5 if name == "range" else 0.0)
        assert number == pytest.approx(np.round(number), abs=1e-4)
        assert np.abs(errors[name]).max() == pytest.approx(cell / 2.0, rel=0.01)
    assert 0.0 in cloud["azimuth"]
    assert not errors["amplitude"].any()


def test_one_per_cell_keeps_the_strongest_in_the_order_of_the_rays() -> None:
    cells = {
        "range_resolution_m": 1.0,
        "doppler_resolution_mps": 0.5,
        "azimuth_resolution_deg": 5.0,
        "elevation_resolution_deg": 4.0,
    }
    everything, single = scan(radar(**cells), wall(30.0)), scan(radar(**cells, one_per_cell=True), wall(30.0))
    columns = ["range", "doppler_velocity", "azimuth", "elevation"]
    strongest: dict[tuple[float, ...], float] = {}
    for row in everything[[*columns, "amplitude"]].tolist():
        strongest[row[:4]] = max(row[4], strongest.get(row[:4], -np.inf))
    assert 50 < len(single) < len(everything) / 10
    assert {row[:4]: row[4] for row in single[[*columns, "amplitude"]].tolist()} == strongest
    rows = [int(np.flatnonzero(everything == row)[0]) for row in single]
    assert rows == sorted(rows)


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"min_range_m": 120.0}, "min_range_m 120 is not below range_m 120"),
        ({"points_per_second": 1_000_000, "rate_hz": 0.5}, "2000000 rays a scan; at most 1000000 are allowed"),
        ({"one_per_cell": True, "range_resolution_m": 1}, "cells need doppler_resolution_mps, azimuth_resolution_deg"),
        ({"horizontal_fov_deg": 180}, "less than 180"),
        ({"ray_pattern": "spiral"}, "'cone' or 'even'"),
    ],
)
def test_invalid_properties_are_rejected(bad: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        radar(**bad)


def test_the_ground_is_faint_and_is_detected_up_to_the_maximum_range() -> None:
    ground = static_scene(mesh(sheet([-300, -300], [300, 300]), Tag.ROAD, Material.ASPHALT))
    cloud = scan(radar(), ground)
    far = cloud["range"] > 60.0
    assert far.sum() > 100
    assert cloud["amplitude"][far].max() < -20.0
