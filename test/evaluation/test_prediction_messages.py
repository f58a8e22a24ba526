"""Messages of rosbags and of rclpy become boxes and scores; grid orientation is checked with our own messages."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from prediction_bags import TABLE_DTYPE, TYPES, detections, header, image, markers, occupancy, pose, table_message

from simbev_ros.drawing.displays.box_markers import box_markers
from simbev_ros.drawing.displays.grids import occupancy_grid
from simbev_ros.evaluation.predictions.prediction_messages import (
    BOX_TYPES,
    image_scores,
    message_boxes,
    occupancy_scores,
    stamp_ns_of,
)
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, Table
from simbev_ros.schema.boxes import blank_boxes

STAMP_NS = 7_204_050_000_001
QUARTER = (0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4))
ENTRIES = [
    ("truck", 0.75, (1, 2, 3), (8, 2.5, 3), QUARTER),
    ("pedestrian", 0.5, (4, 5, 6), (0.5, 0.5, 1.75), (0, 0, 0, 2)),
]
TABLE, MARKERS, DETECTIONS = BOX_TYPES


def table() -> Table:
    rows = np.zeros(2, TABLE_DTYPE)
    rows["x"], rows["y"], rows["z"] = [1, 4], [2, 5], [3, 6]
    rows["length"], rows["width"], rows["height"] = [8, 0.5], [2.5, 0.5], [3, 1.75]
    rows["class"], rows["score"], rows["yaw"] = [1, 5], [0.75, 0.5], [np.pi / 2, 0]
    rows["vx"], rows["vy"] = [1, np.nan], [2, 3]
    return rows


def all_messages() -> list[tuple[str, Any]]:
    head = header(STAMP_NS, "ego/lidar")
    return [
        (TABLE, table_message(table(), STAMP_NS, "ego/lidar")),
        (MARKERS, markers(ENTRIES, head)),
        (DETECTIONS, detections(ENTRIES, head)),
    ]


def as_rclpy(type_name: str, message: Any) -> Any:
    """The same message as an object of rclpy."""
    pytest.importorskip("rclpy")
    from rclpy.serialization import deserialize_message

    from simbev_ros.ros.msgs.message_types import message_class

    return deserialize_message(bytes(TYPES.serialize_cdr(message, type_name)), message_class(type_name))


def read_message(type_name: str, message: Any, tick: int = 7) -> Any:
    return message_boxes(type_name, message, tick, "/prediction/boxes")


@pytest.mark.parametrize("from_ros", [False, True])
@pytest.mark.parametrize(("type_name", "message"), all_messages(), ids=["table", "markers", "detections"])
def test_boxes_of_each_type(type_name: str, message: Any, from_ros: bool) -> None:
    if from_ros:
        if type_name == DETECTIONS:
            pytest.importorskip("vision_msgs")
        message = as_rclpy(type_name, message)
    found = read_message(type_name, message)
    boxes = found.predictions.boxes
    assert stamp_ns_of(message) == STAMP_NS and found.references[0].frame_id == "ego/lidar"
    np.testing.assert_array_equal(boxes.frame, [7, 7])
    assert [BOX_CLASSES[label] for label in boxes.label] == ["truck", "pedestrian"]
    np.testing.assert_array_equal(found.predictions.score, [0.75, 0.5])
    np.testing.assert_array_equal(boxes.center_m, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(boxes.size_m, [[8, 2.5, 3], [0.5, 0.5, 1.75]])
    np.testing.assert_allclose(boxes.yaw_rad, [np.pi / 2, 0], atol=1e-7)
    has_velocity = [[1, 2, 0], [np.nan] * 3] if type_name == TABLE else np.full((2, 3), np.nan)
    np.testing.assert_array_equal(boxes.velocity_mps, has_velocity)


def test_messages_without_boxes_answer_a_frame() -> None:
    for message in (table_message(table()[:0], STAMP_NS), table_message(np.zeros(0, [("x", "<f4")]), STAMP_NS, "")):
        assert len(read_message(TABLE, message)) == 0 and stamp_ns_of(message) == STAMP_NS
    nothing = markers([], header(STAMP_NS))
    nothing.markers = nothing.markers[1:]
    assert len(read_message(MARKERS, nothing)) == 0 and stamp_ns_of(nothing) == STAMP_NS
    nothing.markers = []
    assert stamp_ns_of(nothing) is None and len(read_message(MARKERS, nothing)) == 0
    assert len(read_message(DETECTIONS, detections([], header(STAMP_NS)))) == 0


def test_a_marker_without_text_has_score_1_and_a_class_may_be_a_number() -> None:
    message = markers([("5", 0.5, *ENTRIES[0][2:])], header(STAMP_NS))
    message.markers[-1].text = ""
    found = read_message(MARKERS, message)
    assert found.predictions.score == [1.0] and found.predictions.boxes.label == [5]


def test_ids_of_tables_and_detections_are_tracks_but_those_of_markers_are_not() -> None:
    rows = np.zeros(2, [*TABLE_DTYPE.descr, ("id", "<i4")])
    for name in TABLE_DTYPE.names or ():
        rows[name] = table()[name]
    rows["id"] = [-1, 7]
    assert read_message(TABLE, table_message(rows, STAMP_NS, "map")).predictions.boxes.track.tolist() == [-1, 7]
    assert read_message(TABLE, table_message(table(), STAMP_NS, "map")).predictions.boxes.track.tolist() == [-1, -1]
    message = detections(ENTRIES, header(STAMP_NS))
    message.detections[0].id = "5f2c-a"
    first, none = read_message(DETECTIONS, message).predictions.boxes.track.tolist()
    message.detections[1].id = "5f2c-b"
    again, second = read_message(DETECTIONS, message).predictions.boxes.track.tolist()
    assert first == again >= 0 and second >= 0 and first != second and none == -1
    cubes = markers(ENTRIES, header(STAMP_NS))
    for number, each in enumerate(cubes.markers):
        each.id = number
    assert read_message(MARKERS, cubes).predictions.boxes.track.tolist() == [-1, -1]


def test_bad_ids_are_named() -> None:
    rows = np.zeros(2, [*TABLE_DTYPE.descr, ("id", "<f4")])
    with pytest.raises(InputError, match="id: is of the type float32; it must be a whole-number type"):
        read_message(TABLE, table_message(rows, STAMP_NS, "map"))
    message = detections(ENTRIES, header(STAMP_NS))
    for each in message.detections:
        each.id = "same"
    with pytest.raises(InputError, match=r"id: row 1 is .*; it must be different in all boxes of a frame"):
        read_message(DETECTIONS, message)


def test_our_own_markers_are_perfect_predictions() -> None:
    truth = blank_boxes(3)
    truth["class"], truth["yaw"], truth["x"], truth["length"] = [0, 5, 9], [3, -2, 0.5], [1, 2, 3], [4, 1, 2]
    found = read_message(MARKERS, TYPES.deserialize_cdr(box_markers(truth, STAMP_NS), MARKERS))
    np.testing.assert_array_equal(found.predictions.boxes.label, truth["class"])
    np.testing.assert_allclose(found.predictions.boxes.yaw_rad, truth["yaw"], rtol=1e-6)
    np.testing.assert_array_equal(found.predictions.boxes.size_m[:, 0], truth["length"])
    np.testing.assert_array_equal(found.predictions.score, 1.0)


def table_with(name: str, value: float) -> Table:
    rows = table()
    rows[name][1] = value
    return rows


def table_without(name: str) -> Table:
    from numpy.lib.recfunctions import drop_fields

    rows: Table = drop_fields(table(), name, usemask=False)
    return rows


FLAT = (np.sin(np.pi / 4), 0, 0, np.cos(np.pi / 4))
BAD = [
    (TABLE, table_message(table_with("score", np.nan), 1), r"score: row 1 is nan; it must be a finite number"),
    (TABLE, table_message(table_with("height", -1), 1), r"height: row 1 is -1.0; it must be at least 0"),
    (TABLE, table_message(table_with("class", 10), 1), r"class: row 1 is 10; it must be one of car"),
    (TABLE, table_message(table_without("yaw"), 1), r"yaw: there is no such field; it has note, x"),
    (TABLE, table_message(table().astype([*TABLE_DTYPE.descr[:8], ("class", "<f4"), *TABLE_DTYPE.descr[9:]]), 1),
     r"class: is of the type float32; it must be a whole-number type"),
    (TABLE, table_message(table(), 1, ""), r"header.frame_id: is empty; it must be a coordinate frame"),
    (TABLE, table_message(table(), 1, data=np.zeros(3, np.uint8)), r"fields: point cloud of 2x1: row step"),
    (MARKERS, markers([("tram", *ENTRIES[0][1:])], header(1)), r"class: row 0 is 'tram'; it must be one of car"),
    (MARKERS, markers([("", *ENTRIES[0][1:])], header(1)), r"class: row 0 is ''; it must be one of car"),
    (MARKERS, markers([("car", "sure", *ENTRIES[0][2:])], header(1)), r"text: row 0 is 'sure'; it must be the score"),
    (MARKERS, markers([(*ENTRIES[0][:4], FLAT)], header(1)), r"orientation: row 0 is \[0.7.*; it must be upright"),
    (MARKERS, markers([(*ENTRIES[0][:4], (0, 0, 0, 0))], header(1)), r"orientation: row 0 .* other than 0"),
    (DETECTIONS, detections(ENTRIES, header(1), empty_results=True), r"results: row 0 has none"),
    (DETECTIONS, detections([("car", np.nan, *ENTRIES[0][2:])], header(1)), r"score: row 0 is nan"),
]  # fmt: skip


@pytest.mark.parametrize(("type_name", "message", "text"), BAD)
def test_bad_messages_are_named(type_name: str, message: Any, text: str) -> None:
    with pytest.raises(InputError, match=rf"^/prediction/boxes: {text}"):
        read_message(type_name, message)


def test_cubes_with_different_headers_are_refused() -> None:
    message = markers(ENTRIES, header(1))
    message.markers[-1].header = header(1, "ego/lidar")
    with pytest.raises(InputError, match=r"header: that of row 1 differs from the first marker's"):
        read_message(MARKERS, message)


def test_detections_from_before_galactic_are_refused() -> None:
    message = detections(ENTRIES, header(1))
    message.detections[0].results = [SimpleNamespace(id="car", score=0.5)]
    with pytest.raises(InputError, match=r"no attribute 'hypothesis'; vision_msgs of ROS 2 Galactic or later"):
        read_message(DETECTIONS, message)


@pytest.mark.parametrize("dtype", ["u1", "<f4", ">f4"])
@pytest.mark.parametrize("from_ros", [False, True])
def test_images_become_layers(dtype: str, from_ros: bool) -> None:
    rng = np.random.default_rng(1)
    cells = rng.random((5, 3, len(BEV_CLASSES))).astype(dtype) if dtype != "u1" else rng.integers(
        0, 256, (5, 3, len(BEV_CLASSES)), np.uint8
    )  # fmt: skip
    message = image(cells, STAMP_NS)
    scores = image_scores(as_rclpy("sensor_msgs/msg/Image", message) if from_ros else message, "/prediction/bev")
    assert scores.shape == (len(BEV_CLASSES), 5, 3) and scores.dtype == (np.uint8 if dtype == "u1" else np.float32)
    np.testing.assert_array_equal(np.moveaxis(scores, 0, -1), cells)
    assert stamp_ns_of(message) == STAMP_NS


def test_bad_images_are_named() -> None:
    cells = np.zeros((5, 3, len(BEV_CLASSES)), np.uint8)
    with pytest.raises(InputError, match=r"^/bev: encoding: is '8UC3'; allowed: 8UC14, 32FC14"):
        image_scores(image(cells[..., :3], 1), "/bev")
    with pytest.raises(InputError, match=r"^/bev: data: 235 bytes, step 47, are not an image of 4 x 5 8UC14"):
        image_scores(image(cells, 1, width=4), "/bev")


def cells_ahead() -> AnyArray:
    """Cells in message order, 3 rows along y and 5 cells along x, three of which are known."""
    data = np.zeros((3, 5), np.int8)
    data[0, 0], data[2, 4], data[0, 4] = 30, 100, -1  # behind right, ahead left, ahead right
    return data


def test_occupancy_is_rotated_so_that_row_0_is_ahead_and_column_0_left() -> None:
    scores = occupancy_scores(occupancy(cells_ahead(), 1), "/bev")
    expected = np.zeros((5, 3), np.float32)
    expected[4, 2], expected[0, 0] = 0.3, 1.0
    np.testing.assert_array_equal(scores, expected)


def test_every_percentage_is_the_nearest_float() -> None:
    cells = np.arange(100, dtype=np.int8).reshape(10, 10)
    found = np.sort(occupancy_scores(occupancy(cells, 1), "/bev"), axis=None)
    np.testing.assert_array_equal(found, np.array([float(f"0.{k:02d}") for k in range(100)], np.float32))


@pytest.mark.parametrize("tilt_rad", [0.0, 0.12])
def test_our_own_occupancy_grids_are_read_back(tilt_rad: float) -> None:
    rpy_rad = np.array([-tilt_rad / 2, tilt_rad, 2.0])
    covered = np.random.default_rng(5).random((360, 200)) < 0.3
    made = occupancy_grid(covered, BevGrid(360, 200, 0.4), STAMP_NS, "ego/base_link", rpy_rad)
    message = TYPES.deserialize_cdr(made, "nav_msgs/msg/OccupancyGrid")
    np.testing.assert_array_equal(occupancy_scores(message, "/bev"), covered)


def test_bad_occupancy_is_named() -> None:
    data = cells_ahead()
    with pytest.raises(InputError, match=r"^/bev: info.origin: is x 120, y 40, yaw 0; it must be x -1.25, y -0.75"):
        occupancy_scores(occupancy(data, 1, pose((120, 40, 0), (0, 0, 0, 1))), "/bev")
    with pytest.raises(InputError, match=r"info.origin: is x -1.25, y -0.75, yaw 1.57; it must be"):
        occupancy_scores(occupancy(data, 1, pose((-1.25, -0.75, 0), QUARTER)), "/bev")
    data[1, 1] = 101
    with pytest.raises(InputError, match=r"data: cell 6 is 101; allowed: 0 to 100, and -1"):
        occupancy_scores(occupancy(data, 1), "/bev")
    message = occupancy(data, 1)
    message.info.width = 6
    with pytest.raises(InputError, match=r"data: 15 cells do not form a grid of 6 x 3"):
        occupancy_scores(message, "/bev")


def test_an_orientation_too_long_for_its_length_to_be_a_number_is_refused() -> None:
    message = markers([("car", 0.5, (1, 2, 3), (4, 2, 1.5), (0, 0, 1e200, 1e200))], header(1))
    with pytest.raises(InputError, match="orientation: row 0"):
        message_boxes("visualization_msgs/msg/MarkerArray", message, 0, "topic")


def test_a_grid_turned_by_a_huge_quaternion_is_refused() -> None:
    turned = pose((-0.5, -0.5, 0), (0, 1e200, 1e200, 1))
    with pytest.raises(InputError, match=r"info\.origin"):
        occupancy_scores(occupancy(np.zeros((2, 2), np.int8), 1, turned), "topic")
