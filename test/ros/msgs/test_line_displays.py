"""Lines, paths, pictures and statuses for displays show what the labels state, checked on deserialized messages."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Path
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import CompressedImage, Image
from visualization_msgs.msg import ImageMarker, Marker, MarkerArray

from simbev_ros.drawing.displays.box_markers import world_markers
from simbev_ros.drawing.displays.ego_path import EgoPath, PathPose, path_message
from simbev_ros.drawing.displays.image_boxes import image_boxes
from simbev_ros.drawing.displays.map_markers import map_markers
from simbev_ros.drawing.displays.messages import rgb_image
from simbev_ros.drawing.displays.pictures import color_picture, compressed_picture
from simbev_ros.drawing.displays.status import status
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Float64Array
from simbev_ros.recording.image_codecs import decode_rgb
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.schema.palette import class_color
from simbev_ros.schema.scene.lights import STREET_LIGHT_DTYPE
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE
from simbev_ros.schema.views import VIEW_DTYPE

STAMP_NS = 3_050_000_000
SQUARE = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
RECORD = {
    "map_from_patch": {"translation": [100.0, -20.0, 3.0], "yaw": np.pi / 2},
    "lanes": [
        {"type": "driving", "center": [[[0.0, 0.0, 0.0], [10.0, 0.0, 0.5]]]},
        {"type": "sidewalk", "center": [[[0.0, 9.0, 0.0], [10.0, 9.0, 0.0]]]},
    ],
    "lines": [{"pieces": [[[0.0, 2.0, 0.0], [5.0, 2.0, 0.0], [5.0, 3.0, 0.0]], [[8.0, 2.0, 0.0], [9.0, 2.0, 0.0]]]}],
    "edges": [],
    "crosswalks": [{"outlines": [SQUARE]}],
    "stop_lines": [{"pieces": [[[1.0, 1.0, 0.0], [1.0, 4.0, 0.0]]]}],
}


def segments(marker: Marker) -> Float64Array:
    """(N, 2, 3) ends of a marker's lines."""
    assert marker.type == Marker.LINE_LIST
    return np.array([[point.x, point.y, point.z] for point in marker.points]).reshape(-1, 2, 3)


def test_lines_of_the_vector_map_are_in_the_map_frame_and_outlines_are_closed() -> None:
    first, *markers = deserialize_message(map_markers(RECORD, STAMP_NS), MarkerArray).markers
    assert first.action == Marker.DELETEALL
    lines = {marker.ns: segments(marker) for marker in markers}
    assert {name: len(each) for name, each in lines.items()} == {"lane": 1, "line": 3, "crosswalk": 4, "stop_line": 1}
    # The patch's x axis points along +y of the map.
    assert lines["lane"][0] == pytest.approx(np.array([[100.0, -20.0, 3.03], [100.0, -10.0, 3.53]]))
    assert lines["stop_line"][0] == pytest.approx(np.array([[99.0, -19.0, 3.03], [96.0, -19.0, 3.03]]))
    ring = lines["crosswalk"]
    assert ring[:, 1] == pytest.approx(np.roll(ring[:, 0], -1, axis=0))
    assert {(each.header.frame_id, stamp_of(each.header.stamp)) for each in markers} == {("map", STAMP_NS)}


def test_visible_boxes_are_solid_and_hidden_ones_dashed_in_the_colors_of_their_classes() -> None:
    views = np.zeros(2, VIEW_DTYPE)
    views["class"], views["visible_px"] = [5, 0], [9, 0]
    for name, values in zip(("left", "top", "right", "bottom"), ((3, 5), (4, 6), (10, 35), (20, 26)), strict=True):
        views[name], views[f"amodal_{name}"] = (values[0], np.nan), values
    marker = deserialize_message(image_boxes(views, STAMP_NS, "ego/cam_optical"), ImageMarker)
    assert (marker.type, marker.header.frame_id, marker.filled) == (ImageMarker.LINE_LIST, "ego/cam_optical", 0)
    ends = np.array([[point.x, point.y] for point in marker.points]).reshape(-1, 2, 2)
    assert len(marker.outline_colors) == len(ends), "one color for each line"
    assert {tuple(map(tuple, line)) for line in ends[:4].tolist()} == {
        ((3, 4), (10, 4)),
        ((10, 4), (10, 20)),
        ((10, 20), (3, 20)),
        ((3, 20), (3, 4)),
    }
    dashes = ends[4:]
    assert dashes.min(axis=(0, 1)).tolist() == [5, 6] and dashes.max(axis=(0, 1)).tolist() == [35, 26]
    assert 0.4 < np.abs(np.diff(dashes, axis=1)).sum() / (2 * (30 + 20)) < 0.6, "about half of the outline is drawn"
    for line, name in ((0, BOX_CLASSES[5]), (4, BOX_CLASSES[0])):
        color = marker.outline_colors[line]
        assert np.array([color.r, color.g, color.b]) * 255 == pytest.approx(class_color(name), abs=0.01)


