"""A scene for tests of predictions, and a bag of it that contains only the ego's motion."""

from pathlib import Path

import numpy as np
from ros_messages import odometry
from scene_edits import ego

from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.weather import Weather

TICKS = 4
SENSORS = (
    {"type": "camera", "name": "cam_front", "pose": {"x_m": 1.0, "z_m": 2.0, "yaw_deg": 90.0}},
    {"type": "lidar", "name": "lidar", "pose": {"z_m": 1.8}},
)
EGO = {"blueprint": "vehicle.sedan", "color": 0, "start": {"lane": "a", "s_m": 0}, "speed_factor": 1, "min_gap_m": 1}


def spec(number: int = 0) -> SceneSpec:
    return SceneSpec.model_validate(
        {
            "number": number,
            "split": "train",
            "seed": number,
            "map": {"name": "Blocks"},
            "tick_ns": 50_000_000,
            "warm_up_ticks": 1,
            "ticks": TICKS,
            "weather": dict.fromkeys(Weather.model_fields, 1.0),
            "agents": [ego(SENSORS)],
            "vehicles": [EGO],
            "pedestrians": [],
            "green_time_s": [],
        }
    )


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
