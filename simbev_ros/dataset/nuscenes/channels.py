"""Maps the sensors of a scene to nuScenes' channels: names, modalities and frames.

A scene enters; one ``Channel`` for each exported sensor leaves. Cameras have their optical frames; radars have x
forward, y left, z up, like ours. A lidar's frame is that of nuScenes' LIDAR_TOP, x right, y forward, z up, because
training code expects it; its points are rotated accordingly. The ego frame remains ours, on the ground below the
center of the ego's box, whereas nuScenes' is below the rear axle: the poses of the ego and of its sensors agree on it,
so world positions are the same, and boxes, grids and bags keep one frame.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, assert_never

import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.dataset import Scene
from simbev_ros.dataset.calibration import Calibration
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.schema.nuscenes import nuscenes_names

TOP_LIDAR = "LIDAR_TOP"
"""Channel from which the devkit takes a sample's boxes and its position on the map."""

SENSOR_FROM_LIDAR = np.array([[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Sensor frame (x forward, y left, z up) from nuScenes' lidar frame (x right, y forward, z up)."""

ChannelNames = Mapping[str, Sequence[str]]
"""Names of channels by the name of their sensor."""

NO_NAMES: ChannelNames = {}
_CHANNEL = re.compile(r"[A-Z][A-Z0-9_]*")

Modality = Literal["camera", "lidar", "radar"]
"""nuScenes' kinds of sensors."""

_Exported = Camera | Lidar | Radar
"""The sensors that have a modality; the layout has no files for others."""


@dataclass(frozen=True, eq=False, slots=True)
class Channel:
    """One exported sensor of a scene.

    Attributes:
        name: nuScenes' name of the channel, such as ``CAM_FRONT``.
        modality: nuScenes' kind of the sensor.
        key: Key of the sensor's data in frames.
        calibration: Calibration of the sensor.
        sector: Which part of a radar's field of view the channel has, counted from the left, and of how many.
    """

    name: str
    modality: Modality
    key: str
    calibration: Calibration
    sector: tuple[int, int] = (0, 1)

    @property
    def ego_from_channel(self) -> Float64Array:
        """(4, 4) pose of the frame in which nuScenes expects the sensor's data."""
        if self.modality == "camera":
            return self.calibration.ego_from_optical
        ego_from_sensor = self.calibration.ego_from_sensor
        return ego_from_sensor @ SENSOR_FROM_LIDAR if self.modality == "lidar" else ego_from_sensor


def channels_of(scene: Scene, names: ChannelNames = NO_NAMES) -> list[Channel]:
    """Channels of a scene, in the order of its rig: cameras with RGB images, lidars, radars.

    Names are those of the sensors in capitals, but one lidar is LIDAR_TOP: the one of that name, or else the first.
    The paper's radars have nuScenes' names, ``radar_channels`` in ``schema/nuscenes.yaml``, if these are free.
    If several bags of the scene have a sensor of one name, the first bag's sensor is used.

    Args:
        scene: The scene.
        names: Channels of cameras and radars that are not to have these names. The field of view of a radar with
            several channels is divided evenly among them, from the left to the right.

    Raises:
        InputError: Two sensors have the same channel.
    """
    own = {name: known for name, known in scene.calibration.items() if "@" not in name}
    defaults = {sensor: each for sensor, each in nuscenes_names()["radar_channels"].items() if sensor in own}
    taken = {name.upper() for name in own} | {channel for sensor in names for channel in names[sensor]}
    chosen = {sensor: each for sensor, each in defaults.items() if taken.isdisjoint(each)} | dict(names)
    channels = [channel for channel in _channels(own, chosen) if channel.key in scene.sources]
    if twice := [name for name, count in Counter(channel.name for channel in channels).items() if count > 1]:
        sensors = [channel.key.partition("/")[0] for channel in channels if channel.name == twice[0]]
        why = f"{scene.path}: {twice[0]} would be the channel of {' and of '.join(sensors)}"
        raise InputError(why, parameter="channel")
    return channels


def require_named_sensors(scene: Scene, names: ChannelNames) -> None:
    """Check the names of channels that a user gives to sensors.

    Raises:
        InputError: There is no such camera or radar, a name is not nuScenes' kind of name, a camera has several, or two
            sensors have the same.
    """
    sensors = {name: known.sensor for name, known in scene.calibration.items() if "@" not in name}
    allowed = [name for name, sensor in sensors.items() if isinstance(sensor, Camera | Radar)]
    for sensor, channels in names.items():
        problem = ""
        if sensor not in allowed:
            problem = f"{sensor!r} is not a camera or radar of {scene.path}; allowed: {', '.join(allowed)}"
        elif wrong := [channel for channel in channels if not _CHANNEL.fullmatch(channel)]:
            problem = f"{sensor}: {wrong[0]!r} must be capital letters, digits and '_', as in CAM_FRONT"
        elif isinstance(sensors[sensor], Camera) and len(channels) > 1:
            problem = f"{sensor}: a camera has one channel, not {len(channels)}"
        if problem:
            raise InputError(problem, parameter="channel")
    channels_of(scene, names)


def _channels(calibrations: Mapping[str, Calibration], names: ChannelNames) -> Iterator[Channel]:
    top = _top_lidar([name for name, known in calibrations.items() if isinstance(known.sensor, Lidar)])
    for name, calibration in calibrations.items():
        sensor = calibration.sensor
        if not isinstance(sensor, _Exported):
            continue
        match sensor:
            case Camera():
                yield Channel(names.get(name, [name.upper()])[0], "camera", f"{name}/rgb", calibration)
            case Lidar():
                key = f"{name}/points" if sensor.points else f"{name}/semantic_points"
                yield Channel(TOP_LIDAR if name == top else name.upper(), "lidar", key, calibration)
            case Radar():
                own = names.get(name, [name.upper()])
                for index, channel in enumerate(own):
                    yield Channel(channel, "radar", f"{name}/points", calibration, (index, len(own)))
            case _:
                assert_never(sensor)


def _top_lidar(names: Sequence[str]) -> str:
    return next((name for name in names if name.upper() == TOP_LIDAR), next(iter(names), ""))
