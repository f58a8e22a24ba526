"""Scenes whose values contain their ticks, for tests of what a sheet shows at a time."""

from pathlib import Path

import numpy as np
from made_up_scene import made_up_spec
from ros_messages import image, odometry, point_cloud, string

from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.foundation.types import Float64Array
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import SCENE_ATTACHMENT
from simbev_ros.recording.qos import QosProfile
from simbev_ros.schema.boxes import BOX_DTYPE

BOXES, ODOMETRY, BEV = "boxes", "odom", "bev/labels"
_TYPES = {BOXES: "sensor_msgs/msg/PointCloud2", ODOMETRY: "nav_msgs/msg/Odometry"}


def rpy_of(tick: int) -> Float64Array:
    """Roll, pitch and yaw of the ego."""
    return np.array([0.02, -0.03, 0.1 * tick])


def write_scene(path: Path, ticks_of: dict[str, list[int]]) -> Scene:
    """A scene of 50 ticks with values at some of them, by key: ``BOXES``, ``ODOMETRY``, ``BEV`` or a camera's image."""
    cameras = dict.fromkeys(key.partition("/")[0] for key in ticks_of if key not in (BOXES, ODOMETRY, BEV))
    sensors = [{"type": "camera", "name": name, "width_px": 16, "height_px": 16} for name in cameras]
    spec = made_up_spec(sensors, ticks=50)
    with SceneBagWriter(path) as writer:
        writer.add_attachment(SCENE_ATTACHMENT, "application/json", spec.model_dump_json().encode())
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        writer.write("/words", spec.start_ns, string("nothing to see"))
        for key, ticks in ticks_of.items():
            topic = f"/ego/{key}" if key in (BOXES, ODOMETRY, BEV) else f"/ego/{key}/image_raw"
            writer.add_topic(topic, _TYPES.get(key, "sensor_msgs/msg/Image"), QosProfile())
            for tick in ticks:
                writer.write(topic, spec.stamp_ns(tick), _message(key, spec.stamp_ns(tick), tick))
        writer.finish({})
    return open_dataset(path).scenes[0]


def _message(key: str, stamp_ns: int, tick: int) -> bytes:
    if key == ODOMETRY:
        return odometry(stamp_ns, np.array([tick, 2, 3]), rpy_of(tick))
    if key == BOXES:
        box = np.zeros(1, BOX_DTYPE)
        box["x"] = tick
        return point_cloud(stamp_ns, box)
    if key == BEV:
        return image(stamp_ns, "mono16", np.full((4, 4), tick, np.uint16))
    return image(stamp_ns, "rgb8", np.full((2, 4, 3), tick, np.uint8))
