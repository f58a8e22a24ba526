"""The driver that knows the truth meets a vehicle that stands in its lane, in the world that the suite drives in."""

import json
import math

import numpy as np
import pytest
from event_scenes import event_scene
from world_scenes import blocks

from simbev_ros.baselines.driving import drivers
from simbev_ros.evaluation.driving.drive_record import DriveRecord
from simbev_ros.evaluation.driving.referee import Referee
from simbev_ros.simulation.world.driving.commands import TrajectoryCommand
from simbev_ros.simulation.world.simulation import Simulation

NORTH = ("grid.ns2.0.0", "grid.ns2.0.1")
DELAY_TICKS = 3


def drive() -> DriveRecord:
    """Drive the whole route, or for 40 s."""
    spec = event_scene("blocked_lane", NORTH, 1, ticks=800)
    spec = spec.model_copy(update={"agents": (spec.agents[0].model_copy(update={"driver": "path"}),)})
    driver = drivers.RouteDriver(drivers.DriverKind.TRUTH, json.loads(spec.model_dump_json()))
    referee, plans = Referee(spec, blocks()), []
    with Simulation(spec, blocks()) as simulation:
        for _ in range(spec.warm_up_ticks + spec.ticks):
            if len(plans) > DELAY_TICKS:
                simulation.follow_command(0, plans[-1 - DELAY_TICKS])
            state = simulation.step()
            if state.tick < 0:
                continue
            referee.judge(state)
            if referee.record.completed > 0.95:
                break
            row = state.ego
            pose, speed_mps = np.array([row["x"], row["y"], row["yaw"]], float), math.hypot(row["vx"], row["vy"])
            positions_m = driver.positions(pose, speed_mps, state.actors, None, state.signals)
            stamps_ns = state.stamp_ns + np.arange(len(positions_m)) * spec.tick_ns
            plans.append(TrajectoryCommand(stamps_ns, positions_m))
    return referee.record


def test_a_blocked_lane_is_passed_without_an_infraction() -> None:
    record = drive()
    assert record.completed > 0.95
    assert not record.infractions


@pytest.mark.slow
def test_without_a_lane_beside_it_the_driver_stands_behind_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drivers, "_lanes_beside", lambda *_: np.empty((0, 0)))
    record = drive()
    assert record.completed < 0.8
    assert not record.infractions
