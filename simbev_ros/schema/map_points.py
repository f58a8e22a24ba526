"""Points of a sensor's cloud in the map frame; those of a rolling scan are moved with the vehicle that carries it."""

import numpy as np

from simbev_ros.foundation.types import Float64Array, Table


def map_points(cloud: Table, map_from_sensor: Float64Array, carrier: Table | None = None) -> Float64Array:
    """(N, 3) float64 points of a sensor's cloud in the map frame, meters.

    Args:
        cloud: (N,) rows with ``x y z`` in the sensor frame.
        map_from_sensor: (4, 4) pose of the sensor at the stamp.
        carrier: For rolling scans, with points in the sensor frame at their own ``time``: the ``ACTOR_DTYPE`` row
            of the vehicle that carries the sensor, assumed to move and turn uniformly during a scan. None: all points
            were measured at the stamp.
    """
    local_m = np.stack([cloud["x"], cloud["y"], cloud["z"]], dtype=np.float64)
    points_m: Float64Array = np.einsum("ij,jn->in", map_from_sensor[:3, :3], local_m)  # BLAS would wake its threads
    points_m += map_from_sensor[:3, 3:]
    if carrier is None:
        return points_m.T
    return _motion_compensated(points_m.T, cloud["time"].astype(np.float64)[:, None], carrier)


def _motion_compensated(points_m: Float64Array, time_s: Float64Array, carrier: Table) -> Float64Array:
    """Move (N, 3) points with their carrier to where they were at (N, 1) times relative to the stamp."""
    position_m, velocity_mps, turn_radps = (
        np.array([carrier[name] for name in names], np.float64)
        for names in (("x", "y", "z"), ("vx", "vy", "vz"), ("wx", "wy", "wz"))
    )
    rate_radps = float(np.linalg.norm(turn_radps))
    axis = turn_radps / max(rate_radps, 1e-12)
    offset_m, angle_rad = points_m - position_m, rate_radps * time_s
    cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
    rotated_m = offset_m * cosine + np.cross(axis, offset_m) * sine + axis * (offset_m @ axis)[:, None] * (1.0 - cosine)
    return position_m + velocity_mps * time_s + rotated_m  # Rodrigues' formula
