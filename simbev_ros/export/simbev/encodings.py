"""Encodes images, point clouds, measurements and grids as the files of the SimBEV layout.

Arrays as ``simbev_ros.dataset`` reads them enter; the bytes of files leave.
"""

import io
import json
import pickle
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from simbev_ros.export.simbev.zip_file import zip_of_one_file
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_quaternion
from simbev_ros.foundation.geometry.voxel_grid import VoxelGrid
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, Float32Array, Table, UInt8Array, UInt16Array
from simbev_ros.recording.image_codecs import encode_rgb
from simbev_ros.recording.png import RowFilter, encode_png
from simbev_ros.schema.palette import bev_color, semantic_color
from simbev_ros.schema.voxels import dense_tags

_JPEG_QUALITY = 80
_PICKLE_PROTOCOL = 3  # of NumPy 1
_MAX_DEPTH_M = 1000.0
_MAX_CODE = (1 << 24) - 1
_EGO_HALF_LENGTH_M, _EGO_HALF_WIDTH_M = 2.44, 1.04

SEMANTIC_LIDAR_DTYPE = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("CosAngle", "<f4"), ("ObjIdx", "<u4"), ("ObjTag", "<u4")]
)
"""One point of a semantic lidar, with CARLA's names of the columns."""


def jpeg(image: UInt8Array) -> bytes:
    """JPEG file of an (H, W, 3) uint8 RGB image."""
    return encode_rgb(image, _JPEG_QUALITY)


def semantic_png(tags: UInt8Array) -> bytes:
    """PNG file of (H, W) semantic tags, in CARLA's colors."""
    return encode_png(semantic_color(tags), RowFilter.NONE)


def instance_png(tags: UInt8Array, ids: UInt16Array) -> bytes:
    """PNG file of (H, W) tags and actor ids: red is the tag, green the low and blue the high byte of the id."""
    low, high = (ids & 255).astype(np.uint8), (ids >> 8).astype(np.uint8)
    return encode_png(np.stack([tags, low, high], axis=2), RowFilter.NONE)


def depth_png(depth_m: Float32Array) -> bytes:
    """PNG file of (H, W) depth: 1000 m in 2²⁴ - 1 steps, red the lowest byte; sky and larger depths are at 1000 m."""
    share = np.clip(depth_m.astype(np.float64) / _MAX_DEPTH_M, 0.0, 1.0)
    code = np.rint(share * _MAX_CODE).astype("<u4")
    return encode_png(code.view(np.uint8).reshape(*code.shape, 4)[..., :3], RowFilter.UP)


def npz(array: AnyArray) -> bytes:
    """NPZ file of one array under the key ``data``; the same array gives the same bytes."""
    return zip_of_one_file("data.npy", npy(array))


def npy(array: AnyArray) -> bytes:
    """NPY file of one array of numbers."""
    file = io.BytesIO()
    np.save(file, array, allow_pickle=False)
    return file.getvalue()


def npy_of_records(records: Sequence[Mapping[str, Any]]) -> bytes:
    """NPY file of an (N,) array of dictionaries, which NumPy 1 and 2 load with ``allow_pickle=True``.

    ``numpy.save`` would name functions of ``numpy._core`` in the pickle, which NumPy before 1.26 does not have.
    """
    file = io.BytesIO()
    header = {"descr": "|O", "fortran_order": False, "shape": (len(records),)}
    np.lib.format.write_array_header_1_0(file, header)
    array = np.empty(len(records), object)
    array[:] = records
    _PortablePickler(file, _PICKLE_PROTOCOL).dump(array)
    return file.getvalue()


class _PortablePickler(pickle.Pickler):
    """Pickles arrays as calls of ``numpy.array``, a name that no release of NumPy has moved."""

    def reducer_override(self, value: Any) -> Any:
        """How an array is made again from plain values; other objects are pickled as usual."""
        return (np.array, (value.tolist(), value.dtype.str)) if isinstance(value, np.ndarray) else NotImplemented


def lidar_npz(cloud: Table) -> bytes:
    """NPZ file of (n, 3) points of a cloud, sensor frame, without those on the ego itself."""
    points = np.stack([cloud["x"], cloud["y"], cloud["z"]], axis=1)
    on_ego = (np.abs(points[:, 0]) <= _EGO_HALF_LENGTH_M) & (np.abs(points[:, 1]) <= _EGO_HALF_WIDTH_M)
    return npz(points[~on_ego])


def semantic_lidar_npz(cloud: Table) -> bytes:
    """NPZ file of (n,) ``SEMANTIC_LIDAR_DTYPE`` of a semantic cloud, sensor frame."""
    points = np.empty(len(cloud), SEMANTIC_LIDAR_DTYPE)
    sources = ("x", "y", "z", "cos_angle", "object_id", "tag")
    for name, source in zip(SEMANTIC_LIDAR_DTYPE.names or (), sources, strict=True):
        points[name] = cloud[source]
    return npz(points)


def radar_npz(cloud: Table) -> bytes:
    """NPZ file of (n, 4) depth m, altitude rad, azimuth rad counterclockwise, velocity m/s, positive if receding."""
    return npz(np.stack([cloud[name] for name in ("range", "elevation", "azimuth", "doppler_velocity")], axis=1))


def voxel_npz(rows: Table, grid: VoxelGrid) -> bytes:
    """NPZ file of an (x, y, z) grid of semantic tags, 0 where empty, from the rows of occupied voxels."""
    return npz(dense_tags(rows, grid))


def gnss_bin(fixes: Table) -> bytes:
    """NPY file of (3,) latitude °, longitude °, altitude m of the last fix."""
    return npy(np.array([fixes[-1][name] for name in ("latitude_deg", "longitude_deg", "altitude_m")], np.float64))


def imu_bin(rows: Table) -> bytes:
    """NPY file of (7,) values of the last measurement: acceleration m/s², angular rate rad/s, compass rad.

    Acceleration and angular rate are in the sensor's frame. The compass is measured clockwise from the map's y axis,
    which is north unless the map says otherwise, in [0, 2π).
    """
    row = rows[-1]
    forward = matrices_from_xyz_quaternion(np.zeros(3), row["orientation_xyzw"])[:3, 0]
    compass_rad = np.arctan2(forward[0], forward[1]) % (2.0 * np.pi)
    return npy(np.array([*row["acceleration_mps2"], *row["angular_velocity_radps"], compass_rad], np.float64))


def bev_npz(labels: UInt16Array) -> bytes:
    """NPZ file of (classes, d, d) bool masks of a grid of labels."""
    bits = 1 << np.arange(len(BEV_CLASSES), dtype=np.uint16)
    return npz(labels & bits[:, None, None] != 0)


def bev_jpeg(labels: UInt16Array) -> bytes:
    """JPEG file of a grid of labels in colors."""
    return jpeg(bev_color(labels))


def hd_map_json(record: dict[str, Any]) -> bytes:
    """JSON file of the record of the lane under the ego, without its stamp."""
    return json.dumps({name: value for name, value in record.items() if name != "stamp_ns"}).encode()
