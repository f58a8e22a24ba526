import numpy as np
import pytest
from synthetic_world import actor, box_model, world

from simbev_ros.config.positioning import Gnss
from simbev_ros.config.sensor import Pose
from simbev_ros.geometry.geodesy import MapDatum
from simbev_ros.semantics import Tag
from simbev_ros.sensors.gnss import measure_gnss

CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))
DATUM = MapDatum(latitude_deg=60.0, longitude_deg=24.0, altitude_m=50.0)


def gnss(**properties: object) -> Gnss:
    return Gnss.model_validate({"type": "gnss", "name": "gnss"} | properties)


def test_fix_without_noise_converts_back_to_the_antenna() -> None:
    sensor = gnss(
        pose=Pose(x_m=2.0, y_m=0.5, z_m=1.0),
        latitude_noise_sigma_deg=0,
        longitude_noise_sigma_deg=0,
        altitude_noise_sigma_m=0,
    )
    state = world(actor(CAR, x=300.0, y=-120.0, z=4.0, yaw=np.pi / 2))
    fix = measure_gnss(sensor, state, DATUM, seed=1)
    place_m = DATUM.map_from_geodetic(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
    assert place_m == pytest.approx((299.5, -118.0, 5.0), abs=1e-5)
    assert not fix.covariance_m2.any()


def test_errors_have_the_variances_of_the_covariance() -> None:
    sensor = gnss(latitude_noise_sigma_deg=2e-6, longitude_noise_sigma_deg=6e-6, altitude_noise_sigma_m=0.7)
    errors_m = []
    for tick in range(3000):
        fix = measure_gnss(sensor, world(actor(CAR, x=10.0, y=20.0), tick=tick), DATUM, seed=1)
        place_m = DATUM.map_from_geodetic(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
        errors_m.append(np.subtract(place_m, [10.0, 20.0, 0.0]))
    variances = np.var(errors_m, axis=0)
    assert np.diag(fix.covariance_m2) == pytest.approx(variances, rel=0.1)
    assert fix.covariance_m2[0, 0] ** 0.5 == pytest.approx(6e-6 * 55800, rel=2e-3)  # a degree at 60° north: 55.80 km
    assert fix.covariance_m2[1, 1] ** 0.5 == pytest.approx(2e-6 * 111412, rel=2e-3)  # … of latitude: 111.41 km
    assert np.mean(errors_m, axis=0) == pytest.approx([0, 0, 0], abs=0.05)


def test_noise_repeats_for_a_tick_and_differs_between_receivers() -> None:
    state = world(actor(CAR), tick=4)
    assert measure_gnss(gnss(), state, DATUM, 1).latitude_deg == measure_gnss(gnss(), state, DATUM, 1).latitude_deg
    other = measure_gnss(gnss(name="spare"), state, DATUM, 1)
    assert other.latitude_deg != measure_gnss(gnss(), state, DATUM, 1).latitude_deg
