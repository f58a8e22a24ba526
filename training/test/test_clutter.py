"""Things that are not road users stand where nothing else is, and rays end at them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cached_scene import write_cached_scene

from simbev_ros.baselines.grid import CELL_M, HALF_M
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray
from simbev_training.cache.reader import CachedScene, Sample
from simbev_training.training.clutter import add_clutter

LIDAR_M = np.array([0.4, 0.0, 1.8])


@pytest.fixture
def sample(tmp_path: Path) -> Sample:
    """A frame with a car and a person, and a lidar of 64 rings over flat ground before a wall that surrounds it."""
    elevation, azimuth = np.meshgrid(np.radians(np.linspace(-25, 5, 64)), np.linspace(-np.pi, np.pi, 1024, False))
    rays = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], -1)
    rays = rays.reshape(-1, 3)
    to_ground = np.where(rays[:, 2] < 0, -LIDAR_M[2] / np.minimum(rays[:, 2], -1e-9), np.inf)
    points_m = LIDAR_M + rays * np.minimum(to_ground, 60.0 / np.hypot(rays[:, 0], rays[:, 1]))[:, None]
    points_cm = np.rint(100 * points_m).astype(np.int16)
    plain = CachedScene(write_cached_scene(tmp_path)).sample(0, (0,))
    return replace(plain, sweeps_cm=(points_cm,), lidar_m=LIDAR_M)


def changed_of(sample: Sample, seed: int, mean: float = 30.0) -> tuple[AnyArray, AnyArray]:
    """(N, 3) points that things have moved, before and after, m."""
    [before] = sample.sweeps_cm
    assert before is not None
    [after] = add_clutter(sample, [before], mean, np.random.default_rng(seed))
    assert after.shape == before.shape
    moved = (before != after).any(1)
    return before[moved] / 100.0, after[moved] / 100.0


def test_rays_end_sooner_and_keep_their_directions(sample: Sample) -> None:
    before, after = (each - LIDAR_M for each in changed_of(sample, seed=1))
    assert len(before) > 300
    assert (np.linalg.norm(after, axis=1) < np.linalg.norm(before, axis=1) + 0.02).all()
    across = np.linalg.norm(np.cross(before, after), axis=1) / np.linalg.norm(before, axis=1)
    assert across.max() < 0.02  # rounded to cm


def test_things_stand_on_the_ground_off_the_road_and_away_from_objects(sample: Sample) -> None:
    boxes, road = sample.boxes, 1 << BEV_CLASSES.index("road")
    on_road, heights_m = [], []
    for seed in range(8):
        _, after = changed_of(sample, seed)
        for box in boxes:
            away_m = np.hypot(after[:, 0] - box["x"], after[:, 1] - box["y"])
            assert away_m.min() > np.hypot(box["length"], box["width"]) / 2 + 0.3
        row, column = np.floor((HALF_M - after[:, :2]) / CELL_M).astype(int).T
        on_road.append((sample.cells[row, column] & road) != 0)
        heights_m.append(after[:, 2])
    assert np.concatenate(on_road).mean() < 0.1  # what begins beside the road may reach into it
    assert np.concatenate(heights_m).min() > -0.6  # bushes are rough
    assert 1.0 < np.concatenate(heights_m).max() < 4.3


def test_the_same_draws_give_the_same_things_and_none_where_no_place_is_tried(sample: Sample) -> None:
    first, second = (changed_of(sample, seed=3)[1] for _ in range(2))
    assert np.array_equal(first, second)
    assert not len(changed_of(sample, seed=3, mean=0.0)[0])