def test_a_camera_that_sees_nothing_has_no_lines() -> None:
    marker = deserialize_message(image_boxes(np.zeros(0, VIEW_DTYPE), STAMP_NS, "ego/cam_optical"), ImageMarker)
    assert (len(marker.points), len(marker.outline_colors)) == (0, 0)


def test_the_path_has_steps_of_half_a_meter_and_ends_where_the_ego_is() -> None:
    path = EgoPath()
    places = [PathPose(1_000 * tick, [0.2 * tick, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]) for tick in range(21)]
    for place in places:
        path.add(place)
    message = deserialize_message(path_message(path.until(places[-1])), Path)
    x = np.array([each.pose.position.x for each in message.poses])
    assert x[:-1] == pytest.approx(0.6 * np.arange(7)) and x[-1] == pytest.approx(4.0)
    assert [stamp_of(each.header.stamp) for each in message.poses][-1] == stamp_of(message.header.stamp) == 20_000
    earlier = deserialize_message(path_message(path.until(places[4])), Path)
    assert [each.pose.position.x for each in earlier.poses] == pytest.approx([0.0, 0.6, 0.8])


def test_a_long_path_keeps_its_newest_part() -> None:
    path = EgoPath()
    for meter in range(3000):
        path.add(PathPose(meter, [float(meter), 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]))
    message = deserialize_message(
        path_message(path.until(PathPose(3000, [3000.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]))), Path
    )
    assert [message.poses[0].pose.position.x, len(message.poses)] == [1000.0, 2001]


def test_flow_becomes_a_picture_of_its_size_in_which_directions_differ() -> None:
    flow_px = np.zeros((24, 32, 2), np.float32)
    flow_px[:, :16, 0], flow_px[:, 16:, 0] = 5.0, -5.0
    picture = color_picture("flow", flow_px)
    assert (picture.shape, picture.dtype) == ((24, 32, 3), np.uint8)
    right, left = picture[12, 6].astype(int), picture[12, 26].astype(int)
    assert np.abs(right - left).max() > 100


def test_a_picture_is_sent_raw_and_as_jpeg() -> None:
    picture = np.full((24, 32, 3), (200, 90, 30), np.uint8)
    raw = deserialize_message(rgb_image(picture, STAMP_NS, "ego/cam_optical"), Image)
    assert (raw.encoding, raw.height, raw.width, raw.step, raw.is_bigendian) == ("rgb8", 24, 32, 96, 0)
    assert bytes(raw.data) == picture.tobytes()
    compressed = deserialize_message(compressed_picture(picture, STAMP_NS, "ego/cam_optical"), CompressedImage)
    assert compressed.format == "rgb8; jpeg compressed bgr8" and compressed.header == raw.header
    assert np.abs(decode_rgb(bytes(compressed.data)).astype(int) - picture).max() < 4


def test_street_lights_are_one_marker_in_the_color_of_their_state() -> None:
    lamps = np.zeros(3, STREET_LIGHT_DTYPE)
    lamps["x"], lamps["z"], lamps["on"], lamps["failed"] = [1, 2, 3], 8.0, [1, 0, 0], [0, 0, 1]
    made = world_markers(np.zeros(0, ACTOR_DTYPE), np.zeros(0, SIGNAL_DTYPE), lamps, STAMP_NS)
    _, marker = deserialize_message(made, MarkerArray).markers
    assert (marker.ns, marker.type) == ("street_light", Marker.SPHERE_LIST)
    assert [(point.x, point.z) for point in marker.points] == [(1.0, 8.0), (2.0, 8.0), (3.0, 8.0)]
    lit, dark, broken = marker.colors
    assert lit.r > 0.9 and lit.b < lit.g < lit.r
    assert dark.r == dark.g == dark.b and broken.r > 2 * broken.g


def test_a_record_becomes_a_status_with_flat_keys() -> None:
    record = {"stamp_ns": 5, "id": "a_0", "s": 1.5, "left": {"paint": "solid"}, "neighbors": ["b", "c"]}
    message = deserialize_message(status("lane", record, STAMP_NS), DiagnosticArray)
    assert stamp_of(message.header.stamp) == STAMP_NS
    (found,) = message.status
    assert (found.name, found.level) == ("lane", b"\0")
    assert {value.key: value.value for value in found.values} == {
        "id": "a_0",
        "s": "1.5",
        "left.paint": "solid",
        "neighbors.0": "b",
        "neighbors.1": "c",
    }


def test_serialized_messages_are_those_of_rclpy() -> None:
    made = image_boxes(np.zeros(1, VIEW_DTYPE), STAMP_NS, "ego/cam_optical")
    message = deserialize_message(made, ImageMarker)
    assert deserialize_message(serialize_message(message), ImageMarker) == message
    assert len(serialize_message(message)) == len(made)
