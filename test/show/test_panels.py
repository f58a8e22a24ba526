import numpy as np

from simbev_ros.drawing import panels
from simbev_ros.drawing.canvas import SURFACE
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.schema.palette import bev_color, semantic_color

POINTS = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("tag", "<u4")])


def test_depth_near_is_red_far_is_blue_and_sky_is_dark() -> None:
    near, far, sky = panels.depth_picture(np.array([[2.5, 150.0, np.inf]], np.float32), None, 3)[0].astype(int)
    assert near[0] > 150 > near[2]
    assert far[2] > far[0]
    assert sky.tolist() == list(SURFACE)


def test_opposite_flows_have_different_colors_and_none_is_dark() -> None:
    flow = np.array([[[9, 0], [-9, 0], [0, 0], [np.nan, np.nan]]], np.float32)
    right, left, none, invalid = panels.flow_picture(flow, None, 4)[0].astype(int)
    assert right[0] > right[2] and left[2] > left[0]
    assert none.tolist() == invalid.tolist() == list(SURFACE)


def test_instances_differ_and_pixels_without_actor_are_gray() -> None:
    picture = panels.instance_picture(np.array([[0, 1, 2, 60000]], np.uint16), np.full((1, 4, 3), 90, np.uint8), 4)[0]
    assert len(set(map(tuple, picture.tolist()))) == 4
    assert picture[0].tolist() == [42, 42, 42]


def test_labels_are_not_blended_when_a_large_image_is_thinned() -> None:
    tags = np.random.default_rng(0).integers(0, 29, (400, 400), np.uint8)
    picture = panels.semantic_picture(tags, None, 50)
    assert picture.shape == (100, 100, 3)
    assert set(map(tuple, picture.reshape(-1, 3).tolist())) <= set(map(tuple, semantic_color(np.arange(29)).tolist()))


def test_a_point_ahead_left_is_above_left_and_the_higher_one_is_seen() -> None:
    points = np.array([(40, 30, 2, Tag.TERRAIN), (40, 30, 0, Tag.ROAD), (500, 0, 0, Tag.ROAD)], POINTS)
    picture = panels.lidar_picture(points, np.eye(4), size_px=100, half_extent_m=50.0)
    empty = panels.lidar_picture(points[:0], np.eye(4), size_px=100, half_extent_m=50.0)
    ((row, column),) = np.unique(np.argwhere((picture != empty).any(-1)) // 2 * 2, axis=0).tolist()
    assert (row, column) == (10, 20)
    changed = picture[10:12, 20:22].reshape(-1, 3).max(axis=0).astype(int)
    assert np.abs(changed - semantic_color(np.array([Tag.TERRAIN]))[0]).max() < 60


def test_high_points_are_lighter_than_the_ground_and_hide_it() -> None:
    points = np.array([(40, 30, 5), (40, 30, 0), (20, -30, 0)], np.float32)
    picture = panels.heights_picture(points, 100, 50.0).astype(int)
    high, low = picture[10:12, 20:22].reshape(-1, 3).max(axis=0), picture[30:32, 80:82].reshape(-1, 3).max(axis=0)
    assert (high > low + 40).all() and (low > picture[60, 20]).all()


def test_radar_detections_are_rotated_by_their_pose_and_colored_by_doppler() -> None:
    rows = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("doppler_velocity", "<f4")])
    front, back = np.eye(4), np.diag([-1.0, -1.0, 1.0, 1.0])
    clouds = [
        (np.array([(40, 30, 0, -20), (20, -30, 0, 0)], rows), front),
        (np.array([(40, 30, 0, 20)], rows), back),
    ]
    picture = panels.radar_picture(clouds, size_px=100, half_extent_m=50.0).astype(int)
    ahead_left, ahead_right, behind_right = picture[11, 21], picture[31, 81], picture[91, 81]
    assert ahead_left[2] - ahead_left[0] > 100
    assert behind_right[0] - behind_right[2] > 100
    assert np.ptp(ahead_right) < 20 and ahead_right.min() > 80
    assert (
        panels.radar_picture([], 100, 50.0) == panels.lidar_picture(np.zeros(0, POINTS), np.eye(4), 100, 50.0)
    ).all()


def test_bev_keeps_its_orientation_and_its_ground_is_dark() -> None:
    labels = np.zeros((40, 40), np.uint16)
    labels[:10, :10] = 1 << BEV_CLASSES.index("car")
    picture = panels.bev_picture(labels, 80)
    assert picture.shape == (80, 80, 3)
    assert picture[5, 5].tolist() == bev_color(labels[:1, :1])[0, 0].tolist()
    assert picture[75, 75].tolist() == list(SURFACE)
