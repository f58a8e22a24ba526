"""Tests of labels on the ground, against the intersection of each pixel's ray with the ground."""

import numpy as np
import pytest

from simbev_ros.foundation.geometry.camera import LensCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, apply, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.foundation.types import Float64Array, UInt16Array
from simbev_ros.schema.palette import bev_color
from simbev_ros.show.sheet.ground_tint import ground_labels, tint_ground
from simbev_ros.show.sheet.truth import Truth

CAMERA = LensCamera(96, 64, 70.0, 66.0, 45.0, 30.0, (-0.2, 0.04, 0.002, -0.001, 0.0))
EGO_FROM_OPTICAL = matrices_from_xyz_rpy(np.array([0.6, -0.3, 1.6]), np.array([0.05, 0.12, 0.3])) @ SENSOR_FROM_OPTICAL
MAP_FROM_EGO = matrices_from_xyz_rpy(np.array([40.0, -7.0, 2.0]), np.array([0.02, -0.03, 2.1]))
MAP_FROM_GRID = matrices_from_xyz_rpy(np.array([39.0, -7.5, 2.0]), np.array([0.0, 0.0, 2.0]))
CELL_M = 0.5
SIZE_PX = (96, 64)
ROAD, LINE, CAR = (np.uint16(1 << BEV_CLASSES.index(name)) for name in ("road", "road_line", "car"))


def truth(labels: UInt16Array) -> Truth:
    return Truth(MAP_FROM_EGO, None, labels, MAP_FROM_GRID)


def cells_by_hand() -> tuple[Float64Array, Float64Array]:
    """Intersections of the pixels' rays with the ego's plane.

    Returns:
        (N, 2) row and column of each pixel that looks down, and (N, 2) row and column of the intersection in the grid,
        in cells from its corner.
    """
    pixels = np.argwhere(np.ones((CAMERA.height_px, CAMERA.width_px)))
    rays = CAMERA.rays(pixels[:, ::-1].astype(float)) @ EGO_FROM_OPTICAL[:3, :3].T
    pixels, rays = pixels[rays[:, 2] < 0], rays[rays[:, 2] < 0]
    points_ego = EGO_FROM_OPTICAL[:3, 3] - rays * (EGO_FROM_OPTICAL[2, 3] / rays[:, 2:])
    points_grid = apply(inverse(MAP_FROM_GRID) @ MAP_FROM_EGO, points_ego)
    return pixels, (np.array([10.0, 8.0]) - points_grid[:, :2]) / CELL_M  # the grid is 20 m by 16 m


def test_each_pixel_has_the_label_of_the_cell_that_its_ray_meets() -> None:
    labels = np.random.default_rng(0).integers(0, 8, (40, 32)).astype(np.uint16)
    pixels, cells = cells_by_hand()
    clear = (np.abs(cells - np.rint(cells)) > 1e-3).all(axis=1)
    inside = ((cells >= 0) & (cells < labels.shape)).all(axis=1)
    expected = np.zeros((CAMERA.height_px, CAMERA.width_px), np.uint16)
    expected[tuple(pixels[inside].T)] = labels[tuple(np.floor(cells[inside]).astype(int).T)]
    found = ground_labels(CAMERA, EGO_FROM_OPTICAL, truth(labels), CELL_M, SIZE_PX)
    compared = np.ones(found.shape, bool)
    compared[tuple(pixels[~clear].T)] = False
    assert inside.sum() > 1500 and compared.mean() > 0.98
    assert (found == expected)[compared].all()
    assert (ground_labels(CAMERA, EGO_FROM_OPTICAL, truth(labels), CELL_M, (32, 64)) == found[:, 1::3]).all()


def test_with_depth_only_ground_pixels_have_a_label() -> None:
    labels = np.full((200, 200), ROAD)
    everywhere = ground_labels(CAMERA, EGO_FROM_OPTICAL, truth(labels), CELL_M, SIZE_PX)
    wall_m = np.full((64, 96), 4.0, np.float32)  # a wall across the view: the ground is seen only in front of it
    flat_m = np.full((64, 96), np.inf)
    rays = CAMERA.rays(np.stack(np.meshgrid(np.arange(96), np.arange(64)), axis=-1).reshape(-1, 2).astype(float))
    fall = -(rays @ EGO_FROM_OPTICAL[2, :3]).reshape(64, 96)
    flat_m[fall > 0] = EGO_FROM_OPTICAL[2, 3] / fall[fall > 0]
    depth_m = np.minimum(wall_m, flat_m).astype(np.float32)
    found = ground_labels(CAMERA, EGO_FROM_OPTICAL, truth(labels), CELL_M, SIZE_PX, depth_m=depth_m)
    height_m = EGO_FROM_OPTICAL[2, 3] - fall * depth_m
    assert (found[flat_m < 4.0] == ROAD).all()
    assert (found[height_m > 0.7] == 0).all()
    assert (everywhere[(flat_m > 4.0) & (flat_m < 40.0)] == ROAD).all()


def test_cells_with_objects_are_tinted_only_where_tags_show_ground() -> None:
    labels = np.full((200, 200), ROAD | CAR)
    assert not ground_labels(CAMERA, EGO_FROM_OPTICAL, truth(labels), CELL_M, SIZE_PX).any()
    tags = np.full((64, 96), Tag.CAR, np.uint8)
    tags[50:] = Tag.ROAD
    found = ground_labels(CAMERA, EGO_FROM_OPTICAL, truth(labels), CELL_M, SIZE_PX, tags=tags)
    assert not found[:50].any() and (found[50:] == ROAD | CAR).all()


def test_a_tint_changes_labeled_pixels_toward_their_color() -> None:
    picture = np.full((1, 3, 3), 100, np.uint8)
    tinted = tint_ground(picture, np.array([[0, ROAD, ROAD | LINE]], np.uint16))[0].astype(float)
    assert tinted[0].tolist() == [100, 100, 100]
    for pixel, label in ((tinted[1], ROAD), (tinted[2], ROAD | LINE)):
        color = bev_color(np.array([label]))[0].astype(float)
        share = (pixel - 100) / (color - 100)
        assert share == pytest.approx(share[0], abs=0.06) and 0.3 < share[0] < 0.8
