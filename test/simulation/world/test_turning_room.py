"""Where vehicles turn round at the end of a road, one turns and the others wait behind it."""

import numpy as np
import pytest

from simbev_ros.simulation.world.driving.turning_room import TurningRoom
from simbev_ros.simulation.world.sumo.lanes_ahead import LaneProgress


class Queue:
    """Vehicles of 4 m on a road of 50 m with a dead end; each wants to turn there."""

    def __init__(self, *vehicles: tuple[str, float, str]) -> None:
        """From lane, position and next edge of each."""
        lanes, position_m, next_edges = zip(*vehicles, strict=True)
        self.progress = LaneProgress(lanes, np.array(position_m), next_edges)
        self.limits_mps: dict[int, float] = {}

    def limit_speed(self, vehicle: int, reason: str, speed_mps: float | None) -> None:
        self.limits_mps.pop(vehicle, None)
        if speed_mps is not None:
            self.limits_mps[vehicle] = speed_mps

    def room(self) -> TurningRoom:
        return TurningRoom({"there": "back"}, {"there": 50.0}, np.full(len(self.progress.lanes), 4.0), self)


FIRST, SECOND = ("there_0", 40.0, "back"), ("there_0", 25.0, "back")


def limits_mps(*vehicles: tuple[str, float, str]) -> dict[int, float]:
    """Speed limits of vehicles after one step."""
    queue = Queue(*vehicles)
    queue.room().hold_back()
    return queue.limits_mps


def test_the_first_may_turn_and_the_second_brakes_to_stop_seven_meters_before_the_end() -> None:
    # It comes to rest after v^2 / (2 a) = 50 m - 25 m - 7 m with a = 2 m/s^2.
    assert limits_mps(FIRST, SECOND) == {1: pytest.approx(np.sqrt(2.0 * 2.0 * 18.0))}


@pytest.mark.parametrize(
    "turning", [("there_0", 49.0, "back"), (":end_0_0", 1.0, "back"), ("back_0", 5.9, "onward"), ("back_1", 1.0, "")]
)
def test_all_wait_while_one_turns(turning: tuple[str, float, str]) -> None:
    assert set(limits_mps(FIRST, turning, SECOND)) == {0, 2}


@pytest.mark.parametrize(
    "gone", [("back_0", 6.1, "onward"), (":other_0_0", 1.0, "onward"), ("there_0", 49.0, "onward")]
)
def test_nobody_waits_for_those_who_do_not_turn_or_have_turned(gone: tuple[str, float, str]) -> None:
    assert set(limits_mps(FIRST, gone)) == set()


def test_a_limit_is_lifted_when_the_end_is_free() -> None:
    queue = Queue((":end_0_0", 1.0, "back"), FIRST)
    room = queue.room()
    room.hold_back()
    assert queue.limits_mps.keys() == {1}
    queue.progress = LaneProgress(("back_0", "there_0"), np.array([20.0, 43.0]), ("", "back"))
    room.hold_back()
    assert queue.limits_mps == {}
