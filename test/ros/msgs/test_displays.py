"""Grids and markers follow the conventions of RViz and Foxglove, checked on deserialized messages."""

import numpy as np
import pytest
from nav_msgs.msg import OccupancyGrid
from rclpy.serialization import deserialize_message
from synthetic_world import actor, box_model
from visualization_msgs.msg import Marker, MarkerArray

from simbev_ros.drawing.displays.box_markers import box_markers, world_markers
from simbev_ros.drawing.displays.grids import occupancy_grid
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.semantics import BOX_CLASSES, Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.scene.lights import STREET_LIGHT_DTYPE
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE, SignalState, map_from_actors
from simbev_ros.simulation.sensors.mount import vector

STAMP_NS = 7_204_050_000_001
GRID = BevGrid(rows=40, columns=30, cell_m=0.5)
EGO = {"x": 210.0, "y": -35.0, "z": 4.0, "yaw": 2.1}
TILTS = [{}, {"roll": 0.06, "pitch": -0.11}]


def pattern(points_m: Float64Array) -> BoolArray:
    """Asymmetric pattern of (..., 2) map coordinates: an L, and a line through the ego."""
    x, y = points_m[..., 0] - EGO["x"], points_m[..., 1] - EGO["y"]
    line: BoolArray = np.abs(0.4 * x - y) < 0.6
    return ((x > 1.0) & (x < 8.0) & (y > 2.0) & (y < 3.5)) | ((x > 1.0) & (x < 2.5) & (y > 2.0) & (y < 7.0)) | line


def matrix(xyz: list[float], xyzw: list[float]) -> Float64Array:
    """(4, 4) pose in the convention of ROS."""
    x, y, z, w = xyzw
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = xyz
    return pose


@pytest.mark.parametrize("tilt", TILTS)
def test_grid_cells_are_where_the_message_puts_them_in_the_map(tilt: dict[str, float]) -> None:
    ego = actor(box_model(Tag.CAR, (4.0, 2.0, 1.5)), **EGO, **tilt)
    rotation = np.array([[np.cos(EGO["yaw"]), -np.sin(EGO["yaw"])], [np.sin(EGO["yaw"]), np.cos(EGO["yaw"])]])
    covered = pattern(GRID.centers_ego @ rotation.T + [EGO["x"], EGO["y"]])
    made = occupancy_grid(covered, GRID, STAMP_NS, "ego/base_link", vector(ego[0], "roll pitch yaw"))
    message = deserialize_message(made, OccupancyGrid)
    assert (message.header.frame_id, stamp_of(message.header.stamp)) == ("ego/base_link", STAMP_NS)
    info, position, q = message.info, message.info.origin.position, message.info.origin.orientation
    assert (info.width, info.height, info.resolution) == (GRID.rows, GRID.columns, 0.5)
    assert np.linalg.norm([q.x, q.y, q.z, q.w]) == pytest.approx(1.0)
    data = np.array(message.data).reshape(info.height, info.width)  # as nav_msgs defines it: row by row from the origin
    assert set(data.ravel().tolist()) == {0, 100}
    column, row = np.meshgrid(np.arange(info.width), np.arange(info.height))
    local_m = np.stack([column + 0.5, row + 0.5, np.zeros_like(row)], axis=-1).reshape(-1, 3) * info.resolution
    frame_from_grid = matrix([position.x, position.y, position.z], [q.x, q.y, q.z, q.w])
    positions_m = apply(map_from_actors(ego)[0] @ frame_from_grid, local_m)
    assert np.array_equal(data.ravel() == 100, pattern(positions_m[:, :2]))
    assert positions_m[:, 2] == pytest.approx(EGO["z"], abs=1e-5)  # level, whatever the ego's tilt


def boxes(count: int = 12) -> Table:
    rng = np.random.default_rng(0)
    table = np.zeros(count, BOX_DTYPE)
    table["id"], table["class"] = np.sort(rng.choice(1 << 18, count, replace=False)), np.arange(count) % 10
    for name in ["x", "y", "z", "roll", "pitch", "yaw", "vx", "vy"]:
        table[name] = rng.normal(0.0, 5.0, count)
    for name in ["length", "width", "height"]:
        table[name] = rng.uniform(0.2, 9.0, count)
    table["vx"][::3], table["vy"][::3] = 0.0, 0.0
    return table


def read(table: Table, stamp_ns: int = STAMP_NS) -> list[Marker]:
    markers: list[Marker] = deserialize_message(box_markers(table, stamp_ns), MarkerArray).markers
    return markers


