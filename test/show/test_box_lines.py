"""Tests of boxes as lines, against OpenCV's projection and against points sampled along the edges."""

from itertools import combinations, product

import cv2
import numpy as np
import pytest
from box_tables import box

from simbev_ros.drawing.box_lines import MIN_DEPTH_M, box_outlines, front_faces, wireframes
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array, Table

LENS = LensCamera(640, 480, 400.0, 390.0, 310.0, 250.0, (-0.25, 0.06, 0.003, -0.002, 0.0))
FISHEYE = FisheyeCamera(640, 480, 185.0, 180.0, 310.0, 250.0, (0.02, -0.004, 0.001, 0.0), float(np.radians(97.0)))
PINHOLE = PinholeCamera(640, 480, 400.0, 390.0, 310.0, 250.0)
OPTICAL_FROM_MAP = inverse(SENSOR_FROM_OPTICAL)  # at the origin, looking along x
TILTED = inverse(matrices_from_xyz_rpy(np.array([-1.0, 0.4, 1.2]), np.array([0.1, -0.06, 0.2])) @ SENSOR_FROM_OPTICAL)


def edges_m(row: Table, step: int) -> Float64Array:
    """(13, step, 3) points along the edges and the heading of one box without roll and pitch, map frame."""
    cos, sin = np.cos(float(row["yaw"][0])), np.sin(float(row["yaw"][0]))
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    half = np.array([row["length"][0], row["width"][0], row["height"][0]]) / 2.0
    corners = np.array(list(product((-1.0, 1.0), repeat=3)))
    pairs = [(a, b) for a, b in combinations(corners, 2) if np.abs(a - b).sum() == 2]
    pairs.append((np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, -1.0])))
    share = np.linspace(0, 1, step)[:, None]
    along = np.array([a * (1 - share) + b * share for a, b in pairs])
    return along * half @ turn.T + [float(row[axis][0]) for axis in "xyz"]


def opencv_pixels(points_m: Float64Array, optical_from_map: Float64Array, camera: PinholeCamera) -> Float64Array:
    turn, _ = cv2.Rodrigues(optical_from_map[:3, :3])
    bend = np.array(camera.distortion if isinstance(camera, LensCamera) else [0.0] * 5)
    pixels, _ = cv2.projectPoints(points_m.reshape(-1, 1, 3), turn, optical_from_map[:3, 3], camera.matrix, bend)
    return np.asarray(pixels.reshape(-1, 2), np.float64)


@pytest.mark.parametrize("camera", [PINHOLE, LENS])
def test_edges_are_where_opencv_projects_them(camera: PinholeCamera) -> None:
    row = box(12.0, -2.5, 0.3, yaw=0.7)
    lines = wireframes(row, camera, TILTED)
    expected = opencv_pixels(edges_m(row, 13), TILTED, camera)
    ends = lines.pixels.reshape(-1, 2)
    miss_px = np.linalg.norm(expected[:, None] - ends[None], axis=2).min(axis=1)
    assert miss_px.max() < 1e-3  # sizes and angles of boxes are float32
    assert len(lines.row) == 13 * 12, "twelve edges and the heading"


@pytest.mark.parametrize("camera", [PINHOLE, LENS, FISHEYE])
@pytest.mark.parametrize(
    "row",
    [
        box(1.0, 2.0, 0.0, size=(12, 2.5, 3)),  # beside the camera, reaches behind it
        box(0.5, 0.2, -1.5, yaw=0.4, size=(5, 2, 1)),  # below it
        box(3.0, -5.0, 1.0, yaw=2.0, size=(9, 2, 3)),
    ],
)
def test_only_the_part_of_a_box_in_front_of_the_camera_is_drawn(camera: PinholeCamera, row: Table) -> None:
    lines = wireframes(row, camera, OPTICAL_FROM_MAP)
    optical = edges_m(row, 4001).reshape(-1, 3) @ OPTICAL_FROM_MAP[:3, :3].T
    in_front = camera.depth_m(optical) > MIN_DEPTH_M
    pixels = camera.project(optical[in_front])
    inner = optical[in_front, 2] > np.cos(np.radians(94.0)) * camera.depth_m(optical[in_front])  # not cut by the rim
    seen = ((pixels > -0.5) & (pixels < [camera.width_px - 0.5, camera.height_px - 0.5])).all(axis=1)
    start, end = lines.pixels[:, 0], lines.pixels[:, 1]
    assert seen.sum() > 100
    for pixel in pixels[seen & inner][::37]:
        assert distance_px(pixel, start, end).min() < 1.0, "what is seen is drawn"
    middle = lines.pixels.mean(axis=1)
    inside = ((middle > 0) & (middle < [camera.width_px - 1, camera.height_px - 1])).all(axis=1)
    for pixel in middle[inside]:
        assert np.linalg.norm(pixels[seen] - pixel, axis=1).min() < 3.0, "what is drawn is seen"


def distance_px(pixel: Float64Array, start: Float64Array, end: Float64Array) -> Float64Array:
    along = end - start
    share = ((pixel - start) * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12)
    nearest = start + np.clip(share, 0, 1)[:, None] * along
    return np.asarray(np.linalg.norm(nearest - pixel, axis=1), np.float64)


@pytest.mark.parametrize("camera", [PINHOLE, LENS])
def test_boxes_behind_or_far_to_the_side_draw_nothing(camera: PinholeCamera) -> None:
    rows = np.concatenate([box(-8.0, 0.0, 0.0), box(1.0, 300.0, 0.0), box(2.0, 0.0, 90.0), box(-50.0, 3.0, 1.0)])
    assert len(wireframes(rows, camera, OPTICAL_FROM_MAP).row) == 0
    assert len(front_faces(rows[[0, 3]], camera, OPTICAL_FROM_MAP)[1]) == 0


def test_only_front_faces_toward_the_camera_are_returned() -> None:
    rows = np.concatenate(
        [box(15.0, 2.0, 0.0, yaw=0.0), box(15.0, -2.0, 0.0, yaw=np.pi), box(1.0, 1.5, 0.0, yaw=np.pi)]
    )
    pixels, row = front_faces(rows, PINHOLE, OPTICAL_FROM_MAP)
    assert row.tolist() == [1], "the first looks away, the front of the third is behind the camera"
    assert pixels[0] == pytest.approx(
        opencv_pixels(
            np.array([[13, -3, -0.75], [13, -3, 0.75], [13, -1, 0.75], [13, -1, -0.75]]), OPTICAL_FROM_MAP, PINHOLE
        )
    )


def test_from_above_left_is_left_and_ahead_is_ahead() -> None:
    map_from_ego = matrices_from_xyz_rpy(np.array([100.0, 50.0, 3.0]), np.array([0.0, 0.0, np.pi / 2]))
    row = box(95.0, 60.0, 3.0, yaw=np.pi / 2, size=(4, 2, 1.5))  # 10 m ahead, 5 m left, looks as the ego does
    outline = box_outlines(row, inverse(map_from_ego))[0]
    assert outline == pytest.approx(np.array([[12, 6], [8, 6], [8, 4], [12, 4], [10, 5], [12, 5]]), abs=1e-5)
