"""Encodes sensor data as the files of nuScenes' layout: images as JPEG, lidar clouds as float32 rows, radar as PCD.

A frame and a channel enter; the bytes of one file leave.
"""

from collections.abc import Callable

import numpy as np

from simbev_ros.config.radar import Radar
from simbev_ros.dataset import Frame, columns
from simbev_ros.dataset.nuscenes.channels import Channel, Modality
from simbev_ros.export.sensor_data import points_at_stamp, recorded_jpeg, rectify
from simbev_ros.foundation.geometry.camera import LensCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.types import Float32Array, Float64Array, Table
from simbev_ros.recording.image_codecs import encode_rgb
from simbev_ros.schema.points import radar_rcs_dbsm

_MAX_INTENSITY = 255.0
"""Upper end of nuScenes' lidar intensities, which start at 0."""

_MIN_MOVING_MPS = 0.5
_MOVING, _STATIONARY, _ONCOMING = 0, 1, 2  # dynamic properties
_UNAMBIGUOUS = 3
_BELOW_25_PERCENT = 1  # probability that a target is an artifact
_RMS_LIMITS = 0.005 * 2000.0 ** (np.arange(31) / 30.0)
"""Upper limits of the classes of standard deviations of ARS 408-21, m or m/s: 0.005, 0.006, 0.008, ... 10."""

RADAR_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, sensor frame
        ("y", "<f4"),
        ("z", "<f4"),
        ("dyn_prop", "i1"),
        ("id", "<i2"),
        ("rcs", "<f4"),  # dB of 1 m²
        ("vx", "<f4"),  # m/s, measured along the ray, relative to the radar
        ("vy", "<f4"),
        ("vx_comp", "<f4"),  # the same without the motion of the radar
        ("vy_comp", "<f4"),
        ("is_quality_valid", "i1"),
        ("ambig_state", "i1"),
        ("x_rms", "i1"),
        ("y_rms", "i1"),
        ("invalid_state", "i1"),
        ("pdh0", "i1"),
        ("vx_rms", "i1"),
        ("vy_rms", "i1"),
    ]
)
"""nuScenes' 18 fields of a radar detection."""


def encode_file(frame: Frame, channel: Channel) -> bytes:
    """Encode the data of a channel at a frame as the content of its file."""
    return _CONTENT[channel.modality](frame, channel)


def _image(frame: Frame, channel: Channel) -> bytes:
    """JPEG file of an image: as recorded, unless it was recorded raw or the lens distorts it."""
    camera = channel.calibration.camera
    if isinstance(camera, LensCamera | FisheyeCamera):
        return encode_rgb(rectify(frame[channel.key], camera))
    return recorded_jpeg(frame, channel.key)


def _lidar(frame: Frame, channel: Channel) -> bytes:
    """Binary file of ``lidar_rows`` in nuScenes' lidar frame."""
    rows = lidar_rows(frame, channel)
    rows[:, 0], rows[:, 1] = -rows[:, 1], rows[:, 0].copy()  # axes of SENSOR_FROM_LIDAR
    return rows.tobytes()


def lidar_rows(frame: Frame, channel: Channel) -> Float32Array:
    """(N, 5) x y z intensity ring of a lidar's points, sensor frame. Those of a rolling scan are moved to the stamp.

    For a lidar without intensities, the cosine of the incidence angle replaces them, and rings are 0.
    """
    cloud: Table = frame[channel.key]
    names = cloud.dtype.names or ()
    rows = np.zeros((len(cloud), 5), np.float32)
    rows[:, :3] = points_at_stamp(frame, channel.key, channel.calibration)
    rows[:, 3] = cloud["intensity" if "intensity" in names else "cos_angle"] * _MAX_INTENSITY
    rows[:, 4] = cloud["ring"] if "ring" in names else 0
    return rows


def _radar(frame: Frame, channel: Channel) -> bytes:
    """PCD file of ``RADAR_DTYPE`` rows. Without detections it has one row of NaN, as the devkit requires."""
    sensor = channel.calibration.sensor
    assert isinstance(sensor, Radar)
    cloud = in_sector(frame[channel.key], channel.sector, sensor.horizontal_fov_deg)
    rows = radar_rows(cloud, _velocity_mps(frame, channel), sensor)
    if not len(rows):
        rows = np.zeros(1, RADAR_DTYPE)
        rows["x"] = rows["y"] = rows["z"] = np.nan
    return _pcd_head(len(rows)) + rows.tobytes() + b"\n"  # the devkit's reader requires a byte after the last row


def in_sector(cloud: Table, sector: tuple[int, int], fov_deg: float) -> Table:
    """The detections of a radar in one of several equal parts of its field of view, counted from the left."""
    index, count = sector
    from_left = 0.5 - np.degrees(np.arctan2(cloud["y"], cloud["x"])) / fov_deg
    return cloud[np.clip(np.floor(from_left * count), 0, count - 1) == index]


