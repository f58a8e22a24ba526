import numpy as np
import pytest
from pydantic import ValidationError

from simbev_ros.config.lidar import Lidar
from simbev_ros.config.presets import load_presets
from simbev_ros.foundation.types import Float64Array
from simbev_ros.simulation.sensors.lidar_pattern import ScanPattern


def lidar(**properties: object) -> Lidar:
    return Lidar.model_validate({"type": "lidar", "name": "top"} | properties)


def angles_deg(pattern: ScanPattern) -> tuple[Float64Array, Float64Array]:
    x, y, z = pattern.directions.astype(np.float64).T
    return np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(z))


def test_a_partial_field_of_view_is_swept_from_left_to_right_in_its_share_of_the_turn() -> None:
    pattern = ScanPattern.from_lidar(
        lidar(channels=1, columns=4, horizontal_fov_deg=120, lower_fov_deg=0, upper_fov_deg=0), 0.1
    )
    azimuth, elevation = angles_deg(pattern)
    assert azimuth == pytest.approx([45.0, 15.0, -15.0, -45.0], abs=1e-5)
    assert elevation == pytest.approx(np.zeros(4))
    assert pattern.time_s == pytest.approx([-0.025, -0.1 / 6, -0.025 / 3, 0.0])


def test_listed_channels_have_their_elevations_and_azimuth_offsets_by_ring() -> None:
    listed = lidar(elevations_deg=[5.0, -1.0, -10.5], azimuth_offsets_deg=[0.0, 2.0, -3.0], columns=2)
    assert (listed.channels, listed.lower_fov_deg, listed.upper_fov_deg) == (3, -10.5, 5.0)
    pattern = ScanPattern.from_lidar(listed, 0.1)
    azimuth, elevation = angles_deg(pattern)
    assert list(pattern.ring) == [0, 1, 2] * 2
    assert elevation == pytest.approx([5.0, -1.0, -10.5] * 2, abs=1e-5)
    assert azimuth == pytest.approx([90.0, 92.0, 87.0, -90.0, -88.0, -93.0], abs=1e-5)


@pytest.mark.parametrize("name", load_presets("lidar"))
def test_presets_are_complete_and_ascend_by_ring(name: str) -> None:
    sensor = lidar(preset=name)
    pattern = ScanPattern.from_lidar(sensor, 1.0 / sensor.rate_hz)
    _, elevation = angles_deg(pattern)
    assert sensor.rosette or (np.diff(elevation[: sensor.channels]) > 0).all()
    assert len(pattern.directions) == sensor.channels * sensor.columns
    assert Lidar.model_validate_json(sensor.model_dump_json()) == sensor


@pytest.mark.parametrize(
    ("name", "channels", "points_per_second", "extent_deg"),
    [
        ("VLP-16", 16, 0.3e6, (-15, 15)),
        ("VLP-32C", 32, 0.6e6, (-25, 15)),
        ("HDL-32E", 32, 0.7e6, (-30.67, 10.67)),
        ("HDL-64", 64, 1.333e6, (-24.33, 2)),
        ("OS1-128", 128, 2.62e6, (-22.5, 22.5)),
        ("Mid-360", 4, 0.2e6, (-7.0, 52.0)),
    ],
)
def test_presets_have_the_point_rates_of_their_data_sheets(
    name: str, channels: int, points_per_second: float, extent_deg: tuple[float, float]
) -> None:
    sensor = lidar(preset=name)
    assert sensor.channels == channels
    assert sensor.channels * sensor.columns * sensor.rate_hz == pytest.approx(points_per_second, rel=0.05)
    assert (sensor.lower_fov_deg, sensor.upper_fov_deg) == pytest.approx(extent_deg, abs=0.01)


def test_values_of_the_rig_override_those_of_the_preset() -> None:
    assert lidar(preset="VLP-16", range_m=60).range_m == 60
    assert lidar(preset="VLP-16", rate_hz=20).columns == 900
    assert lidar(preset="VLP-16", rate_hz=20, columns=600).columns == 600
    fewer = lidar(preset="VLP-32C", channels=16)
    assert (fewer.elevations_deg, fewer.azimuth_offsets_deg, fewer.lower_fov_deg) == (None, None, -25.0)
    assert lidar(preset="VLP-32C", elevations_deg=[0.0, 1.0]).channels == 2


