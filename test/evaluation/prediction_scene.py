"""A scene for tests of predictions, and a bag of it that contains only the ego's motion."""

from pathlib import Path

import numpy as np
from made_up_scene import made_up_spec
from ros_messages import odometry

from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.schema.scene.spec import SceneSpec

TICKS = 4
SENSORS = [
    {"type": "camera", "name": "cam_front", "pose": {"x_m": 1.0, "z_m": 2.0, "yaw_deg": 90.0}},
    {"type": "lidar", "name": "lidar", "pose": {"z_m": 1.8}},
]


def spec(number: int = 0) -> SceneSpec:
    return made_up_spec(SENSORS, number=number, ticks=TICKS)


def record(path: Path) -> Path:
    """Record the ego at x = tick, y = 2, z = 0.5, with a yaw of 0.1 times the tick."""
    scene = spec()
    with SceneBagWriter(path) as writer:
        writer.add_attachment("scene.json", "application/json", scene.model_dump_json().encode())
        writer.add_topic("/ego/odom", "nav_msgs/msg/Odometry", QosProfile())
        for tick in range(TICKS):
            turn, stamp_ns = np.array([0, 0, 0.1 * tick]), scene.stamp_ns(tick)
            writer.write("/ego/odom", stamp_ns, odometry(stamp_ns, np.array([tick, 2.0, 0.5]), turn))
        return writer.finish({"complete": "true", "ticks": str(TICKS)})
