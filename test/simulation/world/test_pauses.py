"""Pedestrians stand on sidewalks for a while: the drawn share of the time, and nowhere else."""

from functools import cache
from itertools import islice

import numpy as np
import pytest
import shapely
from world_scenes import TICK_S, blocks, of_kind, scene

from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.simulation.world.pedestrians.pauses import draw_pauses
from simbev_ros.simulation.world.simulation import Simulation

PEDESTRIANS = 60
SPEC = scene(vehicles=2, pedestrians=PEDESTRIANS, ticks=560, pedestrian_standing_share=0.4)


@cache
def pedestrians():
    """(T, P) pedestrians."""
    with Simulation(SPEC, blocks()) as simulation:
        return of_kind(np.stack([simulation.step().actors for _ in range(SPEC.ticks)]), "pedestrian")


def is_paused(spec, times_s, index):
    """(T,) whether a pedestrian's pauses cover these times with 2 s to both sides."""
    pauses_s = list(islice(draw_pauses(spec, index), 40))
    return np.any([(start_s + 2.0 < times_s) & (times_s < end_s - 2.0) for start_s, end_s in pauses_s], axis=0)


@pytest.mark.parametrize("share", [0.1, 0.4, 1.0])
def test_pauses_take_their_share_of_the_time_from_the_start_on(share):
    spec = SPEC.model_copy(update={"pedestrian_standing_share": share})
    times_s = np.arange(0.5, 100.0)
    pauses_s = [np.array(list(islice(draw_pauses(spec, index), 60))) for index in range(1500)]
    paused = [((each[:, :1] <= times_s) & (times_s < each[:, 1:])).any(axis=0) for each in pauses_s]
    for part in np.split(np.mean(paused, axis=0), [5, 10, 20, 50]):
        assert part.mean() == pytest.approx(share, abs=0.03)


def test_without_a_share_nobody_pauses():
    assert not list(draw_pauses(scene(pedestrians=1), 0))


def test_pedestrians_stand_during_their_pauses_and_walk_on_afterwards():
    rows = pedestrians()
    speed_mps, times_s = np.hypot(rows["vx"], rows["vy"]), np.arange(len(rows)) * TICK_S
    paused = np.stack([is_paused(SPEC, times_s, index) for index in range(PEDESTRIANS)], axis=1)
    assert 0.2 < paused.mean() < 0.4
    assert np.mean(speed_mps[paused] < 0.02) > 0.9  # the others are on a crosswalk when they are to pause
    assert np.mean(speed_mps[~paused] < 0.02) < 0.35
    moved_m = np.hypot(rows["x"][-1] - rows["x"][0], rows["y"][-1] - rows["y"][0])
    assert np.mean(moved_m[paused.any(axis=0)] > 1.0) > 0.8


def test_nobody_pauses_on_a_crosswalk():
    rows = pedestrians()
    crossing = surfaces_of(blocks().layout).crosswalk.buffer(-0.5)
    on_crossing = shapely.contains_xy(crossing, rows["x"].astype(float), rows["y"].astype(float))
    assert on_crossing.any()
    standing = np.hypot(rows["vx"], rows["vy"]) < 0.02
    assert np.mean(standing[on_crossing]) < 0.02
