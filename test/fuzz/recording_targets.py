"""Targets of fuzzing that read recordings of real sensors in the layouts of others."""

import json
from pathlib import Path
from random import Random

import mutation
import numpy as np
from target import Target, folder, write_file

from simbev_ros.baselines.recordings.clouds import CLOUD_READERS, read_cloud
from simbev_ros.baselines.recordings.folder import SENSORS_FILE, folder_frames, read_poses
from simbev_ros.baselines.recordings.kitti import read_calibration, read_labels
from simbev_ros.baselines.recordings.model_inputs import ground_pose, view_frame
from simbev_ros.baselines.recordings.nuscenes import nuscenes_frames
from simbev_ros.baselines.recordings.recording import Labels, RecordedFrame
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.recording.image_codecs import encode_rgb

CALIBRATION = b"""\
P2: 700 0 600 45 0 700 170 0.2 0 0 1 0
R0_rect: 1 0 0 0 1 0 0 0 1
Tr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 -0.3
"""
CLOUD = np.column_stack([np.random.default_rng(3).uniform(-15, 15, (900, 2)), np.full((900, 3), -1.8)]).astype("<f4")


def _read_cloud(data: bytes) -> None:
    """Read a cloud: a line with the ending of its file, and then the file."""
    suffix, _, content = data.partition(b"\n")
    if suffix.decode("latin1") in CLOUD_READERS:
        points = read_cloud(write_file(f"clouds/a{suffix.decode()}", content))
        assert points.shape[1:] == (4,) and len(points) and np.isfinite(points).all()


def mutate_after_line(sample: bytes, rng: Random) -> bytes:
    """Mutate all but the first line."""
    line, _, content = sample.partition(b"\n")
    return line + b"\n" + mutation.mutate_bytes(content, rng)


def _read_text(data: bytes) -> None:
    """Read a file of poses, of a calibration, or of labels; a line says which."""
    kind, _, content = data.partition(b"\n")
    path = write_file("recorded/text.txt", content)
    if kind == b"poses":
        poses, stamps_ns = read_poses(path, 10.0)
        assert len(poses) == len(stamps_ns) and (np.diff(stamps_ns) >= 0).all()
    elif kind == b"calibration":
        assert all(np.isfinite(each).all() for each in read_calibration(path))
    elif kind == b"labels":
        _require_consistent(read_labels(path, write_file("recorded/calibration.txt", CALIBRATION)))


def _require_consistent(labels: Labels) -> None:
    assert all(np.isfinite(labels.boxes[name]).all() for name in ("x", "y", "z", "length", "width", "height", "yaw"))


def _look_at(frames: list[RecordedFrame]) -> None:
    """Read all of some frames."""
    ground = ground_pose(frames)
    for frame in frames[:3]:
        view = view_frame(frame, (0, 100_000_000), ground)
        assert view.points.shape[1:] == (4,)
        if frame.labels is not None:
            _require_consistent(frame.labels())


def _read_nuscenes(data: bytes) -> None:
    """Read all tables, which a mapping of their names holds, and the frames that they name."""
    tables = parse_json(data)
    if not isinstance(tables, dict):
        return
    root = _with_files("tables", "samples/cloud.bin", "samples/image.jpg")
    for path in root.glob("v/*"):
        path.unlink()
    for name, rows in tables.items():
        if name.isidentifier() and len(name) < 40:
            write_file(f"tables/v/{name}.json", json.dumps(rows).encode())
    _look_at(nuscenes_frames(root, "v"))


def _read_sensors(data: bytes) -> None:
    """Read a folder with a file that describes it."""
    root = _with_files("described_folder", "a.bin", "front/a.jpg")
    write_file(f"described_folder/{SENSORS_FILE}", data)
    write_file("described_folder/poses.txt", b"1 0 0 0 0 1 0 0 0 0 1 0\n")
    _look_at(folder_frames(root))


def _with_files(name: str, cloud: str, image: str) -> Path:
    """A folder with a cloud and an image."""
    write_file(f"{name}/{cloud}", CLOUD.tobytes())
    write_file(f"{name}/{image}", encode_rgb(np.full((24, 32, 3), 90, np.uint8)))
    return folder() / name


_INPUT = (InputError,)
RECORDING_TARGETS = (
    Target("cloud", _read_cloud, _INPUT, mutate_after_line),
    Target("recording_text", _read_text, _INPUT, mutate_after_line),
    Target("nuscenes_tables", _read_nuscenes, (InputError, ValueError), mutation.mutate_json, examples=40),
    Target("recorded_sensors", _read_sensors, _INPUT, mutation.mutate_yaml, examples=40),
)
"""Targets of recordings."""
