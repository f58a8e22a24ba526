"""Writes point clouds as Open3D wrote those of OPV2V: PCD 0.7 in ASCII, with the intensity in the color's red."""

from functools import lru_cache

import numpy as np

from simbev_ros.foundation.types import AnyArray, Float64Array

_MAX_INTENSITY = 255
_RED_BITS = 16


def pcd_file(points_m: Float64Array, intensity: AnyArray) -> bytes:
    """PCD file of a cloud.

    The fourth field is a color as PCL packs it, ``0x00rrggbb`` in the bits of a float, of which red is the intensity.

    Args:
        points_m: (N, 3) points, in the frame of the file.
        intensity: (N,) intensities from 0 to 1, which are rounded to 8 bits.
    """
    red = np.rint(np.clip(intensity, 0.0, 1.0) * _MAX_INTENSITY).astype(np.int64)
    colors = _colors()
    values: list[float | str] = [0.0] * (4 * len(points_m))
    for axis in range(3):
        values[axis::4] = points_m[:, axis].tolist()
    values[3::4] = [colors[each] for each in red.tolist()]
    return _head(len(points_m)) + ("%.5f %.5f %.5f %s\n" * len(points_m) % tuple(values)).encode("ascii")


@lru_cache(maxsize=1)
def _colors() -> list[str]:
    """The packed color of each red from 0 to 255, as text."""
    packed = (np.arange(_MAX_INTENSITY + 1, dtype=np.uint32) << _RED_BITS).view(np.float32)
    return [f"{float(color):.9g}" for color in packed]


def _head(count: int) -> bytes:
    lines = (
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        "FIELDS x y z rgb",
        "SIZE 4 4 4 4",
        "TYPE F F F F",
        "COUNT 1 1 1 1",
        f"WIDTH {count}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {count}",
        "DATA ascii\n",
    )
    return "\n".join(lines).encode("ascii")
