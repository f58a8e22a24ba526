"""A dataset of two small scenes with hand-made ground truth: moving boxes, grids, and changing weather."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from ros_messages import image, odometry, point_cloud
from scene_edits import ego

from simbev_ros.evaluation.metrics.boxes import Boxes, Predictions, boxes_from_tables
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, Table
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.schema.boxes import blank_boxes
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.weather import Weather

TICKS, CELLS = 10, 20
NAMES = ("Blocks-0000", "Blocks-0001")
EGO = {"blueprint": "vehicle.sedan", "color": 0, "start": {"lane": "a", "s_m": 0}, "speed_factor": 1, "min_gap_m": 1}
SENSORS = ({"type": "lidar", "name": "lidar", "pose": {"z_m": 1.8}},)
CLEAR_DAY = {**dict.fromkeys(Weather.model_fields, 0.0), "sun_altitude_deg": 45.0}
RAINY_NIGHT = {**CLEAR_DAY, "sun_altitude_deg": -45.0, "precipitation": 90.0}
GRID = {"rows": CELLS, "columns": CELLS, "cell_m": 4.0}
ROAD, CAR = BEV_CLASSES.index("road"), BEV_CLASSES.index("car")


def spec(number: int) -> SceneSpec:
    """The second scene goes from a clear day to a rainy night: 4 ticks of day, 2 of twilight, 4 of night."""
    return SceneSpec.model_validate(
        {
            "number": number,
            "split": "val",
            "seed": number,
            "map": {"name": "Blocks"},
            "tick_ns": 50_000_000,
            "warm_up_ticks": 1,
            "ticks": TICKS,
            "weather": CLEAR_DAY,
            "final_weather": RAINY_NIGHT if number else None,
            "agents": [ego(SENSORS, {"bev": GRID})],
            "vehicles": [EGO],
            "pedestrians": [],
            "green_time_s": [],
        }
    )


def ego_m(tick: int) -> AnyArray:
    return np.array([float(tick), 2.0, 0.0])


def boxes(tick: int) -> Table:
    """A near car, a far one without points, and a pedestrian that walks with the ego; distances from the ego."""
    table = blank_boxes(3)
    table["class"] = [BOX_CLASSES.index(name) for name in ("car", "car", "pedestrian")]
    table["id"], table["yaw"] = [5, 6, 7], [0.0, 1.0, 2.0]
    table["x"], table["y"], table["z"] = [10.0 + tick, 70.0 + tick, -30.0 + tick], [2.0, 10.0, 2.0], 0.75
    table["length"], table["width"], table["height"] = [4.0, 4.0, 0.6], [2.0, 2.0, 0.5], [1.5, 1.5, 1.8]
    table["vx"] = 20.0
    table["distance"] = np.hypot(table["x"] - tick, table["y"] - 2.0)
    table["visibility"], table["lidar_points"], table["difficulty"] = [1.0, 0.0, 0.5], [40, 0, 3], [0, 2, 1]
    return table


def labels(tick: int) -> AnyArray:
    """BEV labels: road ahead, and a nearby car of two cells, of three at even ticks."""
    cells = np.zeros((CELLS, CELLS), np.uint16)
    cells[:10] = 1 << ROAD
    cells[8, 9:11] |= 1 << CAR
    cells[9, 9] |= (tick % 2 == 0) << CAR
    return cells


def scores(tick: int) -> AnyArray:
    """The ground truth as scores."""
    return np.stack([(labels(tick) >> k) & 1 for k in range(len(BEV_CLASSES))]).astype(np.uint8) * 255


def record(dataset: Path, without: str = "") -> Path:
    """The dataset; of the topic ``without`` each second message is left out, and of scene 0 all."""
    for number, name in enumerate(NAMES):
        scene = spec(number)
        with SceneBagWriter(dataset / "scenes" / "val" / name) as writer:
            writer.add_attachment("scene.json", "application/json", scene.model_dump_json().encode())
            known = set()
            for tick in range(TICKS):
                for topic, type_name, payload in messages(scene.stamp_ns(tick), tick):
                    if topic == without and (number == 0 or tick % 2):
                        continue
                    if topic not in known:
                        writer.add_topic(topic, type_name, QosProfile())
                        known.add(topic)
                    writer.write(topic, scene.stamp_ns(tick), payload)
            writer.finish({"complete": "true", "ticks": str(TICKS)})
    return dataset


def messages(stamp_ns: int, tick: int) -> list[tuple[str, str, bytes]]:
    return [
        ("/ego/odom", "nav_msgs/msg/Odometry", odometry(stamp_ns, ego_m(tick), np.zeros(3))),
        ("/ego/boxes", "sensor_msgs/msg/PointCloud2", point_cloud(stamp_ns, boxes(tick))),
        ("/ego/bev/labels", "sensor_msgs/msg/Image", image(stamp_ns, "mono16", labels(tick))),
    ]


def truth() -> Boxes:
    """Ground-truth boxes of either scene."""
    return boxes_from_tables({tick: boxes(tick) for tick in range(TICKS)})


def as_predicted(**changes: AnyArray) -> Predictions:
    """The truth as prediction, with other columns."""
    own = replace(truth(), **changes)
    return Predictions(own, np.ones(len(own)))
