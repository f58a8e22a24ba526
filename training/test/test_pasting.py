"""Rare objects of another frame: they come with points, cells and boxes, only where there is room, and hide others."""

from dataclasses import replace

import numpy as np
import pytest

from simbev_ros.baselines.grid import CELL_M, CELLS, HALF_M
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_training.cache.layout import BOX_DTYPE
from simbev_training.cache.reader import Sample
from simbev_training.training.pasting import paste

AGES_S = (0.0, 0.5)
LIDAR = np.array([0.0, 0.0, 1.8])
ROAD, TRUCK, CAR = (1 << BEV_CLASSES.index(name) for name in ("road", "truck", "car"))
POSES = tuple(np.array([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, 0.2], [0, 0, 0, 1]], np.float64) for x in (4.0, 0.0))
LENGTH_M, WIDTH_M, HEIGHT_M = 8.0, 2.4, 3.0
PLACE = (18.0, 6.0, HEIGHT_M / 2)
YAW_RAD = 0.3
LIDAR_M = np.array([0.0, 0.0, 1.8])
SPEED_MPS = 6.0


def ground(z_m: float = 0.0) -> Float64Array:
    """(N, 3) points on a plane."""
    grid = np.stack(np.meshgrid(np.arange(-50, 50, 0.25), np.arange(-50, 50, 0.25)), -1).reshape(-1, 2)
    return np.column_stack([grid, np.full(len(grid), z_m)])


