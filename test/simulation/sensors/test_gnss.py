import math

import numpy as np
import pytest
from analytic_maps import tunnel
from pyproj import Transformer
from synthetic_world import TICK_NS, actor, box_model, world

from simbev_ros.config.positioning import Gnss
from simbev_ros.config.sensor import Pose
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.semantics import Tag
from simbev_ros.maps.build import load_datum
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.simulation.sensors.gnss import NO_FIX, GnssFix, GnssModel

CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))
DATUM = MapDatum(latitude_deg=60.0, longitude_deg=24.0, altitude_m=50.0)
SILENT = {"latitude_noise_sigma_deg": 0, "longitude_noise_sigma_deg": 0, "altitude_noise_sigma_m": 0}
UTM = "+proj=utm +zone=32 +datum=WGS84 +units=m +no_defs"


def gnss(**properties: object) -> Gnss:
    return Gnss.model_validate({"type": "gnss", "name": "gnss"} | properties)


def fixes(sensor: Gnss, ticks: range, seed: int = 1) -> list[GnssFix]:
    """Fixes of an ego that stands at (10, 20)."""
    model = GnssModel(sensor, DATUM, seed, TICK_NS)
    return [model.measure(world(actor(CAR, x=10.0, y=20.0), tick=tick)) for tick in ticks]


def errors_m(found: list[GnssFix]) -> np.ndarray:
    """(N, 3) errors east, north, up of fixes from ``fixes``."""
    positions = [DATUM.map_from_geodetic(fix.latitude_deg, fix.longitude_deg, fix.altitude_m) for fix in found]
    return np.array(positions) - [10.0, 20.0, 0.0]


