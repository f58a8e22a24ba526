"""Samples of sensors in one form: those of a dataset of ours, and real ones in the layouts of public data sets."""

import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.dataset import Dataset
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.limits import MAX_IMAGE_SIDE_PX
from simbev_ros.foundation.types import AnyArray, Float32Array, Float64Array, Int64Array, UInt8Array
from simbev_ros.recording.image_codecs import decode_rgb
from simbev_ros.schema.points import radar_rcs_dbsm

_MAX_RING = 255
_EIGHT_BITS = 255.0
_MIN_RANGE_M, _MAX_RANGE_M = 0.5, 1000.0
_MAX_RCS_DBSM = 200.0
_MIN_BRIGHTNESSES = 64
_MIN_SIDE_PX = 16
_PNG_SIZE, _PNG_SIZE_AT = struct.Struct(">II"), 16  # width and height in the first chunk
_COLUMNS_KITTI, _COLUMNS_NUSCENES = 4, 5
_KEYS: dict[type, str] = {Lidar: "points", Camera: "rgb", Radar: "points"}


@dataclass(frozen=True, slots=True)
class LidarTurn:
    """One turn of a lidar.

    Attributes:
        xyz_m: (N, 3) points, sensor frame.
        intensity: (N,) 0 to 1.
        ring: (N,) channel of each point.
    """

    xyz_m: Float32Array
    intensity: Float32Array
    ring: Int64Array


@dataclass(frozen=True, slots=True)
class Photograph:
    """One image of a camera: ``rgb`` is (H, W, 3)."""

    rgb: UInt8Array


@dataclass(frozen=True, slots=True)
class RadarScan:
    """The targets of one scan: (N,) radar cross-sections."""

    rcs_dbsm: Float32Array | Float64Array


Sample = LidarTurn | Photograph | RadarScan


