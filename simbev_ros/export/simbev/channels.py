"""Defines the files that the SimBEV layout has for a frame, and the topics and encoding from which each is made.

A scene enters; its ``Channel``s leave, one for each sensor or label that the layout knows and the scene has.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeVar

from simbev_ros.config.lidar import Lidar
from simbev_ros.config.positioning import Gnss, Imu
from simbev_ros.config.sensor import Sensor
from simbev_ros.dataset import Frame, Scene
from simbev_ros.export.simbev import encodings
from simbev_ros.export.simbev.boxes import box_file
from simbev_ros.export.simbev.voxels import KEY as VOXELS
from simbev_ros.export.simbev.voxels import voxel_rows
from simbev_ros.foundation.errors import BagError, foreign_content
from simbev_ros.foundation.geometry.voxel_grid import VoxelGrid
from simbev_ros.foundation.types import Table

CAMERAS = ("front_left", "front", "front_right", "back_left", "back", "back_right")
"""Names of the layout's cameras; in rigs they begin with ``cam_``."""

RADARS = ("left", "front", "right", "back")
"""Names of the layout's radars; in rigs they begin with ``radar_``."""

S = TypeVar("S", bound=Sensor)


@dataclass(frozen=True, slots=True)
class Channel:
    """A sensor or label of the layout, which has one file for each frame.

    Attributes:
        name: The layout's name of the sensor or label.
        folder: Folder of the files, relative to the layout's root.
        extension: Extension of the files.
        keys: Keys of a frame from which its file is made; a frame that lacks one of them has no such file.
        encode: Makes the content of a frame's file; None: there is none.
    """

    name: str
    folder: str
    extension: str
    keys: tuple[str, ...]
    encode: Callable[[Frame], bytes | None]

    def path(self, scene: int, frame: int) -> str:
        """Path of a frame's file, relative to the layout's root."""
        return f"{self.folder}/SimBEV-scene-{scene:04d}-frame-{frame:04d}-{self.name}.{self.extension}"


def channels(scene: Scene) -> tuple[Channel, ...]:
    """All channels that can be made from a scene.

    Raises:
        BagError: The scene was recorded by another version, with a legend without signals.
    """
    known = set(scene.keys)
    wanted = (*_cameras(), *_others(scene), *_ground_truth(scene))
    return tuple(channel for channel in wanted if known.issuperset(channel.keys))


def left_out(scene: Scene) -> list[str]:
    """Lines of text that name the layout's channels that a scene lacks, and its sensors that the layout lacks."""
    made = channels(scene)
    names = {channel.name for channel in made}
    missing = [name for name in _all_names() if name not in names]
    used = {key.partition("/")[0] for channel in made for key in channel.keys}
    others = [name for name in scene.calibration if name not in used]
    names_by_reason = {"not recorded": missing, "the layout has no place for": others}
    return [f"{reason}: {', '.join(found)}" for reason, found in names_by_reason.items() if found]


def lidar_of(scene: Scene) -> Lidar | None:
    """The lidar that is exported, the first of the rig, or None."""
    return _first(scene, Lidar)


def _all_names() -> Iterator[str]:
    for kind in ("RGB", "SEG", "IST", "DPT", "FLW"):
        yield from (f"{kind}-CAM_{name.upper()}" for name in CAMERAS)
    yield from ("LIDAR", "SEG-LIDAR", *(f"RAD_{name.upper()}" for name in RADARS), "GNSS", "IMU", "VOXEL-GRID")
    yield from ("GT_SEG", "GT_SEG_VIZ", "GT_DET", "HD_MAP")


def _sweep(name: str, extension: str, encode: Callable[..., bytes], *keys: str) -> Channel:
    """Channel of a sensor; a function makes its files from a frame's values of some keys."""
    return Channel(name, f"sweeps/{name}", extension, keys, lambda frame: encode(*(frame[key] for key in keys)))


def _truth(name: str, folder: str, extension: str, encode: Callable[..., bytes], *keys: str) -> Channel:
    return replace(_sweep(name, extension, encode, *keys), folder=f"ground-truth/{folder}")


def _cameras() -> Iterator[Channel]:
    for position in CAMERAS:
        topic, name = f"cam_{position}", f"CAM_{position.upper()}"
        yield _sweep(f"RGB-{name}", "jpg", encodings.jpeg, f"{topic}/rgb")
        yield _sweep(f"SEG-{name}", "png", encodings.semantic_png, f"{topic}/semantic")
        yield _sweep(f"IST-{name}", "png", encodings.instance_png, f"{topic}/semantic", f"{topic}/instance")
        yield _sweep(f"DPT-{name}", "png", encodings.depth_png, f"{topic}/depth")
        yield _sweep(f"FLW-{name}", "npz", encodings.npz, f"{topic}/flow")


def _others(scene: Scene) -> Iterator[Channel]:
    lidar, gnss, imu = lidar_of(scene), _first(scene, Gnss), _first(scene, Imu)
    if lidar is not None:
        yield _sweep("LIDAR", "npz", encodings.lidar_npz, f"{lidar.name}/points")
        yield _sweep("SEG-LIDAR", "npz", encodings.semantic_lidar_npz, f"{lidar.name}/semantic_points")
    for position in RADARS:
        yield _sweep(f"RAD_{position.upper()}", "npz", encodings.radar_npz, f"radar_{position}/points")
    if gnss is not None:
        yield _sweep("GNSS", "bin", encodings.gnss_bin, f"{gnss.name}/fix")
    if imu is not None:
        yield _sweep("IMU", "bin", encodings.imu_bin, f"{imu.name}/data")
    occupancy = scene.view.annotation.occupancy
    if occupancy is not None and VOXELS in scene.sources:
        yield Channel("VOXEL-GRID", "sweeps/VOXEL-GRID", "npz", (), partial(_voxels, grid=occupancy.grid))


def _voxels(frame: Frame, grid: VoxelGrid) -> bytes | None:
    rows = voxel_rows(frame)
    return None if rows is None else encodings.voxel_npz(rows, grid)


def _boxes(boxes: Table, signals: Table, legend: Mapping[str, Any], place: str) -> bytes:
    with foreign_content(place):
        return box_file(boxes, signals, legend)


def _ground_truth(scene: Scene) -> Iterator[Channel]:
    yield _truth("GT_SEG", "seg", "npz", encodings.bev_npz, "bev/labels")
    yield _truth("GT_SEG_VIZ", "seg_viz", "jpg", encodings.bev_jpeg, "bev/labels")
    legend = scene.constants.get("world/legend")
    if legend is not None:
        if "signals" not in legend:
            raise BagError(f"{scene.path}: recorded by another version: its /world/legend has no signals")
        encode = partial(_boxes, legend=legend, place=f"{scene.path}: /world/legend")
        yield _truth("GT_DET", "det", "bin", encode, "boxes", "world/signals")
    yield _truth("HD_MAP", "hd_map", "json", encodings.hd_map_json, "hd_map")


def _first(scene: Scene, kind: type[S]) -> S | None:
    sensors = (calibration.sensor for calibration in scene.calibration.values())
    return next((sensor for sensor in sensors if isinstance(sensor, kind)), None)
