"""Ticks are released in order with all due messages, in whatever order the sensors' messages arrive."""

from itertools import chain

import numpy as np
import pytest

from simbev_ros.ros.nodes.sensor_join import SensorJoin

PERIODS = {"lidar": 1, "radar": 2, "cam": 4}


def due(tick: int) -> dict[str, str]:
    return {sensor: f"{sensor} {tick}" for sensor, period in PERIODS.items() if tick % period == 0}


@pytest.mark.parametrize("seed", range(20))
def test_every_tick_is_released_once_in_order_with_all_due_messages(seed: int) -> None:
    rng = np.random.default_rng(seed)
    join: SensorJoin[str, str] = SensorJoin(PERIODS)
    streams = [
        [(None, tick) for tick in range(12)],
        *([(name, t) for t in range(0, 12, p)] for name, p in PERIODS.items()),
    ]
    released = []
    while any(streams):
        sender, tick = streams[rng.choice([k for k, stream in enumerate(streams) if stream])].pop(0)
        if sender is None:
            join.expect(tick, f"tick {tick}")
        else:
            join.add_message(sender, tick, f"{sender} {tick}")
        released += list(join.release())
    assert released == [(f"tick {tick}", due(tick)) for tick in range(12)]


def test_with_patience_a_tick_is_released_without_lost_messages_and_late_ones_are_dropped() -> None:
    join: SensorJoin[int, str] = SensorJoin({"lidar": 1}, patience_ticks=3)
    for tick in range(4):
        join.expect(tick, tick)
        if tick != 0:
            join.add_message("lidar", tick, f"lidar {tick}")
        if tick < 3:
            assert list(join.release()) == []
    assert list(join.release()) == [(0, {}), *((tick, {"lidar": f"lidar {tick}"}) for tick in (1, 2, 3))]
    join.add_message("lidar", 0, "late")
    join.expect(4, 4)
    join.add_message("lidar", 4, "lidar 4")
    assert list(join.release()) == [(4, {"lidar": "lidar 4"})]


def test_messages_of_skipped_ticks_are_removed() -> None:
    join: SensorJoin[int, str] = SensorJoin({"lidar": 1}, patience_ticks=3)
    for tick in range(9):
        join.add_message("lidar", tick, f"lidar {tick}")
    for tick in (2, 8):
        join.expect(tick, tick)
    assert list(chain(join.release())) == [(2, {"lidar": "lidar 2"}), (8, {"lidar": "lidar 8"})]
    assert not join._messages


def test_a_tick_does_not_wait_for_a_sensor_that_is_given_up() -> None:
    join: SensorJoin[int, str] = SensorJoin({"lidar": 1, "radar": 1})
    join.give_up(["radar", "cam"])
    join.expect(0, 0)
    join.add_message("lidar", 0, "cloud")
    assert list(join.release()) == [(0, {"lidar": "cloud"})]


def test_without_sensors_no_tick_waits() -> None:
    join: SensorJoin[int, str] = SensorJoin({})
    join.expect(7, 7)
    assert list(join.release()) == [(7, {})]


def test_only_the_first_message_of_a_tick_is_awaited() -> None:
    join: SensorJoin[int, str] = SensorJoin({"lidar": 1})
    assert join.is_awaited("lidar", 3) and not join.is_awaited("lidar", 10**6)
    join.add_message("lidar", 3, "first")
    assert not join.is_awaited("lidar", 3) and join.is_awaited("radar", 3)


def test_what_waits_is_bounded_although_somebody_sends_ticks_that_never_come() -> None:
    join: SensorJoin[int, str] = SensorJoin({"lidar": 1})
    for tick in range(0, 10**6, 100):
        join.add_message("lidar", tick, "forged")
    assert len(join._messages) <= 64
    join.add_message("lidar", 0, "forged again")
    join.expect(0, 0)
    assert list(join.release()) == [(0, {"lidar": "forged"})]
