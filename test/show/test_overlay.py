"""Tests of boxes drawn over pictures."""

import numpy as np
import pytest
from box_tables import box

from simbev_ros.config.camera import Camera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.types import BoolArray, Float32Array, Table, UInt8Array
from simbev_ros.show.sheet.overlay import draw_boxes_from_above, draw_wireframes

CAMERA = Camera(
    type="camera",
    name="cam",
    width_px=320,
    height_px=180,
    fx_px=200.0,
    distortion=(-0.2, 0.04, 0.002, 0.0, 0.0),
)
OPTICAL_FROM_MAP = inverse(
    matrices_from_xyz_rpy(np.array([0.0, 0.0, 1.6]), np.array([0.03, 0.05, 0.1])) @ SENSOR_FROM_OPTICAL
)


def drawn(rows: Table, depth_m: Float32Array | None = None, size: int = 1) -> BoolArray:
    picture = np.zeros((180 * size, 320 * size, 3), np.uint8)
    draw_wireframes(picture, rows, CAMERA.model, OPTICAL_FROM_MAP, depth_m, 1.0)
    return np.asarray(picture.max(axis=-1) > 60, bool)


def seen_depth_m(row: Table) -> Float32Array:
    """Depth image of one upright box, by ray-slab intersection."""
    pixels = np.stack(np.meshgrid(np.arange(320), np.arange(180)), axis=-1).reshape(-1, 2)
    map_from_optical = inverse(OPTICAL_FROM_MAP)
    cos, sin = np.cos(float(row["yaw"][0])), np.sin(float(row["yaw"][0]))
    box_from_map = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    rays = CAMERA.model.rays(pixels.astype(float)) @ map_from_optical[:3, :3].T @ box_from_map.T
    origin = box_from_map @ (map_from_optical[:3, 3] - [float(row[axis][0]) for axis in "xyz"])
    half = np.array([float(row[name][0]) for name in ("length", "width", "height")]) / 2
    a, b = (-half - origin) / rays, (half - origin) / rays
    enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    return np.where((enter > 0) & (enter < leave), enter, np.inf).astype(np.float32).reshape(180, 320)


@pytest.mark.parametrize("size", [1, 3])
def test_a_wireframe_encloses_the_pixels_of_its_object(size: int) -> None:
    row = box(14.0, 2.0, 0.8, yaw=0.6)
    depth_m = seen_depth_m(row)
    thing = np.argwhere(np.isfinite(depth_m))
    lines = np.argwhere(drawn(row, depth_m, size)) / size
    assert len(thing) > 500
    assert lines.min(axis=0) == pytest.approx(thing.min(axis=0), abs=1.5)
    assert lines.max(axis=0) == pytest.approx(thing.max(axis=0), abs=1.5)


def test_occluded_lines_are_faint_and_fully_occluded_boxes_are_not_drawn() -> None:
    row = box(14.0, 0.0, 0.8)
    full = drawn(row)
    assert full.any()
    assert not drawn(row, np.full((180, 320), 6.0, np.float32)).any()
    half_m = np.full((180, 320), np.inf, np.float32)
    edge = int(np.argwhere(full)[:, 1].mean())
    half_m[:, :edge] = 6.0
    picture = np.zeros((180, 320, 3), np.uint8)
    draw_wireframes(picture, row, CAMERA.model, OPTICAL_FROM_MAP, half_m, 1.0)
    left, right = picture[:, : edge - 3], picture[:, edge + 3 :]
    assert 0 < left.max() < 0.6 * right.max()


@pytest.mark.parametrize(
    ("visibility", "shown"), [(0.0, False), (0.04, False), (0.06, True), (1.0, True), (np.nan, True)]
)
def test_boxes_with_low_visibility_are_left_out(visibility: float, shown: bool) -> None:
    assert drawn(box(14.0, 0.0, 0.8, visibility=visibility)).any() == shown


def test_no_boxes_draw_nothing() -> None:
    assert not drawn(box(14.0, 0.0, 0.8)[:0]).any()


def top_view(rows: Table, faint_without: str = "lidar_points") -> UInt8Array:
    picture = np.zeros((200, 200, 3), np.uint8)
    draw_boxes_from_above(picture, rows, np.eye(4), half_extent_m=50.0, line_px=1.0, faint_without=faint_without)
    return picture


def test_a_box_ahead_left_is_above_left_and_its_tick_points_forward() -> None:
    rows, columns = np.nonzero(top_view(box(30.0, 20.0, 0.0, size=(8, 4, 2))).any(axis=-1))
    assert (rows.min(), rows.max()) == pytest.approx((32, 48), abs=1.1)  # 2 pixels per meter, x = 50 is the upper edge
    assert (columns.min(), columns.max()) == pytest.approx((56, 64), abs=1.1)
    middle = top_view(box(30.0, 20.0, 0.0, size=(8, 4, 2)))[:, 59:61].any(axis=(1, 2))
    assert middle[34:39].all() and not middle[42:46].any()
    turned = top_view(box(30.0, 20.0, 0.0, yaw=np.pi / 2, size=(8, 4, 2)))[39:41].any(axis=(0, 2))
    assert turned[53:59].all() and not turned[63:66].any(), "a yaw to the left points to the left"


def test_boxes_without_sensor_points_are_faint_from_above() -> None:
    strong, unknown, faint = (top_view(box(30.0, 20.0, 0.0, lidar_points=n)).max() for n in (5, -1, 0))
    assert strong == unknown and 0 < faint < 0.5 * strong
