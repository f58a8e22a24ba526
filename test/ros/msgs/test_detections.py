"""Detections are the tables' rows: classes, ids, poses and sizes, as vision_msgs' own code reads them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from simbev_ros.drawing.displays.detections import (
    DETECTIONS_2D,
    DETECTIONS_3D,
    LABEL_INFO,
    detections_2d,
    detections_3d,
    label_info,
)
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Table
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.messages.message_types import types_with
from simbev_ros.schema.views import VIEW_DTYPE

STAMP_NS = 3_600_050_000_000


def read_with_rosbags(payload: bytes, type_name: str) -> Any:
    return types_with(type_name).deserialize_cdr(payload, type_name)


def read_with_rclpy(payload: bytes, type_name: str) -> Any:
    messages = pytest.importorskip("vision_msgs.msg", reason="vision_msgs is not installed")
    from rclpy.serialization import deserialize_message

    return deserialize_message(payload, getattr(messages, type_name.rpartition("/")[2]))


Reader = Callable[[bytes, str], Any]
readers = pytest.mark.parametrize("read", [read_with_rosbags, read_with_rclpy])


@pytest.fixture
def boxes() -> Table:
    random = np.random.default_rng(1)
    table = np.zeros(5, BOX_DTYPE)
    for name in ("x", "y", "z", "roll", "pitch", "yaw", "length", "width", "height"):
        table[name] = random.uniform(0.1, 3.0, 5)
    table["id"] = [7, 9, 300, 0x10001, 0x20002]
    table["class"] = np.arange(5)
    return table


@readers
def test_every_box_is_a_detection_with_its_class_id_pose_and_size(boxes: Table, read: Reader) -> None:
    message = read(detections_3d(boxes, STAMP_NS), DETECTIONS_3D)
    assert (message.header.frame_id, message.header.stamp.sec, message.header.stamp.nanosec) == ("map", 3600, 50000000)
    assert len(message.detections) == 5
    for row, detection in zip(boxes, message.detections, strict=True):
        assert detection.header == message.header
        assert detection.id == str(row["id"])
        hypothesis = detection.results[0].hypothesis
        assert (hypothesis.class_id, hypothesis.score) == (BOX_CLASSES[row["class"]], 1.0)
        center, size = detection.bbox.center, detection.bbox.size
        assert [center.position.x, center.position.y, center.position.z] == [row["x"], row["y"], row["z"]]
        assert [size.x, size.y, size.z] == [row["length"], row["width"], row["height"]]
        turn = center.orientation
        truth = Rotation.from_euler("xyz", [row["roll"], row["pitch"], row["yaw"]])
        assert (truth.inv() * Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])).magnitude() < 1e-6
        assert detection.results[0].pose.pose == center


def view(**columns: float) -> Table:
    """A row of a camera's table, without a visible box unless there is one in the columns."""
    row = np.zeros(1, VIEW_DTYPE)
    row[["left", "top", "right", "bottom"]] = np.nan
    for name, value in columns.items():
        row[name] = value
    return row


@readers
def test_visible_boxes_are_those_of_objects_with_visible_pixels_and_amodal_ones_of_all(read: Reader) -> None:
    amodal = {"amodal_left": -4.5, "amodal_top": 1.5, "amodal_right": 10.5, "amodal_bottom": 8.5}
    seen = view(id=3, visible_px=12, left=6.5, top=2.5, right=9.5, bottom=6.5, **{"class": 1}, **amodal)
    table = np.concatenate([seen, view(id=4, visible_px=0, **{"class": 2}, **amodal)])
    visible = read(detections_2d(table, STAMP_NS, "ego/cam_optical"), DETECTIONS_2D)
    [only] = visible.detections
    assert (only.id, only.results[0].hypothesis.class_id) == ("3", BOX_CLASSES[1])
    box = only.bbox
    assert (box.center.position.x, box.center.position.y, box.size_x, box.size_y) == (8.0, 4.5, 3.0, 4.0)
    assert visible.header.frame_id == "ego/cam_optical"
    whole = read(detections_2d(table, STAMP_NS, "ego/cam_optical", "amodal_"), DETECTIONS_2D)
    assert [each.id for each in whole.detections] == ["3", "4"]
    box = whole.detections[1].bbox
    assert (box.center.position.x, box.center.position.y, box.size_x, box.size_y) == (3.0, 5.0, 15.0, 7.0)


@readers
def test_label_info_names_every_number(read: Reader) -> None:
    message = read(label_info({1: "road", 2: "hazard", 8192: "rider"}, STAMP_NS, "ego/base_link"), LABEL_INFO)
    assert {each.class_id: each.class_name for each in message.class_map} == {1: "road", 2: "hazard", 8192: "rider"}
    assert message.header.frame_id == "ego/base_link"