def test_fix_without_noise_converts_back_to_the_antenna() -> None:
    sensor = gnss(pose=Pose(x_m=2.0, y_m=0.5, z_m=1.0), **SILENT)
    state = world(actor(CAR, x=300.0, y=-120.0, z=4.0, yaw=np.pi / 2))
    fix = GnssModel(sensor, DATUM, 1, TICK_NS).measure(state)
    position_m = DATUM.map_from_geodetic(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
    assert position_m == pytest.approx((299.5, -118.0, 5.0), abs=1e-5)
    assert fix.covariance_m2 is not None and fix.covariance_m2 == pytest.approx(1e-6 * np.eye(3))


def map_lon_lat_pipeline(datum: MapDatum) -> Transformer:
    """Conversion from the map frame to longitude and latitude, written as a PROJ pipeline."""
    if datum.projection:
        turn = f"+step +proj=affine +s11={math.cos(datum.heading_rad)!r} +s12={-math.sin(datum.heading_rad)!r} "
        turn += f"+s21={math.sin(datum.heading_rad)!r} +s22={math.cos(datum.heading_rad)!r} "
        turn += f"+xoff={datum.false_easting_m!r} +yoff={datum.false_northing_m!r} "
        plane = "+step +inv +proj=utm +zone=32 +ellps=WGS84 "
    else:
        turn = ""
        plane = f"+step +inv +proj=tmerc +lat_0={datum.latitude_deg!r} +lon_0={datum.longitude_deg!r} +ellps=WGS84 "
    return Transformer.from_pipeline(f"+proj=pipeline {turn}{plane}+step +proj=unitconvert +xy_in=rad +xy_out=deg")


@pytest.mark.parametrize(
    "datum",
    [
        load_datum(MapSpec(name="Blocks", seed=0)),
        DATUM,
        MapDatum(-33.9, 151.2, 20.0),
        MapDatum(48.1, 11.5, 500.0, UTM, 691_000.25, 5_335_000.5),
        MapDatum(48.1, 11.5, 500.0, UTM, 691_000.25, 5_335_000.5, heading_rad=0.7),
    ],
    ids=["blocks", "north", "south", "utm", "turned"],
)
@pytest.mark.parametrize("position_m", [(3.0, -2.0, 0.5), (850.0, -400.0, 12.0), (9000.0, 7000.0, 80.0)])
def test_fix_without_noise_agrees_with_a_proj_pipeline(datum: MapDatum, position_m: tuple[float, float, float]) -> None:
    x, y, z = position_m
    fix = GnssModel(gnss(**SILENT), datum, 1, TICK_NS).measure(world(actor(CAR, x=x, y=y, z=z)))
    back_m = map_lon_lat_pipeline(datum).transform(fix.longitude_deg, fix.latitude_deg, direction="INVERSE")
    assert math.dist(back_m, (x, y)) < 1e-3
    assert fix.altitude_m == pytest.approx(datum.altitude_m + z)


def test_errors_have_the_variances_that_the_covariance_reports() -> None:
    sensor = gnss(latitude_noise_sigma_deg=2e-6, longitude_noise_sigma_deg=6e-6, altitude_noise_sigma_m=0.7)
    found = fixes(sensor, range(2000))
    covariance = found[0].covariance_m2
    assert covariance is not None
    assert np.diag(covariance) == pytest.approx(np.var(errors_m(found), axis=0), rel=0.1)
    assert covariance[0, 0] ** 0.5 == pytest.approx(6e-6 * 55800, rel=2e-3)  # a degree at 60° north: 55.80 km
    assert covariance[1, 1] ** 0.5 == pytest.approx(2e-6 * 111412, rel=2e-3)  # … of latitude: 111.41 km
    assert np.mean(errors_m(found), axis=0) == pytest.approx([0, 0, 0], abs=0.05)


def test_noise_repeats_for_a_tick_and_differs_between_receivers() -> None:
    here = fixes(gnss(), range(4, 5))
    assert here[0].latitude_deg == fixes(gnss(), range(5))[4].latitude_deg
    assert here[0].latitude_deg != fixes(gnss(name="spare"), range(4, 5))[0].latitude_deg


def test_the_bias_walk_is_in_the_covariance_and_changes_slowly() -> None:
    walk = {"bias_walk_horizontal_sigma_m": 2.0, "bias_walk_vertical_sigma_m": 5.0, "bias_walk_time_s": 30.0}
    found = fixes(gnss(**SILENT, **walk), range(200))
    errors = errors_m(found)
    assert np.ptp(errors[:, 0]) > 0.05 and np.abs(np.diff(errors, axis=0)).max() < 1.5
    covariance = found[0].covariance_m2
    assert covariance is not None and np.diag(covariance) == pytest.approx([4.0, 4.0, 25.0])
    starts = [errors_m(fixes(gnss(**SILENT, **walk), range(1), seed))[0] for seed in range(200)]
    assert np.std(starts, axis=0) == pytest.approx([2.0, 2.0, 5.0], rel=0.15)


def test_without_a_fix_there_is_neither_a_position_nor_a_covariance() -> None:
    found = fixes(gnss(dropout_share=0.5, dropout_mean_s=0.2), range(100))
    lost = [fix for fix in found if fix.covariance_m2 is None]
    assert 20 < len(lost) < 80
    assert all(math.isnan(fix.latitude_deg + fix.longitude_deg + fix.altitude_m) for fix in lost)
    assert not any(math.isnan(fix.latitude_deg) for fix in found if fix.covariance_m2 is not None)


def test_bias_walk_and_drop_outs_continue_over_ticks_that_were_dropped() -> None:
    sensor = gnss(bias_walk_horizontal_sigma_m=2.0, dropout_share=0.3, dropout_mean_s=0.4)
    whole, thinned = fixes(sensor, range(200)), fixes(sensor, range(0, 200, 7))
    positions = [np.array([[fix.latitude_deg, fix.longitude_deg] for fix in each]) for each in (whole[::7], thinned)]
    assert np.array_equal(*positions, equal_nan=True)
    assert np.isnan(positions[1]).any() and not np.isnan(positions[1]).all()


def test_a_receiver_with_a_longer_period_is_due_at_every_nth_tick() -> None:
    model = GnssModel(gnss(), DATUM, 1, TICK_NS, period_ticks=4)
    assert [model.is_due(tick) for tick in (-4, 0, 1, 4)] == [False, True, False, True]


def test_there_is_no_fix_in_a_tunnel_and_the_same_one_outside() -> None:
    """The antenna is 1.5 m ahead of the ego; the portal is at x = 176."""
    sensor, tunnels = gnss(pose=Pose(x_m=1.5, z_m=1.6)), Tunnels.of_layout(tunnel().layout)
    states = [world(actor(CAR, x=x, y=254.0), tick=tick) for tick, x in enumerate((150.0, 174.0, 175.0, 256.0, 340.0))]
    without, within = (
        [GnssModel(sensor, DATUM, 1, TICK_NS, tunnels=each).measure(state) for state in states]
        for each in (None, tunnels)
    )
    assert [fix.covariance_m2 is not None for fix in within] == [True, True, False, False, True]
    assert all(math.isnan(within[k].latitude_deg) for k in (2, 3))
    assert [within[k].latitude_deg for k in (0, 1, 4)] == [without[k].latitude_deg for k in (0, 1, 4)]


def test_there_is_a_fix_on_the_street_above_a_tunnel() -> None:
    model = GnssModel(gnss(), DATUM, 1, TICK_NS, tunnels=Tunnels.of_layout(tunnel().layout))
    assert model.measure(world(actor(CAR, x=256.0, y=254.0, z=9.0))).covariance_m2 is not None


def test_the_velocity_is_that_of_the_antenna() -> None:
    silent = {"horizontal_noise_sigma_mps": 0, "vertical_noise_sigma_mps": 0}
    sensor = gnss(pose=Pose(x_m=2.0, y_m=0.5, z_m=1.0), velocity=silent)
    model = GnssModel(sensor, DATUM, 1, TICK_NS)
    state = world(actor(CAR, yaw=np.pi / 2, vy=5.0, vz=-0.5, wz=0.5))
    sample = model.measure_velocity(state, model.measure(state))
    assert sample.velocity_mps == pytest.approx([-0.5 * 2.0, 5.0 - 0.5 * 0.5, -0.5], abs=1e-6)


def test_the_noise_of_velocities_fits_their_covariance_and_is_not_that_of_the_fixes() -> None:
    sensor = gnss(velocity={})
    model, noise_mps, noise_m = GnssModel(sensor, DATUM, 1, TICK_NS), [], []
    for tick in range(3000):
        state = world(actor(CAR, x=10.0, y=20.0, vx=3.0), tick=tick)
        fix = model.measure(state)
        sample = model.measure_velocity(state, fix)
        noise_mps.append(sample.velocity_mps - [3.0, 0.0, 0.0])
        noise_m.append(errors_m([fix])[0])
    assert np.cov(np.transpose(noise_mps)) == pytest.approx(np.diag([0.05**2, 0.05**2, 0.1**2]), abs=6e-4)
    assert sample.covariance == pytest.approx(np.diag([0.05**2, 0.05**2, 0.1**2]))
    assert abs(np.corrcoef(np.array(noise_mps)[:, 0], np.array(noise_m)[:, 0])[0, 1]) < 0.08


def test_without_a_fix_there_is_no_velocity() -> None:
    model = GnssModel(gnss(velocity={}), DATUM, 1, TICK_NS)
    sample = model.measure_velocity(world(actor(CAR)), NO_FIX)
    assert np.isnan(sample.velocity_mps).all() and sample.covariance is None


def test_velocity_of_a_receiver_without_one_is_refused() -> None:
    sensor = gnss()
    state = world(actor(CAR))
    model = GnssModel(sensor, DATUM, 1, TICK_NS)
    with pytest.raises(ValueError, match="gnss measures no velocity"):
        model.measure_velocity(state, model.measure(state))