def test_columns_follow_from_points_per_second() -> None:
    assert lidar(points_per_second=5_242_880, rate_hz=20).columns == 2048
    assert lidar(points_per_second=1_000_000, rate_hz=10, channels=64).columns == 1562
    assert lidar(preset="VLP-16", points_per_second=96_000).columns == 600


@pytest.mark.parametrize(
    ("properties", "message"),
    [
        ({"preset": "VLP-17"}, "preset 'VLP-17' is not known; allowed: VLP-16, "),
        ({"points_per_second": 1000}, "points_per_second needs rate_hz"),
        (
            {"points_per_second": 1000, "rate_hz": 10, "channels": 10, "columns": 20},
            "points_per_second 1000 is not channels 10 x columns 20 x rate_hz 10 = 2000; leave columns or",
        ),
        ({"elevations_deg": [0, 1], "channels": 3}, "channels 3 is not the number of elevations_deg, 2; leave it out"),
        ({"elevations_deg": [0, 1], "upper_fov_deg": 3}, "upper_fov_deg 3 is not the highest of elevations_deg, 1"),
        (
            {"channels": 3, "azimuth_offsets_deg": [0, 1]},
            "azimuth_offsets_deg has 2 numbers; it must have one for each of 3",
        ),
        ({"min_range_m": 50, "range_m": 50}, "min_range_m 50 is not below range_m 50"),
        ({"elevations_deg": [0, 91]}, "elevations_deg.1\n  Input should be less than or equal to 90"),
        (
            {"channels": 1024, "columns": 16384},
            "1024 x columns 16384 = 16777216 rays per turn are too many; allowed are 4000000",
        ),
        ({"horizontal_fov_deg": 0}, "greater than 0"),
        (
            {"preset": "Mid-360", "elevations_deg": [0, 1]},
            "elevations_deg has no meaning with rosette; leave it out",
        ),
    ],
)
def test_inconsistent_properties_are_rejected_by_name(properties: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message.replace("(", r"\(")):
        lidar(**properties)


def test_channels_that_fire_one_after_another_have_their_times_and_turn_on_meanwhile() -> None:
    """VLP-16: 2.304 us from laser to laser, in the order of its ids; a turn of 0.1 s is 3.6 degrees a millisecond."""
    sensor = lidar(preset="VLP-16", rate_hz=10)
    pattern = ScanPattern.from_lidar(sensor, 0.1)
    time_s = pattern.time_s.reshape(sensor.columns, 16)
    assert time_s.max() == pytest.approx(0.0, abs=1e-12)
    lasers = np.argsort(time_s[0])
    elevations_deg = np.linspace(-15.0, 15.0, 16)
    assert elevations_deg[lasers][:4] == pytest.approx([-15.0, 1.0, -13.0, 3.0])
    assert np.diff(np.sort(time_s[0])) == pytest.approx(2.304e-6)
    azimuth = np.arctan2(pattern.directions[:, 1], pattern.directions[:, 0]).reshape(-1, 16)[900]
    turned_deg = np.degrees(azimuth[lasers[0]] - azimuth[lasers[-1]])
    assert turned_deg == pytest.approx(3600.0 * 15 * 2.304e-6, abs=1e-3)


@pytest.mark.parametrize("name", load_presets("lidar"))
def test_presets_roll_and_have_a_receiver_and_none_of_the_papers_losses(name: str) -> None:
    sensor = lidar(preset=name)
    assert sensor.rolling
    assert sensor.receiver is not None
    assert sensor.drop_off == 0.0
    assert len(sensor.channel_delays_us or [0.0] * sensor.channels) == sensor.channels


def test_an_encoder_measures_azimuths_in_its_steps() -> None:
    """HDL-64E: 2083 firings a turn, 4000 steps an encoder's turn: steps of 0.18°, and every 13th or so of 0.09°."""
    sensor = lidar(preset="HDL-64", azimuth_offsets_deg=[0.0] * 64)
    azimuth, _ = angles_deg(ScanPattern.from_lidar(sensor, 0.1))
    step = -np.diff(azimuth.reshape(-1, 64)[:, 0]) % 360.0
    counts = step / 0.09
    assert counts == pytest.approx(np.round(counts), abs=1e-2)
    assert set(np.round(counts)) == {1, 2}
    assert np.mean(np.round(counts) == 1) == pytest.approx(2 - 4000 / 2083, abs=2e-3)
