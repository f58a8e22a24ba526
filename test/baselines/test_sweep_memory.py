"""Frames get the sweeps of 1/4, 1/2, 1 and 2 seconds before, with the poses of their own stamps."""

import numpy as np
import pytest

from simbev_ros.baselines.node.sweeps import Sweep, SweepMemory, points_in_ego
from simbev_ros.schema.points import POINT_DTYPE

MS = 1_000_000


def memory_of(*stamps_ms: int) -> SweepMemory:
    memory = SweepMemory([0, 250 * MS, 500 * MS, 1000 * MS, 2000 * MS])
    for stamp_ms in stamps_ms:
        memory.add(Sweep(stamp_ms * MS, np.zeros((0, 3), np.float32), np.eye(4)))
    return memory


def stamps_ms(memory: SweepMemory, stamp_ms: int) -> list[int | None]:
    return [None if sweep is None else sweep.stamp_ns // MS for sweep in memory.of_frame(stamp_ms * MS)]


def test_a_frame_gets_its_own_sweep_and_those_nearest_to_the_ages_that_models_know() -> None:
    assert stamps_ms(memory_of(*range(0, 2050, 50)), 2000) == [2000, 1750, 1500, 1000, 0]
    assert stamps_ms(memory_of(*range(0, 2100, 100)), 2000) == [2000, 1700, 1500, 1000, 0]
    assert stamps_ms(memory_of(1500, 1750, 2000), 2000) == [2000, 1750, 1500, None, None]


def test_the_first_frames_have_fewer_sweeps() -> None:
    assert stamps_ms(memory_of(0), 0) == [0, None, None, None, None]
    assert stamps_ms(memory_of(0, 250), 250) == [250, 0, None, None, None]


def test_sweeps_are_forgotten_when_time_goes_back() -> None:
    assert stamps_ms(memory_of(1500, 1750, 2000, 0), 0) == [0, None, None, None, None]


def test_old_sweeps_do_not_fill_the_memory() -> None:
    memory = memory_of(*range(0, 10_000, 50))
    assert len(memory._sweeps) <= 46


def test_finite_points_come_to_the_ego_frame() -> None:
    cloud = np.zeros(3, POINT_DTYPE)
    cloud["x"], cloud["y"], cloud["z"] = [1.0, np.nan, 3.0], [2.0, 0.0, 0.0], 0.5
    ego_from_lidar = np.array([[0.0, -1, 0, 0.3], [1, 0, 0, 0], [0, 0, 1, 1.8], [0, 0, 0, 1]])  # turned left
    points = points_in_ego(cloud, ego_from_lidar)
    assert points.dtype == np.float32
    assert points == pytest.approx(np.array([[-1.7, 1.0, 2.3], [0.3, 3.0, 2.3]]), abs=1e-6)


def test_a_cloud_without_coordinates_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="no field of name x"):
        points_in_ego(np.zeros(1, np.dtype([("intensity", "f4")])), np.eye(4))