def radar_rows(cloud: Table, velocity_mps: Float64Array, radar: Radar) -> Table:
    """Radar detections as (N,) ``RADAR_DTYPE`` rows.

    Args:
        cloud: (N,) ``RADAR_POINT_DTYPE`` or ``RADAR_TARGET_DTYPE``.
        velocity_mps: (3,) velocity of the radar over ground, sensor frame.
        radar: Configuration of the radar.
    """
    points_m = columns(cloud, "x", "y", "z").astype(np.float64)
    range_m = np.maximum(np.linalg.norm(points_m, axis=1), 1e-6)
    rays = points_m / range_m[:, None]
    measured_mps = cloud["doppler_velocity"].astype(np.float64)
    over_ground_mps = measured_mps + rays @ velocity_mps
    rows = np.zeros(len(cloud), RADAR_DTYPE)
    rows["x"], rows["y"], rows["z"] = points_m.T
    rows["id"] = np.arange(len(cloud)) % np.iinfo(np.int16).max
    rows["rcs"] = radar_rcs_dbsm(cloud, radar.reference_range_m)
    rows["vx"], rows["vy"] = (rays[:, :2] * measured_mps[:, None]).T
    rows["vx_comp"], rows["vy_comp"] = (rays[:, :2] * over_ground_mps[:, None]).T
    moving = np.where(over_ground_mps > 0, _MOVING, _ONCOMING)
    rows["dyn_prop"] = np.where(np.abs(over_ground_mps) < _MIN_MOVING_MPS, _STATIONARY, moving)
    rows["is_quality_valid"], rows["ambig_state"], rows["pdh0"] = 1, _UNAMBIGUOUS, _BELOW_25_PERCENT
    for name, sigmas in zip(
        ("x_rms", "y_rms", "vx_rms", "vy_rms"), _sigmas(radar, rays, range_m, measured_mps), strict=True
    ):
        rows[name] = np.searchsorted(_RMS_LIMITS, sigmas, side="right")
    return rows


def _sigmas(radar: Radar, rays: Float64Array, range_m: Float64Array, measured_mps: Float64Array) -> Float64Array:
    """(4, N) standard deviations of x, y, vx and vy, m and m/s; in the first scan, or beyond its range in the last."""
    scans = radar.scans_of_cycle
    first, last = (_sigmas_of_scan(scan, rays, range_m, measured_mps) for scan in (scans[0], scans[-1]))
    return np.where(range_m > radar.range_m, last, first)


def _sigmas_of_scan(
    radar: Radar, rays: Float64Array, range_m: Float64Array, measured_mps: Float64Array
) -> Float64Array:
    """(4, N) standard deviations by the errors of range, azimuth and speed."""
    cells = (
        (0.0, 0.0, 0.0)
        if radar.detector
        else (radar.range_resolution_m or 0.0, radar.doppler_resolution_mps or 0.0, radar.azimuth_resolution_deg or 0.0)
    )
    noise = radar.range_noise_sigma_m, radar.doppler_noise_sigma_mps, radar.azimuth_noise_sigma_deg
    range_sigma_m, speed_sigma_mps, azimuth_sigma_deg = np.hypot(noise, np.divide(cells, np.sqrt(12.0)))
    along, across = np.abs(rays[:, :2].T), np.abs(rays[:, 1::-1].T) * np.radians(azimuth_sigma_deg)
    return np.concatenate(
        [
            np.hypot(along * range_sigma_m, across * range_m),
            np.hypot(along * speed_sigma_mps, across * np.abs(measured_mps)),
        ]
    )


def _velocity_mps(frame: Frame, channel: Channel) -> Float64Array:
    """(3,) velocity of a sensor over ground, sensor frame."""
    row, pose = frame["odom"][-1], channel.calibration.ego_from_sensor
    velocity_mps = row["velocity_mps"] + np.cross(row["angular_velocity_radps"], pose[:3, 3])
    return np.asarray(velocity_mps @ pose[:3, :3], np.float64)


def _pcd_head(count: int) -> bytes:
    kinds = {"f": "F", "i": "I"}
    parts = [RADAR_DTYPE[name] for name in RADAR_DTYPE.names or ()]
    return "\n".join(
        [
            "# .PCD v0.7 - Point Cloud Data file format",
            "VERSION 0.7",
            f"FIELDS {' '.join(RADAR_DTYPE.names or ())}",
            f"SIZE {' '.join(str(part.itemsize) for part in parts)}",
            f"TYPE {' '.join(kinds[part.kind] for part in parts)}",
            f"COUNT {' '.join('1' for _ in parts)}",
            f"WIDTH {count}",
            "HEIGHT 1",
            "VIEWPOINT 0 0 0 1 0 0 0",
            f"POINTS {count}",
            "DATA binary\n",
        ]
    ).encode()


_CONTENT: dict[Modality, Callable[[Frame, Channel], bytes]] = {"camera": _image, "lidar": _lidar, "radar": _radar}
