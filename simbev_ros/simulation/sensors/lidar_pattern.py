"""Scan pattern of a rotating lidar: direction, ring and firing time of every ray of one turn.

A turn starts behind the sensor (-x) and runs clockwise seen from above: behind, left, ahead, right. With a narrower
horizontal field of view it runs from left to right through ahead. Column c of C looks at azimuth
fov / 2 - fov (c + ½) / C and is fired (c + 1 - C) / C of the sweep after the stamp, i.e. the last column at the stamp.
Where the channels of a column fire one after another, the sensor turns on meanwhile, and the last of them fires then.
The duration of the sweep is the turn's times fov / 360°. Rings are numbered in the order of the configured channels;
uniform patterns and presets list them from the lowest up (as Velodyne's ROS driver does).

In a rosette, azimuth and elevation follow two rates of a mirror instead, and every turn continues where the last one
ended: channel k of K looks at azimuth -2 pi f t and elevation middle + half sin(2 pi (g t + k / K)).
"""

from dataclasses import dataclass

import numpy as np

from simbev_ros.config.lidar import Lidar, Rosette
from simbev_ros.foundation.types import Float32Array, Float64Array, UInt16Array


@dataclass(frozen=True, slots=True)
class ScanPattern:
    """Rays of one turn, in firing order: column by column, within a column by ring. N is columns · channels.

    Attributes:
        directions: (N, 3) unit vectors, sensor frame.
        ring: (N,) channel of each ray.
        column_time_s: (C,) time of each column's first firing relative to the stamp, ascending.
        time_s: (N,) firing time of each ray relative to the stamp.
    """

    directions: Float32Array
    ring: UInt16Array
    column_time_s: Float64Array
    time_s: Float64Array

    @classmethod
    def from_lidar(cls, lidar: Lidar, turn_s: float, end_s: float = 0.0) -> "ScanPattern":
        """Create the pattern of a lidar that turns once in ``turn_s``; that of a rosette for a turn up to ``end_s``."""
        if lidar.rosette is not None:
            return cls._from_rosette(lidar, lidar.rosette, turn_s, end_s)
        elevation = np.radians(channel_elevations_deg(lidar))
        offset = np.radians(lidar.azimuth_offsets_deg or np.zeros(lidar.channels))
        field_of_view = np.radians(lidar.horizontal_fov_deg)
        columns = np.arange(lidar.columns)
        column_azimuth = field_of_view / 2.0 - field_of_view * (columns + 0.5) / lidar.columns
        if step := np.radians(lidar.azimuth_resolution_deg):
            column_azimuth = np.round(column_azimuth / step) * step
        delay_s = 1e-6 * np.array(lidar.channel_delays_us or [0.0] * lidar.channels)
        azimuth = column_azimuth[:, None] + offset - 2.0 * np.pi * delay_s / turn_s
        sweep_s = turn_s * lidar.horizontal_fov_deg / 360.0
        column_time_s = (columns + 1 - lidar.columns) / lidar.columns * sweep_s - delay_s.max()
        return cls._from_angles(azimuth, elevation, column_time_s, delay_s)

    @classmethod
    def _from_rosette(cls, lidar: Lidar, rosette: Rosette, turn_s: float, end_s: float) -> "ScanPattern":
        column_time_s = (np.arange(lidar.columns) + 1 - lidar.columns) / lidar.columns * turn_s
        at_s = (end_s + column_time_s)[:, None]
        phase = rosette.nods_hz * at_s + np.arange(lidar.channels) / lidar.channels
        low, high = np.radians([lidar.lower_fov_deg, lidar.upper_fov_deg])
        elevation = (low + high) / 2.0 + (high - low) / 2.0 * np.sin(2.0 * np.pi * phase)
        azimuth = np.broadcast_to(-2.0 * np.pi * rosette.turns_hz * at_s, elevation.shape)
        return cls._from_angles(azimuth, elevation, column_time_s, np.zeros(lidar.channels))

    @classmethod
    def _from_angles(
        cls, azimuth: Float64Array, elevation: Float64Array, column_time_s: Float64Array, delay_s: Float64Array
    ) -> "ScanPattern":
        """From (C, K) azimuths, elevations that broadcast to them, (C,) times of columns, (K,) delays of channels."""
        level = np.cos(elevation)
        upward = np.broadcast_to(np.sin(elevation), azimuth.shape)
        xyz = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), upward], axis=-1)
        columns, channels = azimuth.shape
        return cls(
            directions=xyz.reshape(-1, 3).astype(np.float32),
            ring=np.tile(np.arange(channels), columns).astype(np.uint16),
            column_time_s=column_time_s,
            time_s=(column_time_s[:, None] + delay_s).ravel(),
        )


def channel_elevations_deg(lidar: Lidar) -> Float64Array:
    """(channels,) elevations by ring, in degrees."""
    if lidar.elevations_deg is not None:
        return np.array(lidar.elevations_deg)
    return np.linspace(lidar.lower_fov_deg, lidar.upper_fov_deg, lidar.channels)
