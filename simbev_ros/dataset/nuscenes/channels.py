"""Maps the sensors of a scene to nuScenes' channels: names, modalities and frames.

A scene enters; one ``Channel`` for each exported sensor leaves. Cameras have their optical frames; radars have x
forward, y left, z up, like ours. A lidar's frame is that of nuScenes' LIDAR_TOP, x right, y forward, z up, because
training code expects it; its points are rotated accordingly. The ego frame remains ours, on the ground below the
center of the ego's box, whereas nuScenes' is below the rear axle: the poses of the ego and of its sensors agree on it,
so world positions are the same, and boxes, grids and bags keep one frame.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, assert_never

import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.dataset import Scene
from simbev_ros.dataset.calibration import Calibration
from simbev_ros.foundation.types import Float64Array

TOP_LIDAR = "LIDAR_TOP"
"""Channel from which the devkit takes a sample's boxes and its position on the map."""

SENSOR_FROM_LIDAR = np.array([[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Sensor frame (x forward, y left, z up) from nuScenes' lidar frame (x right, y forward, z up)."""

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
    """

    name: str
    modality: Modality
    key: str
    calibration: Calibration

    @property
    def ego_from_channel(self) -> Float64Array:
        """(4, 4) pose of the frame in which nuScenes expects the sensor's data."""
        if self.modality == "camera":
            return self.calibration.ego_from_optical
        ego_from_sensor = self.calibration.ego_from_sensor
        return ego_from_sensor @ SENSOR_FROM_LIDAR if self.modality == "lidar" else ego_from_sensor


def channels_of(scene: Scene) -> list[Channel]:
    """Channels of a scene, in the order of its rig: cameras with RGB images, lidars, radars.

    Names are those of the sensors in capitals, but one lidar is LIDAR_TOP: the one of that name, or else the first.
    If several bags of the scene have a sensor of one name, the first bag's sensor is used.
    """
    own = {name: known for name, known in scene.calibration.items() if "@" not in name}
    return [channel for channel in _channels(own) if channel.key in scene.sources]


def _channels(calibrations: Mapping[str, Calibration]) -> Iterator[Channel]:
    top = _top_lidar([name for name, known in calibrations.items() if isinstance(known.sensor, Lidar)])
    for name, calibration in calibrations.items():
        sensor = calibration.sensor
        if not isinstance(sensor, _Exported):
            continue
        match sensor:
            case Camera():
                yield Channel(name.upper(), "camera", f"{name}/rgb", calibration)
            case Lidar():
                key = f"{name}/points" if sensor.points else f"{name}/semantic_points"
                yield Channel(TOP_LIDAR if name == top else name.upper(), "lidar", key, calibration)
            case Radar():
                yield Channel(name.upper(), "radar", f"{name}/points", calibration)
            case _:
                assert_never(sensor)


def _top_lidar(names: Sequence[str]) -> str:
    return next((name for name in names if name.upper() == TOP_LIDAR), next(iter(names), ""))