def test_markers_replace_previous_ones_and_keep_their_ids() -> None:
    table = boxes()
    first, second = read(table), read(table[1:], STAMP_NS + 1)
    for markers, stamp_ns in (first, STAMP_NS), (second, STAMP_NS + 1):
        assert markers[0].action == Marker.DELETEALL
        assert {marker.action for marker in markers[1:]} == {Marker.ADD}
        assert {(marker.header.frame_id, stamp_of(marker.header.stamp)) for marker in markers} == {("map", stamp_ns)}
        names = [(marker.ns, marker.id) for marker in markers[1:]]
        assert len(set(names)) == len(names)
    assert [(marker.ns, marker.id) for marker in first[2:]] == [(marker.ns, marker.id) for marker in second[1:]]
    assert [marker.ns for marker in first[1:13]] == [BOX_CLASSES[each] for each in table["class"]]


def test_markers_are_valid_for_displays() -> None:
    for marker in read(boxes())[1:]:
        q, scale, color = marker.pose.orientation, marker.scale, marker.color
        assert np.linalg.norm([q.x, q.y, q.z, q.w]) == pytest.approx(1.0)
        assert min(scale.x, scale.y, scale.z) > 0.0
        assert 0.0 < color.a <= 1.0
        assert all(0.0 <= channel <= 1.0 for channel in (color.r, color.g, color.b))
        assert (marker.lifetime.sec, marker.lifetime.nanosec) == (0, 0)  # until DELETEALL
        assert not marker.frame_locked
        assert len(marker.points) % 2 == 0
        assert (marker.type == Marker.LINE_LIST) == bool(marker.points)


def test_cubes_are_the_boxes_and_lines_show_heading_and_velocity() -> None:
    table = boxes()
    _, *cubes, heading, velocity = read(table)
    for row, cube in zip(table, cubes, strict=True):
        position, q = cube.pose.position, cube.pose.orientation
        pose = matrix([position.x, position.y, position.z], [q.x, q.y, q.z, q.w])
        assert pose == pytest.approx(map_from_actors(row[None])[0], abs=1e-6)
        assert [cube.scale.x, cube.scale.y, cube.scale.z] == pytest.approx(list(row[["length", "width", "height"]]))
    ends = np.array([[point.x, point.y, point.z] for point in heading.points]).reshape(-1, 2, 3)
    for row, line in zip(table, ends, strict=True):
        half = np.array([row["length"], row["height"]]) / 2.0
        local = apply(inverse(map_from_actors(row[None])[0]), line)
        assert local == pytest.approx(np.array([[0, 0, half[1]], [half[0], 0, half[1]]]), abs=1e-5)
    ends = np.array([[point.x, point.y, point.z] for point in velocity.points]).reshape(-1, 2, 3)
    moving = table[np.hypot(table["vx"], table["vy"]) > 0.2]
    assert 0 < len(moving) < len(table)
    assert ends[:, 1] - ends[:, 0] == pytest.approx(np.stack([moving["vx"], moving["vy"], moving["vz"]], axis=1))


def test_without_boxes_only_the_old_markers_are_removed() -> None:
    assert [marker.action for marker in read(boxes(0))] == [Marker.DELETEALL]


def test_actors_have_their_own_color_and_signals_that_of_their_state() -> None:
    bus = actor(box_model(Tag.BUS, (11.0, 2.5, 3.2)), **EGO, roll=0.1, pitch=-0.2, color=0xFF8000)
    signals = np.zeros(2, SIGNAL_DTYPE)
    signals["id"], signals["x"], signals["state"] = [1, 2], [5.0, 6.0], [SignalState.RED, SignalState.GREEN]
    _, cube, heading, *lamps = deserialize_message(
        world_markers(bus, signals, np.zeros(0, STREET_LIGHT_DTYPE), STAMP_NS), MarkerArray
    ).markers
    assert (cube.ns, cube.id, cube.color.r, cube.color.g, cube.color.b) == (
        "bus",
        7,
        1.0,
        pytest.approx(128 / 255),
        0.0,
    )
    at, q = cube.pose.position, cube.pose.orientation
    pose = matrix([at.x, at.y, at.z], [q.x, q.y, q.z, q.w])
    assert pose == pytest.approx(map_from_actors(bus)[0] @ matrix([0.0, 0.0, 1.6], [0.0, 0.0, 0.0, 1.0]), abs=1e-6)
    assert heading.ns == "heading" and len(heading.points) == 2
    assert [(each.ns, each.id, each.type, each.pose.position.x) for each in lamps] == [
        ("traffic_light", 1, Marker.SPHERE, 5.0),
        ("traffic_light", 2, Marker.SPHERE, 6.0),
    ]
    red, green = (each.color for each in lamps)
    assert red.r > 0.8 > 0.5 > red.g and green.g > 0.7 > 0.5 > green.r


def test_a_traffic_light_that_is_off_is_dark() -> None:
    signals = np.zeros(1, SIGNAL_DTYPE)
    signals["state"] = SignalState.OFF
    made = world_markers(np.zeros(0, ACTOR_DTYPE), signals, np.zeros(0, STREET_LIGHT_DTYPE), STAMP_NS)
    _, ball = deserialize_message(made, MarkerArray).markers
    assert ball.ns == "traffic_light" and max(ball.color.r, ball.color.g, ball.color.b) < 0.25
