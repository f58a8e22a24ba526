"""Synthetic input for timing the recorder: a scene with six cameras of 1600x900 and a lidar, and their messages."""

from collections.abc import Callable, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
from rosbags.typesys import Stores, get_typestore

from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import MapScenes, Timing
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.observer import SILENT, ProductionObserver
from simbev_ros.ros.msgs.topics import manifest
from simbev_ros.schema.scene.spec import SceneSpec

Images = Literal["raw", "compressed"]

_TYPES = get_typestore(Stores.ROS2_JAZZY)
_TICK_S = 0.05
_WIDTH_PX, _HEIGHT_PX = 1600, 900
_ENCODED_BYTES = {"rgb": 330_000, "semantic": 45_000, "instance": 60_000, "depth": 800_000, "flow": 1_500_000}
"""Size of a JPEG or PNG file of 1600x900 pixels, by modality."""
_LIDAR_RAYS = 128 * 2048


class Message(NamedTuple):
    """A message that is recorded at every tick: its type, and its bytes, which begin with a header."""

    type_name: str
    data: bytes


def recorded_scene(ticks: int, observer: ProductionObserver = SILENT) -> SceneSpec:
    """A scene with the paper's rig on an empty map."""
    paper = load_scenario("paper")
    alone = {"vehicles": 1, "pedestrians": 0, "spawn_radius_m": 100.0}
    shortened = {
        "time": Timing(tick_s=_TICK_S, warm_up_s=1.0, duration_s=ticks * _TICK_S),
        "scenes": (MapScenes(map="Blocks", train=1),),
        "traffic": paper.traffic.model_copy(update=alone),
    }
    return draw_scenes(paper.model_copy(update=shortened), observer)[0]


def recorded_tick(spec: SceneSpec, images: Images) -> dict[str, Message]:
    """Messages of one tick by topic: raw color images or all modalities compressed, camera infos and a point cloud."""
    rng = np.random.default_rng(0)
    messages = {}
    for topic in manifest(spec, compressed_images=images == "compressed"):
        sensor, name = topic.name.split("/")[2:4] if topic.sensor else ("", "")
        is_read = name == "points" if sensor == "lidar" else images == "compressed" or name == "rgb"
        if is_read and sensor.startswith(("cam_", "lidar")):
            messages[topic.name] = _message(topic.type, _MAKERS[topic.type](name, rng))
    return messages


def _raw_image(_modality: str, rng: np.random.Generator) -> Mapping[str, Any]:
    """A smooth image with noise."""
    row, column = np.mgrid[:_HEIGHT_PX, :_WIDTH_PX]
    smooth = 128 + 90 * np.sin(row / 170) * np.cos(column / 210)
    image = smooth[..., None] + rng.integers(-2, 3, (_HEIGHT_PX, _WIDTH_PX, 3))
    shape = {"height": _HEIGHT_PX, "width": _WIDTH_PX, "encoding": "rgb8", "is_bigendian": 0, "step": 3 * _WIDTH_PX}
    return {**shape, "data": image.astype(np.uint8).ravel()}


def _compressed_image(modality: str, rng: np.random.Generator) -> Mapping[str, Any]:
    """Random bytes, which zstd cannot compress, like those of an encoded image."""
    return {"format": "png", "data": _bytes(rng, _ENCODED_BYTES[modality])}


def _camera_info(_modality: str, rng: np.random.Generator) -> Mapping[str, Any]:
    matrices = {"d": np.zeros(5), "k": np.zeros(9), "r": np.zeros(9), "p": np.zeros(12)}
    region = _TYPES.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    shape = {"height": _HEIGHT_PX, "width": _WIDTH_PX, "distortion_model": "plumb_bob"}
    return {**shape, **matrices, "binning_x": 0, "binning_y": 0, "roi": region}


def _cloud(_modality: str, rng: np.random.Generator) -> Mapping[str, Any]:
    """One revolution of a lidar: x y z intensity float32, ring uint16, time float32."""
    azimuth = np.linspace(0, 2 * np.pi, _LIDAR_RAYS)
    range_m = 30 + 10 * np.sin(9 * azimuth) + rng.normal(0, 0.02, _LIDAR_RAYS)
    table = np.zeros(_LIDAR_RAYS, [("xyzi", "<f4", 4), ("ring", "<u2"), ("time", "<f4")])
    table["xyzi"] = np.stack([range_m * np.cos(azimuth), range_m * np.sin(azimuth), range_m / 9, 1 / range_m], axis=1)
    table["ring"], table["time"] = np.arange(_LIDAR_RAYS) % 128, azimuth
    data, step = np.frombuffer(table.tobytes(), np.uint8), table.itemsize
    shape = {"height": 1, "width": len(table), "fields": [], "point_step": step, "row_step": len(data)}
    return {**shape, "data": data, "is_bigendian": False, "is_dense": True}


_MAKERS: Mapping[str, Callable[[str, np.random.Generator], Mapping[str, Any]]] = {
    "sensor_msgs/msg/Image": _raw_image,
    "sensor_msgs/msg/CompressedImage": _compressed_image,
    "sensor_msgs/msg/CameraInfo": _camera_info,
    "sensor_msgs/msg/PointCloud2": _cloud,
}


def _bytes(rng: np.random.Generator, count: int) -> UInt8Array:
    return rng.integers(0, 256, count, np.uint8)


def _message(type_name: str, fields: Mapping[str, Any]) -> Message:
    types = _TYPES.types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "ego")
    return Message(type_name, bytes(_TYPES.serialize_cdr(types[type_name](header=header, **fields), type_name)))
