"""Figures of sensors against arrays with known answers, and real layouts of files that are read."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy import ndimage

from simbev_ros.config.radar import Radar
from simbev_ros.evaluation.realism.comparison import Row, compare
from simbev_ros.evaluation.realism.samples import LidarTurn, Photograph, RadarScan, sample_of, samples_of_folder
from simbev_ros.evaluation.realism.statistics import curves_of, figures_of
from simbev_ros.foundation.errors import InputError
from simbev_ros.schema.points import RADAR_TARGET_DTYPE

SHARED = Path(__file__).parents[2].parent / "shared/real"


def ground_turn(
    noise_m: float = 0.0,
    lost: tuple[int, int] = (0, 0),
    columns: int = 2000,
    elevations_deg: tuple[float, float] = (-12.0, -9.0),
) -> LidarTurn:
    """Two channels that look at level ground 2 m below; the columns in ``lost`` have no returns."""
    rng = np.random.default_rng(4)
    azimuth = np.delete(np.linspace(-np.pi, np.pi, columns, endpoint=False), np.arange(*lost))
    clouds = []
    for elevation in np.radians(elevations_deg):
        range_m = 2.0 / -np.sin(elevation) + noise_m * rng.standard_normal(len(azimuth))
        level = np.cos(elevation) * range_m
        clouds.append(np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation) * range_m], axis=1))
    xyz_m = np.concatenate(clouds).astype(np.float32)
    return LidarTurn(xyz_m, np.full(len(xyz_m), 0.2, np.float32), np.repeat([0, 1], len(azimuth)))


def test_losses_and_noise_of_a_lidar_are_those_that_were_put_in() -> None:
    whole, holed = figures_of([ground_turn()]), figures_of([ground_turn(lost=(100, 120))])
    assert whole["returns lost near by [%]"] == 0.0
    assert holed["returns lost near by [%]"] == pytest.approx(1.0, abs=0.01)
    assert holed["lost returns in a row"] == 20.0
    assert figures_of([ground_turn(noise_m=0.015)])["noise of range on planes [mm]"] == pytest.approx(15.0, rel=0.1)
    assert whole["noise of range on planes [mm]"] < 0.1


def test_intensities_of_a_lidar() -> None:
    turn = ground_turn()
    turn.intensity[::4], turn.intensity[1::4] = 0.0, 1.0
    figures = figures_of([turn])
    assert figures["intensity of 0 [%]"] == figures["retroreflectors [%]"] == 25.0
    assert figures["steps of intensity"] == 3
    assert figures["intensity from 10 to 20 m"] < 0.5
    assert np.isnan(figures["intensity from 40 to 80 m"])


@pytest.mark.parametrize(
    ("elevations_deg", "expected"),
    [((-70.0, -65.0), "0 to 30"), ((-40.0, -38.0), "30 to 60"), ((-9.0, -8.0), "75 to 85")],
)
def test_intensities_by_incidence_are_those_of_the_surface(elevations_deg: tuple[float, float], expected: str) -> None:
    figures = figures_of([ground_turn(elevations_deg=elevations_deg)])
    known = {name: value for name, value in figures.items() if "incidences" in name and np.isfinite(value)}
    assert known == {f"intensity at incidences of {expected} deg": pytest.approx(0.2)}


def test_losses_are_those_of_each_channel() -> None:
    turn = ground_turn(elevations_deg=(-13.0, -9.0))
    rows = np.flatnonzero((turn.ring == 1) | (np.arange(len(turn.ring)) % 4 > 0))
    curve = curves_of([LidarTurn(turn.xyz_m[rows], turn.intensity[rows], turn.ring[rows])])[
        "Losses by elevation of channels"
    ]
    lost = {float(x): y for x, y in zip(curve.x, curve.y, strict=True) if np.isfinite(y)}
    assert lost == {-13.0: pytest.approx(25.0), -9.0: 0.0}


def test_channels_that_swing_are_not_taken_for_rings() -> None:
    whole = ground_turn()
    swinging = LidarTurn(whole.xyz_m, whole.intensity, np.arange(len(whole.ring)) // 7 % 2)
    swinging.xyz_m[:, 2] *= 1.0 + 3.0 * np.linspace(0.0, 1.0, len(whole.ring), dtype=np.float32)
    figures = figures_of([swinging])
    unknown = ("rays without return [%]", "returns lost near by [%]", "noise of range on planes [mm]")
    assert all(np.isnan(figures[name]) for name in unknown)
    assert figures["intensity, 50th percentile"] == pytest.approx(0.2)


def test_noise_over_brightness_is_that_of_each_brightness() -> None:
    gray = np.repeat([60.0, 180.0], 128)[None, :] + np.repeat([2.0, 5.0], 128) * np.random.default_rng(3).normal(
        size=(256, 256)
    )
    curve = curves_of([Photograph(np.repeat(np.rint(gray)[..., None], 3, axis=2).astype(np.uint8))])[
        "Noise over brightness"
    ]
    assert curve.y[[60 // 16, 180 // 16]] == pytest.approx([2.0, 5.0], rel=0.25)


@pytest.mark.parametrize("sigma_px", [0.0, 0.6])
def test_the_slope_of_a_spectrum_is_that_of_the_lens(sigma_px: float) -> None:
    """White noise is flat; behind a Gaussian blur its power falls as exp(-(2 pi f sigma)²)."""
    white = np.fft.fft2(30.0 * np.random.default_rng(2).standard_normal((512, 512)))
    gray = 128.0 + np.fft.ifft2(ndimage.fourier_gaussian(white, sigma_px)).real
    image = Photograph(np.repeat(np.clip(gray, 0, 255)[..., None], 3, axis=2).astype(np.uint8))
    frequency = np.linspace(0.25, 0.475, 100)
    expected = np.polyfit(np.log(frequency), -((2.0 * np.pi * frequency * sigma_px) ** 2), 1)[0]
    assert figures_of([image])["slope of the spectrum near Nyquist"] == pytest.approx(expected, abs=0.4)


def test_brightness_saturation_and_noise_of_images() -> None:
    rng = np.random.default_rng(1)
    image = np.zeros((160, 320, 3))
    image[:, :160], image[:, 160:] = (60.0, 60.0, 60.0), (180.0, 90.0, 90.0)
    noisy = np.clip(np.round(image + rng.normal(0.0, 3.0, (160, 320, 1))), 0, 255).astype(np.uint8)
    noisy[:25] = 255
    figures = figures_of([Photograph(noisy)])
    assert figures["pixels above 252 [%]"] == pytest.approx(100.0 * 25 / 160)
    assert figures["mean saturation [0-255]"] == pytest.approx(135 / 160 * 0.5 * 127.5, rel=0.05)
    for half in ("dark", "bright"):
        assert figures[f"noise in flat {half} areas [0-255]"] == pytest.approx(3.0, rel=0.25)


def test_rows_say_whether_ours_lie_in_the_span_of_real_sensors() -> None:
    def scan(count: int) -> RadarScan:
        return RadarScan(np.full(count, -5.0, np.float32))

    scans = {"a": [scan(150), scan(250)], "b": [scan(300)]}
    rows = {row.figure: row for row in compare({"front": [scan(2000)]}, scans)}
    assert rows["detections a scan"][2:] == (2000.0, {"a": 200.0, "b": 300.0}, 150.0, 300.0)
    assert not rows["detections a scan"].is_inside
    assert rows["cross-section, 50th percentile [dBsm]"].is_inside
    assert Row("x", "y", 325.0, {"a": 200.0, "b": 300.0}, 150.0, 300.0).is_inside
    assert compare({"front": scans["a"]}, {"photographs": [Photograph(np.zeros((64, 64, 3), np.uint8))]}) == []


def test_layouts_of_public_data_sets_are_read(tmp_path: Path) -> None:
    points = np.random.default_rng(3).uniform(2.0, 9.0, (30, 4)).astype(np.float32)
    (tmp_path / "velodyne").mkdir()
    points[:, 3] = 0.25
    points.tofile(tmp_path / "velodyne/000000.bin")
    (tmp_path / "LIDAR_TOP").mkdir()
    rings = np.arange(30, dtype=np.float32) % 8
    np.column_stack([points[:, :3], np.full(30, 51.0), rings]).astype(np.float32).tofile(
        tmp_path / "LIDAR_TOP/a.pcd.bin"
    )
    head = "VERSION 0.7\nFIELDS x rcs\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary\n"
    (tmp_path / "RADAR_FRONT").mkdir()
    targets = np.array([[1.0, -8.0], [2.0, 4.0]], np.float32)
    (tmp_path / "RADAR_FRONT/a.pcd").write_bytes(head.encode() + targets.tobytes())
    (tmp_path / "CAM_FRONT").mkdir()
    cv2.imwrite(str(tmp_path / "CAM_FRONT/a.png"), np.random.default_rng(0).integers(0, 255, (48, 64, 3)))
    cv2.imwrite(str(tmp_path / "labels.png"), np.full((48, 64), 7, np.uint8))
    found = samples_of_folder(tmp_path, 10)
    assert sorted(found) == ["CAM_FRONT (png)", "LIDAR_TOP (bin)", "RADAR_FRONT (pcd)", "velodyne (bin)"]
    (kitti,), (nuscenes,), (radar,) = (
        found[f"{name}"] for name in ("velodyne (bin)", "LIDAR_TOP (bin)", "RADAR_FRONT (pcd)")
    )
    assert isinstance(nuscenes, LidarTurn)
    assert nuscenes.ring.tolist() == rings.tolist()
    assert nuscenes.intensity == pytest.approx(np.full(30, 0.2))
    assert isinstance(kitti, LidarTurn)
    assert len(kitti.xyz_m) == 30
    assert isinstance(radar, RadarScan)
    assert radar.rcs_dbsm.tolist() == [-8.0, 4.0]


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.bin", b"123"), ("a.jpg", b"no"), ("a.pcd", b"FIELDS x\nDATA binary\n"), ("a.feather", b"x" * 40)],
)
def test_damaged_files_and_empty_folders_are_one_line(tmp_path: Path, name: str, content: bytes) -> None:
    with pytest.raises(InputError, match="has no samples"):
        samples_of_folder(tmp_path, 10)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=rf"\A{tmp_path}/{name}: [^\n]*\Z"):
        samples_of_folder(tmp_path, 10)


def test_real_frames_are_told_from_each_other_by_what_is_known_of_them() -> None:
    if not SHARED.is_dir():
        pytest.skip("without real frames")
    figures = {name: figures_of(samples) for name, samples in samples_of_folder(SHARED, 3).items()}
    assert figures["kitti (bin)"]["intensity of 0 [%]"] == pytest.approx(9.3, abs=1.0)
    assert (
        figures["nuscenes (bin)"]["noise of range on planes [mm]"]
        < figures["kitti (bin)"]["noise of range on planes [mm]"]
    )
    assert json.dumps(figures)


def test_own_radars_have_cross_sections_by_the_radar_equation() -> None:
    radar = Radar.model_validate({"type": "radar", "name": "front", "reference_range_m": 50.0})
    cloud = np.zeros(2, RADAR_TARGET_DTYPE)
    cloud["range"], cloud["amplitude"] = [50.0, 5.0], [3.0, 43.0]
    sample = sample_of(radar, cloud)
    assert isinstance(sample, RadarScan)
    assert sample.rcs_dbsm == pytest.approx([3.0, 3.0], abs=1e-4)
