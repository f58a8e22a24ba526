"""Which files the SimBEV layout has for a frame, and from what of ours each is made."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

from simbev_ros.config.lidar import Lidar
from simbev_ros.config.positioning import Gnss, Imu
from simbev_ros.config.sensor import Sensor
from simbev_ros.dataset import Frame, Scene
from simbev_ros.errors import BagError
from simbev_ros.export.simbev import encodings
from simbev_ros.export.simbev.boxes import box_file

CAMERAS = ("front_left", "front", "front_right", "back_left", "back", "back_right")
RADARS = ("left", "front", "right", "back")

S = TypeVar("S", bound=Sensor)


@dataclass(frozen=True, slots=True)
class Channel:
    """One file a frame.

    Attributes:
        name: Of the sensor or label, as the layout calls it.
        folder: Below the layout's root.
        extension: Of the files.
        keys: What of a frame it is made from; a frame without them has no such file.
        encode: Makes the file.
    """

    name: str
    folder: str
    extension: str
    keys: tuple[str, ...]
    encode: Callable[[Frame], bytes]

    def path(self, scene: int, frame: int) -> str:
        """Of a frame's file, below the layout's root."""
        return f"{self.folder}/SimBEV-scene-{scene:04d}-frame-{frame:04d}-{self.name}.{self.extension}"


def channels(scene: Scene) -> tuple[Channel, ...]:
    """All that can be made of a scene. Raises BagError if it was recorded by a version that did not say all of it."""
    known = set(scene.keys)
    wanted = (*_cameras(), *_others(scene), *_ground_truth(scene))
    return tuple(channel for channel in wanted if known.issuperset(channel.keys))


def left_out(scene: Scene) -> list[str]:
    """What the layout knows and a scene lacks, and what a scene has and the layout has no place for, a line each."""
    made = channels(scene)
    names = {channel.name for channel in made}
    missing = [name for name in _all_names() if name not in names]
    used = {key.partition("/")[0] for channel in made for key in channel.keys}
    others = [name for name in scene.calibration if name not in used]
    said = {"not recorded": missing, "the layout has no place for": others}
    return [f"{what}: {', '.join(found)}" for what, found in said.items() if found]


def lidar_of(scene: Scene) -> Lidar | None:
    """The lidar that counts: the first."""
    return _first(scene, Lidar)


def _all_names() -> Iterator[str]:
    for kind in ("RGB", "SEG", "IST", "DPT", "FLW"):
        yield from (f"{kind}-CAM_{name.upper()}" for name in CAMERAS)
    yield from ("LIDAR", "SEG-LIDAR", *(f"RAD_{name.upper()}" for name in RADARS), "GNSS", "IMU", "VOXEL-GRID")
    yield from ("GT_SEG", "GT_SEG_VIZ", "GT_DET", "HD_MAP")


def _sweep(name: str, extension: str, encode: Callable[..., bytes], *keys: str) -> Channel:
    """Files of a sensor, made by a function of what a frame has under some keys."""
    return Channel(name, f"sweeps/{name}", extension, keys, lambda frame: encode(*(frame[key] for key in keys)))


def _truth(name: str, folder: str, extension: str, encode: Callable[..., bytes], *keys: str) -> Channel:
    return replace(_sweep(name, extension, encode, *keys), folder=f"ground-truth/{folder}")


def _cameras() -> Iterator[Channel]:
    for place in CAMERAS:
        topic, name = f"cam_{place}", f"CAM_{place.upper()}"
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
    for place in RADARS:
        yield _sweep(f"RAD_{place.upper()}", "npz", encodings.radar_npz, f"radar_{place}/points")
    if gnss is not None:
        yield _sweep("GNSS", "bin", encodings.gnss_bin, f"{gnss.name}/fix")
    if imu is not None:
        yield _sweep("IMU", "bin", encodings.imu_bin, f"{imu.name}/data")
    occupancy = scene.spec.annotation.occupancy
    if occupancy is not None:
        encode = partial(encodings.voxel_npz, grid=occupancy.grid)
        yield _sweep("VOXEL-GRID", "npz", encode, "occupancy/points")


def _ground_truth(scene: Scene) -> Iterator[Channel]:
    yield _truth("GT_SEG", "seg", "npz", encodings.bev_npz, "bev/labels")
    yield _truth("GT_SEG_VIZ", "seg_viz", "jpg", encodings.bev_jpeg, "bev/labels")
    legend = scene.constants.get("world/legend")
    if legend is not None:
        if "signals" not in legend:
            raise BagError(f"{scene.path}: recorded by another version: its /world/legend has no signals")
        encode = partial(box_file, legend=legend)
        yield _truth("GT_DET", "det", "bin", encode, "boxes", "world/signals")
    yield _truth("HD_MAP", "hd_map", "json", encodings.hd_map_json, "hd_map")


def _first(scene: Scene, kind: type[S]) -> S | None:
    sensors = (calibration.sensor for calibration in scene.calibration.values())
    return next((sensor for sensor in sensors if isinstance(sensor, kind)), None)
