"""A recorded scene in which two cars meet: each of them sees an object that the other one does not see."""

from pathlib import Path

import evaluated_dataset as single
import numpy as np
from ros_messages import image, odometry, point_cloud

from simbev_ros.evaluation.metrics.boxes import Predictions, boxes_from_tables
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile
from simbev_ros.schema.boxes import blank_boxes
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.annotation.boxes.joint import join_boxes

TICKS, NAME = single.TICKS, single.NAMES[0]
EGO, CAR, SEEN_BY_EGO, SEEN_BY_CAR, SEEN_BY_BOTH, SEEN_BY_NONE = 1, 2, 11, 12, 13, 14
PLACES_M = {SEEN_BY_EGO: (5.0, 9.0), SEEN_BY_CAR: (38.0, -6.0), SEEN_BY_BOTH: (20.0, -3.0), SEEN_BY_NONE: (25.0, 14.0)}
POINTS = {  # in the boxes of the two cars
    EGO: (None, 60),
    CAR: (30, None),
    SEEN_BY_EGO: (8, 0),
    SEEN_BY_CAR: (0, 50),
    SEEN_BY_BOTH: (3, 4),
    SEEN_BY_NONE: (0, 0),
}
HALF_HEIGHT_M = 0.75
YAW_RAD = {"ego": 0.0, "car": np.pi}


def spec(**annotation_of_car: object) -> SceneSpec:
    """Scene with the agents ``ego`` and ``car``."""
    plain = single.spec(0).model_dump(mode="json")
    rig = {"agent": "car", "sensors": single.SENSORS}
    agent = {"rig": rig, "annotation": {"bev": single.GRID} | annotation_of_car, "vehicle": 1}
    return SceneSpec.model_validate(plain | {"vehicles": [single.EGO] * 2, "agents": [*plain["agents"], agent]})


def place_m(agent: str, tick: int) -> Float64Array:
    """Position of a car: the two drive towards each other."""
    return np.array([float(tick), 2.0, 0.0]) if agent == "ego" else np.array([50.0 - tick, -2.0, 0.0])


def boxes(agent: str, tick: int) -> Table:
    """All cars around one of the two, with its own points."""
    column = ("ego", "car").index(agent)
    cars_m = {EGO: place_m("ego", tick)[:2], CAR: place_m("car", tick)[:2], **PLACES_M}
    shown = [number for number in cars_m if POINTS[number][column] is not None]
    table = blank_boxes(len(shown))
    table["id"], table["class"] = shown, BOX_CLASSES.index("car")
    table["x"], table["y"] = np.array([cars_m[number] for number in shown]).T
    table["z"], table["length"], table["width"], table["height"] = HALF_HEIGHT_M, 4.0, 2.0, 2 * HALF_HEIGHT_M
    table["yaw"] = [YAW_RAD["car"] if number == CAR else 0.0 for number in shown]
    offset_m = np.stack([table["x"], table["y"]], axis=1) - place_m(agent, tick)[:2]
    table["distance"] = np.linalg.norm(offset_m, axis=1)
    table["lidar_points"] = [POINTS[number][column] for number in shown]
    table["valid"] = table["lidar_points"] > 0
    table["on_ego_level"] = 1
    return table


def seen(agent: str, tick: int) -> Table:
    """The boxes with points of one of the two."""
    table = boxes(agent, tick)
    return table[table["valid"] == 1]


def as_answers(tables: dict[int, Table]) -> Predictions:
    """Boxes by tick as perfect answers."""
    found = boxes_from_tables(tables)
    return Predictions(found, np.ones(len(found)))


def record(dataset: Path) -> Path:
    """A dataset of the scene alone."""
    scene = spec()
    with SceneBagWriter(dataset / "scenes" / "val" / NAME) as writer:
        writer.add_attachment("scene.json", "application/json", scene.model_dump_json().encode())
        for tick in range(TICKS):
            for topic, type_name, payload in _messages(scene.stamp_ns(tick), tick):
                if tick == 0:
                    writer.add_topic(topic, type_name, QosProfile())
                writer.write(topic, scene.stamp_ns(tick), payload)
        writer.finish({"complete": "true", "ticks": str(TICKS)})
    return dataset


def _messages(stamp_ns: int, tick: int) -> list[tuple[str, str, bytes]]:
    tables = {agent: boxes(agent, tick) for agent in YAW_RAD}
    messages = [
        message
        for agent, table in tables.items()
        for message in _messages_of(agent, stamp_ns, place_m(agent, tick), table, single.labels(tick))
    ]
    joint = join_boxes([*tables], tables).rows
    return [*messages, ("/world/boxes", "sensor_msgs/msg/PointCloud2", point_cloud(stamp_ns, joint))]


def _messages_of(
    agent: str, stamp_ns: int, position_m: Float64Array, table: Table, cells: AnyArray
) -> list[tuple[str, str, bytes]]:
    turn_rad = np.array([0.0, 0.0, YAW_RAD[agent]])
    return [
        (f"/{agent}/odom", "nav_msgs/msg/Odometry", odometry(stamp_ns, position_m, turn_rad)),
        (f"/{agent}/boxes", "sensor_msgs/msg/PointCloud2", point_cloud(stamp_ns, table)),
        (f"/{agent}/bev/labels", "sensor_msgs/msg/Image", image(stamp_ns, "mono16", cells)),
    ]
