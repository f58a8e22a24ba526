"""KITTI's layout for object detection: an image, a lidar cloud, a calibration and labels for each frame.

The layout is that of the devkit of KITTI's object benchmark. Here the rectified frame of all cameras is that of the one
exported camera, which is ``image_2``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from simbev_exporters.kitti.labels import label_lines
from simbev_exporters.labeled_images.layout import ImagePart, Layout, Sample
from simbev_exporters.recorded_sensors import recorded_lidar
from simbev_ros.dataset import Frame, Scene
from simbev_ros.export.sensor_data import points_at_stamp, rectify
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.foundation.geometry.transforms import inverse
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.recording.png import RowFilter, encode_png

_FOLDERS = {"train": "training", "val": "training", "test": "testing"}
"""Folder of each split."""

_SETS = {"train": ("train",), "val": ("val",), "trainval": ("train", "val"), "test": ("test",)}
"""Splits in each file of ``ImageSets``."""

_TICK_DIGITS = 4


@dataclass(frozen=True, kw_only=True)
class Kitti(Layout):
    """KITTI's layout. A frame's number is that of its scene times 10,000, plus its tick, with at least six digits."""

    name = "kitti"
    folders = ("training", "testing", "ImageSets")
    camera_option = "camera"
    left_out = "KITTI's layout has one camera"

    def keys(self, camera: str) -> tuple[str, ...]:
        """Keys that a frame needs for an image of a camera."""
        return (*super().keys(camera), "boxes", "odom")

    def stem(self, scene: Scene) -> str:
        """Number of the scene, with which the numbers of its frames begin."""
        return f"{scene.number:02d}"

    def patterns(self, stem: str) -> tuple[str, ...]:
        """Glob patterns of all files that a part can have."""
        return (f"t*ing/*/{stem}{'[0-9]' * _TICK_DIGITS}.*",)

    def cameras_of(self, scene: Scene) -> list[str]:
        """The camera that is chosen, or else looks most ahead."""
        names = super().cameras_of(scene)
        return sorted(names, key=lambda name: -scene.calibration[name].ego_from_sensor[0, 0])[:1]

    def images_of(self, scene: Scene) -> list[tuple[int, str]]:
        """Tick and camera of the images of a scene, in order of time."""
        _, cloud = _lidar(scene)
        if len(scene) > 10**_TICK_DIGITS:
            raise BagError(f"{scene.path}: {len(scene)} frames; numbers of frames allow up to {10**_TICK_DIGITS}")
        has_cloud = scene.has([cloud])
        images = [(tick, name) for tick, name in super().images_of(scene) if has_cloud[tick]]
        if not images:
            raise BagError(f"{scene.path}: no frame of {self.rate_hz:g} per second has both an image and {cloud}")
        return images

    def sample(self, frame: Frame, camera: str) -> Sample:
        """One frame; its fact is its number."""
        lidar, cloud = _lidar(frame.scene)
        known = frame.scene.calibration[camera]
        lines = label_lines(frame, camera, self.objects(frame, camera))
        folder, name = _FOLDERS[frame.scene.split], f"{self.stem(frame.scene)}{frame.tick:0{_TICK_DIGITS}d}"
        contents = {
            "image_2/{}.png": encode_png(rectify(frame[f"{camera}/rgb"], known.camera), RowFilter.UP),
            "velodyne/{}.bin": _points(frame, lidar, cloud),
            "calib/{}.txt": _calibration(frame.scene, camera, lidar),
            "label_2/{}.txt": "".join(lines).encode("ascii"),
        }
        files = {f"{folder}/{path.format(name)}": content for path, content in contents.items()}
        return Sample(files, len(lines), {"number": name})

    def finish(self, out: Path, parts: Sequence[ImagePart]) -> None:
        """Write the lists of the numbers of frames in ``ImageSets``."""
        numbers = {part.name: [facts["number"] for facts in part.finished_record()["facts"]] for part in parts}
        for name, splits in _SETS.items():
            listed = [number for part in parts if part.scene.split in splits for number in numbers[part.name]]
            write_whole(out / "ImageSets" / f"{name}.txt", "".join(f"{number}\n" for number in listed).encode())


def _lidar(scene: Scene) -> tuple[str, str]:
    """Name of the first lidar, and key of its cloud."""
    found = recorded_lidar(scene)
    if found is None:
        raise BagError(f"{scene.path}: it has no cloud of a lidar, which KITTI's layout needs")
    return found


def _points(frame: Frame, lidar: str, key: str) -> bytes:
    """(N, 4) float32 x, y, z in the lidar's frame, and intensity from 0 to 1; without it, cosine of the incidence."""
    cloud: Table = frame[key]
    intensity = cloud["intensity" if "intensity" in (cloud.dtype.names or ()) else "cos_angle"]
    points_m = points_at_stamp(frame, key, frame.scene.calibration[lidar])
    return np.column_stack([points_m, intensity]).astype("<f4").tobytes()


def _calibration(scene: Scene, camera: str, lidar: str) -> bytes:
    """Calibration file. All projections are of the one camera; the frame of the IMU is the ego's."""
    known, ego_from_lidar = scene.calibration[camera], scene.calibration[lidar].ego_from_sensor
    matrices: dict[str, Float64Array] = {
        **{f"P{number}": np.column_stack([known.intrinsics, np.zeros(3)]) for number in range(4)},
        "R0_rect": np.eye(3),
        "Tr_velo_to_cam": (inverse(known.ego_from_optical) @ ego_from_lidar)[:3],
        "Tr_imu_to_velo": inverse(ego_from_lidar)[:3],
    }
    return "".join(f"{n}: {' '.join(f'{v:.12e}' for v in m.ravel())}\n" for n, m in matrices.items()).encode("ascii")
