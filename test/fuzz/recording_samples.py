"""Valid samples of recordings of real sensors, of which ``samples.py`` writes the files."""

import io
import json
from collections.abc import Iterator

import numpy as np
from made_up_recording import tables
from recording_targets import CALIBRATION

POINTS = np.array([[1.0, 2.0, -1.5, 0.25], [4.0, -3.0, 0.5, 0.5]], np.float32)
_PCD = """\
# .PCD v0.7
VERSION 0.7
FIELDS x y z _ intensity
SIZE 4 4 4 1 4
TYPE F F F U F
COUNT 1 1 1 4 1
WIDTH 2
POINTS 2
DATA """
_PLY = """\
ply
format {}
element vertex 2
property double x
property double y
property double z
property uchar i
element face 0
property list uchar int vertex_indices
end_header
"""
_LABELS = (
    "Car 0.00 0 -1.67 657.39 190.13 700.07 223.39 1.41 1.58 4.36 3.18 2.27 34.38 -1.58\n"
    "DontCare -1 -1 -10 503.89 169.71 590.61 190.13 -1 -1 -1 -1000 -1000 -1000 -10\n"
)
_SENSORS = """\
lidar: {columns: 5, pose: {z_m: 1.8, pitch_deg: 1.5}, poses: poses.txt, rate_hz: 10}
cameras:
  front:
    {images: front, fx_px: 60, cx_px: 15.5, cy_px: 11, optical_from_lidar: [[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0]]}
"""


def clouds() -> Iterator[tuple[str, str, bytes]]:
    """Yield a name, an ending and a file for each form of a cloud, all with the same points."""
    yield "bin", ".bin", POINTS.tobytes()
    stream = io.BytesIO()
    np.save(stream, POINTS)
    yield "npy", ".npy", stream.getvalue()
    columns = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("pad", "u1", 4), ("i", "<f4")]
    rows = np.zeros(2, columns)
    for name, values in zip("xyzi", POINTS.T, strict=True):
        rows[name] = values
    yield "pcd", ".pcd", _PCD.encode() + b"binary\n" + rows.tobytes()
    lines = "".join(f"{x} {y} {z} 0 0 0 0 {i}\n" for x, y, z, i in POINTS)
    yield "pcd_text", ".pcd", f"{_PCD}ascii\n{lines}".encode()
    wide = np.zeros(2, [("x", ">f8"), ("y", ">f8"), ("z", ">f8"), ("i", "u1")])
    for name, values in zip("xyz", POINTS.T, strict=False):
        wide[name] = values
    wide["i"] = [1, 2]
    yield "ply", ".ply", _PLY.format("binary_big_endian 1.0").encode() + wide.tobytes()
    yield "ply_text", ".ply", (_PLY.format("ascii 1.0") + "1 2 -1.5 1\n4 -3 0.5 2\n").encode()


def recording_samples() -> Iterator[tuple[str, str, bytes]]:
    """Yield files of recordings."""
    yield from (("cloud", f"valid_{name}", f"{suffix}\n".encode() + data) for name, suffix, data in clouds())
    yield "recording_text", "valid_calibration", b"calibration\n" + CALIBRATION
    yield "recording_text", "valid_labels", b"labels\n" + _LABELS.encode()
    yield "recording_text", "valid_poses", b"poses\n1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 2 0 1 0 0 0 0 1 0\n"
    yield "recording_text", "valid_poses_with_stamps", b"poses\n# stamp\n1.5 0 0 0 0 0 0 1\n2.5 3 0 0 0 0 0.6 0.8\n"
    made = tables(1)
    for row in made["sample_data"]:
        row["filename"] = "samples/cloud.bin" if row["calibrated_sensor_token"] == "L" else "samples/image.jpg"
    yield "nuscenes_tables", "valid", json.dumps(made).encode()
    yield "recorded_sensors", "valid", _SENSORS.encode()
    yield "recorded_sensors", "valid_alone", b"lidar: {columns: 5}\n"