def samples_of_dataset(dataset: Dataset, max_samples: int) -> dict[str, list[Sample]]:
    """The samples of each sensor of a dataset, at most ``max_samples`` of each, evenly over all scenes."""
    found: dict[str, list[Sample]] = {}
    for scene in dataset.scenes:
        for name, calibration in scene.calibration.items():
            sensor = calibration.sensor
            key = f"{name}/{_KEYS.get(type(sensor))}"
            if not isinstance(sensor, Lidar | Camera | Radar) or key not in scene.sources:
                continue
            ticks = np.flatnonzero(scene.has([key]))
            share = -(-max_samples // len(dataset.scenes))
            chosen = ticks[np.unique(np.linspace(0, len(ticks) - 1, share).astype(int))] if len(ticks) else ticks
            there = found.setdefault(name, [])
            there += [sample_of(sensor, scene[int(tick)][key]) for tick in chosen[: max_samples - len(there)]]
    return found


def samples_of_folder(folder: Path, max_samples: int) -> dict[str, list[Sample]]:
    """Real samples in a folder and those below it, by the folder that they lie in; at most ``max_samples`` of each.

    Lidar: KITTI's .bin, nuScenes' .bin and .pcd.bin, Argoverse 2's .feather. Images: .jpg, .png. Radar: nuScenes' .pcd.

    Raises:
        InputError: The folder has no samples, or a file is none.
    """
    groups: dict[tuple[str, str], list[Path]] = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix in READERS and path.is_file():
            groups.setdefault((str(path.parent.relative_to(folder)), path.suffix), []).append(path)
    found: dict[str, list[Sample]] = {}
    for (place, suffix), paths in groups.items():
        step = max(1, len(paths) // max_samples)
        samples = list(islice(_read_files(paths[::step], READERS[suffix]), max_samples))
        if not _are_labels(samples[0]):
            found[f"{folder.resolve().name if place == '.' else place} ({suffix[1:]})"] = samples
    if not found:
        raise InputError(f"{folder}: has no samples; read are files that end in {', '.join(READERS)}")
    return found


def _are_labels(sample: Sample) -> bool:
    """Whether an image is not a photograph but has numbers of classes."""
    return isinstance(sample, Photograph) and len(np.unique(sample.rgb)) < _MIN_BRIGHTNESSES


def _read_files(paths: Sequence[Path], read: Callable[[Path], Sample]) -> Iterator[Sample]:
    for path in paths:
        with foreign_content(path):
            yield read(path)


def sample_of(sensor: Lidar | Camera | Radar, data: AnyArray) -> Sample:
    """The sample of what a sensor of ours measured: a cloud, a color image, or detections."""
    if isinstance(sensor, Camera):
        return Photograph(data)
    if isinstance(sensor, Radar):
        return RadarScan(radar_rcs_dbsm(data, sensor.reference_range_m))
    xyz_m = np.stack([data["x"], data["y"], data["z"]], axis=1)
    return LidarTurn(xyz_m, data["intensity"], data["ring"].astype(np.int64))


def _read_bin(path: Path) -> LidarTurn:
    """KITTI's four columns or nuScenes' five, of which the last is the channel; points without range are left out."""
    numbers = np.fromfile(path, np.float32)
    if len(numbers) % _COLUMNS_NUSCENES == 0:
        rows = numbers.reshape(-1, _COLUMNS_NUSCENES)
        ring = rows[:, 4]
        if len(rows) and np.all(ring == np.round(ring)) and ring.min() >= 0 and ring.max() <= _MAX_RING:
            return _turn(path, rows[:, :3], rows[:, 3] / np.float32(_EIGHT_BITS), rows[:, 4].astype(np.int64))
    if not len(numbers) or len(numbers) % _COLUMNS_KITTI:
        raise InputError(f"{path}: is not a cloud of KITTI (4 float32 a point) or nuScenes (5)")
    rows = numbers.reshape(-1, _COLUMNS_KITTI)
    return _turn(path, rows[:, :3], rows[:, 3], _rings_of_kitti(rows))


def _turn(path: Path, xyz_m: Float32Array, intensity: Float32Array, ring: Int64Array) -> LidarTurn:
    """The turn of the returns alone."""
    range_m = np.linalg.norm(xyz_m.astype(np.float64), axis=1)
    there = (range_m > _MIN_RANGE_M) & (range_m < _MAX_RANGE_M) & np.isfinite(intensity)
    if not there.any():
        raise InputError(f"{path}: has no points with ranges of {_MIN_RANGE_M} to {_MAX_RANGE_M} m")
    return LidarTurn(xyz_m[there], intensity[there], ring[there])


def _rings_of_kitti(rows: Float32Array) -> Int64Array:
    """KITTI lists channel after channel, the highest first, each counterclockwise from ahead."""
    azimuth = np.arctan2(rows[:, 1], rows[:, 0]) % (2.0 * np.pi)
    number = np.cumsum(np.diff(azimuth, prepend=azimuth[0]) < -np.pi)
    return (number.max() - number).astype(np.int64)


def _read_feather(path: Path) -> LidarTurn:
    import pyarrow.feather

    columns = pyarrow.feather.read_table(path, columns=["x", "y", "z", "intensity", "laser_number"])
    x, y, z, intensity, ring = (column.to_numpy() for column in columns.columns)
    xyz_m = np.stack([x, y, z], axis=1).astype(np.float32)
    return _turn(path, xyz_m, intensity.astype(np.float32) / np.float32(_EIGHT_BITS), ring.astype(np.int64))


def _read_jpeg(path: Path) -> Photograph:
    return _photograph(path, decode_rgb(path.read_bytes()))


def _read_png(path: Path) -> Photograph:
    import cv2

    data = path.read_bytes()
    if len(data) < _PNG_SIZE_AT + _PNG_SIZE.size or max(_PNG_SIZE.unpack_from(data, _PNG_SIZE_AT)) > MAX_IMAGE_SIDE_PX:
        raise InputError(f"{path}: is not a PNG image of at most {MAX_IMAGE_SIDE_PX} pixels a side")
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise InputError(f"{path}: cannot be read as an image")
    return _photograph(path, np.ascontiguousarray(image[..., ::-1], np.uint8))


def _photograph(path: Path, rgb: UInt8Array) -> Photograph:
    height_px, width_px = rgb.shape[:2]
    if min(height_px, width_px) < _MIN_SIDE_PX:
        raise InputError(f"{path}: {width_px} x {height_px} pixels are too few; at least {_MIN_SIDE_PX} each way")
    return Photograph(rgb)


def _read_pcd(path: Path) -> RadarScan:
    """A binary point cloud of the Point Cloud Library, with the columns of nuScenes' radars."""
    head, _, data = path.read_bytes().partition(b"DATA binary\n")
    lines = dict(line.split(" ", 1) for line in head.decode("ascii").splitlines() if " " in line)
    names, sizes, kinds = (lines[key].split() for key in ("FIELDS", "SIZE", "TYPE"))
    codes = {"F": "f", "I": "i", "U": "u"}
    dtype = np.dtype([(n, f"<{codes[k]}{s}") for n, s, k in zip(names, sizes, kinds, strict=True)])
    rcs = np.frombuffer(data, dtype, count=int(lines["POINTS"]))["rcs"].astype(np.float32)
    return RadarScan(rcs[np.abs(rcs) < _MAX_RCS_DBSM])


READERS: dict[str, Callable[[Path], Sample]] = {
    ".bin": _read_bin,
    ".feather": _read_feather,
    ".jpg": _read_jpeg,
    ".png": _read_png,
    ".pcd": _read_pcd,
}
"""How to read a file by its ending."""
