"""Tables of points: of lidars, semantic lidars and radars."""

import numpy as np

from simbev_ros.foundation.types import Float64Array, Table

POINT_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, sensor frame
        ("y", "<f4"),
        ("z", "<f4"),
        ("intensity", "<f4"),  # 0..1
        ("ring", "<u2"),  # channel, 0 is the lowest unless configured otherwise
        ("time", "<f4"),  # s from the stamp, ≤ 0; 0 unless the lidar is rolling
    ]
)
"""Row of the table of returns, packed as Velodyne's XYZIRT: offsets 0 4 8 12 16 18, 22 bytes."""


SEMANTIC_POINT_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, sensor frame
        ("y", "<f4"),
        ("z", "<f4"),
        ("cos_angle", "<f4"),  # cosine of the angle between ray and surface normal, 0 grazing, 1 perpendicular
        ("object_id", "<u4"),  # id of the actor, 0 on static surfaces
        ("tag", "<u4"),  # semantic tag
        ("time", "<f4"),  # s from the stamp, ≤ 0; 0 unless the lidar is rolling
    ]
)
"""Row of the table of returns of the semantic lidar, without noise, loss or weather; 28 bytes."""


RADAR_POINT_DTYPE = np.dtype(
    [
        ("x", "<f4"),  # m, sensor frame, by the measured range and angles
        ("y", "<f4"),
        ("z", "<f4"),
        ("range", "<f4"),  # m
        ("azimuth", "<f4"),  # rad, 0 ahead, left positive (REP-103)
        ("elevation", "<f4"),  # rad above the sensor's x-y plane
        ("doppler_velocity", "<f4"),  # m/s along the ray, relative to the radar: positive recedes, negative approaches
        ("amplitude", "<f4"),  # dB relative to the return of 1 m² at the radar's reference range
    ]
)
"""Row of the table of detections, 32 bytes. From ``range`` on, names, units and signs are those of
radar_msgs/RadarReturn. Its authors define positive speeds as receding
(github.com/ros-perception/radar_msgs/issues/11), and so does CARLA."""


RADAR_RCS_DTYPE = np.dtype(
    [
        (
            "rcs",
            "<f4",
        ),  # dBsm (dB of 1 m²): radar cross-section, which follows from the measured amplitude and range
    ]
)
"""Column that radars with a detector have in addition."""

RADAR_TARGET_DTYPE = np.dtype(RADAR_POINT_DTYPE.descr + RADAR_RCS_DTYPE.descr)
"""Row of the table of targets of a radar with a detector, 36 bytes."""


def radar_rcs_dbsm(table: Table, reference_range_m: float) -> Float64Array:
    """Cross-sections of radar detections by the radar equation.

    Args:
        table: (N,) ``RADAR_POINT_DTYPE`` or ``RADAR_TARGET_DTYPE``.
        reference_range_m: Range at which 1 m² returns an amplitude of 0 dB, as the radar is configured.

    Returns:
        (N,) dBsm.
    """
    range_m = np.maximum(table["range"].astype(np.float64), 1e-3)
    rcs_dbsm: Float64Array = table["amplitude"] + 40.0 * np.log10(range_m / reference_range_m)
    return rcs_dbsm