def truck_at(age_s: float) -> Float64Array:
    """(N, 3) points all over a truck that drives along its heading."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.5, 0.5, (4000, 3)) * (LENGTH_M, WIDTH_M, HEIGHT_M)
    points[:, 2] = np.maximum(points[:, 2], 0.2 - HEIGHT_M / 2)
    cosine, sine = np.cos(YAW_RAD), np.sin(YAW_RAD)
    rotation = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    return points @ rotation.T + PLACE - np.array([cosine, sine, 0]) * SPEED_MPS * age_s


def cells_of_truck() -> AnyArray:
    """(CELLS, CELLS) whether the center of a cell is below the truck."""
    center = HALF_M - (np.arange(CELLS) + 0.5) * CELL_M
    x, y = np.meshgrid(center - PLACE[0], center - PLACE[1], indexing="ij")
    along, across = np.cos(YAW_RAD) * x + np.sin(YAW_RAD) * y, np.cos(YAW_RAD) * y - np.sin(YAW_RAD) * x
    return (np.abs(along) <= LENGTH_M / 2) & (np.abs(across) <= WIDTH_M / 2)


def sample(points: list[Float64Array], cells: AnyArray, boxes: AnyArray) -> Sample:
    """A sample of two sweeps, whose points are given in the level frame of the newest."""
    level_from_map = np.linalg.inv(POSES[0])
    sweeps = []
    for level, pose in zip(points, POSES, strict=True):
        ego_from_level = np.linalg.inv(level_from_map @ pose)
        sweeps.append(np.rint((level @ ego_from_level[:3, :3].T + ego_from_level[:3, 3]) * 100).astype(np.int16))
    nothing = np.zeros((0, 3, 4), np.float32)
    return Sample(tuple(sweeps), POSES, (), nothing, np.zeros((0, 0, 0), np.float32), cells, boxes, LIDAR_M, 0.0)


@pytest.fixture
def target() -> Sample:
    cells = np.full((CELLS, CELLS), ROAD, np.uint16)
    return sample([ground(), ground()], cells, np.zeros(0, BOX_DTYPE))


@pytest.fixture
def donor() -> Sample:
    cells = np.full((CELLS, CELLS), ROAD, np.uint16)
    cells[cells_of_truck()] |= TRUCK
    box = np.zeros(1, BOX_DTYPE)
    box["x"], box["y"], box["z"] = PLACE
    box["length"], box["width"], box["height"], box["yaw"] = LENGTH_M, WIDTH_M, HEIGHT_M, YAW_RAD
    box["vx"], box["vy"] = SPEED_MPS * np.cos(YAW_RAD), SPEED_MPS * np.sin(YAW_RAD)
    box["class"], box["points"] = BOX_CLASSES.index("truck"), 4000
    return sample([np.concatenate([ground(), truck_at(age_s)]) for age_s in AGES_S], cells, box)


def test_an_object_comes_with_points_cells_and_box(target: Sample, donor: Sample) -> None:
    pasted = paste(target, donor, AGES_S).sample
    np.testing.assert_array_equal(pasted.boxes, donor.boxes)
    np.testing.assert_array_equal(pasted.cells, donor.cells)
    for points, theirs in zip(pasted.sweeps_cm, donor.sweeps_cm, strict=True):
        assert points is not None and theirs is not None
        np.testing.assert_allclose(points[-4000:], theirs[-4000:], atol=1)


def test_an_object_stands_on_the_ground_of_its_new_place(target: Sample, donor: Sample) -> None:
    lower = sample([ground(-0.6), ground(-0.6)], target.cells, target.boxes)
    pasted = paste(lower, donor, AGES_S).sample
    assert pasted.boxes["z"] == pytest.approx(donor.boxes["z"] - 0.6, abs=0.02)
    assert pasted.sweeps_cm[0] is not None and donor.sweeps_cm[0] is not None
    np.testing.assert_allclose(pasted.sweeps_cm[0][-4000:], donor.sweeps_cm[0][-4000:] - [0, 0, 60], atol=2)


def test_points_that_the_object_hides_are_gone_and_no_others(target: Sample, donor: Sample) -> None:
    pasted = paste(target, donor, AGES_S).sample
    assert pasted.sweeps_cm[0] is not None and target.sweeps_cm[0] is not None
    kept = {tuple(each) for each in pasted.sweeps_cm[0][:-4000].tolist()}
    before = target.sweeps_cm[0] / 100.0
    remains = np.array([tuple(each) in kept for each in target.sweeps_cm[0].tolist()])
    assert not remains[meets_truck(before, shrunk_m=0.6)].any()
    assert remains[~meets_truck(before, shrunk_m=-2.5)].all()
    assert 0.02 < 1 - remains.mean() < 0.2


@pytest.mark.parametrize("what", ["another object", "no ground seen", "other ground", "no older sweep"])
def test_without_room_nothing_changes(target: Sample, donor: Sample, what: str) -> None:
    cells = np.array(target.cells)
    if what == "another object":
        row, column = np.argwhere(cells_of_truck())[0]
        cells[row - 1, column] |= CAR
        target = replace(target, cells=cells)
    elif what == "no ground seen":
        target = sample([ground()[:1], ground()[:1]], cells, target.boxes)
    elif what == "other ground":
        target = replace(target, cells=np.zeros_like(cells))
    else:
        donor = replace(donor, sweeps_cm=(donor.sweeps_cm[0], None))
    pasted = paste(target, donor, AGES_S).sample
    assert len(pasted.boxes) == 0
    np.testing.assert_array_equal(pasted.cells, target.cells)
    for ours, theirs in zip(pasted.sweeps_cm, target.sweeps_cm, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def meets_truck(points: Float64Array, shrunk_m: float) -> AnyArray:
    """(N,) whether the lines of sight of (N, 3) points meet the truck, by many steps along each."""
    cosine, sine = np.cos(YAW_RAD), np.sin(YAW_RAD)
    meets = np.zeros(len(points), np.bool_)
    for share in np.linspace(0, 1, 200):
        x, y, z = (LIDAR + share * (points - LIDAR) - PLACE).T
        along, across = np.abs(cosine * x + sine * y), np.abs(cosine * y - sine * x)
        inside = (along < LENGTH_M / 2 - shrunk_m) & (across < WIDTH_M / 2 - shrunk_m)
        meets |= inside & (np.abs(z) < HEIGHT_M / 2 - shrunk_m)
    return meets
