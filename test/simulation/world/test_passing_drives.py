"""The driver that knows the truth meets a vehicle that stands in its lane, in the world that the suite drives in."""

import json
import math

import numpy as np
import pytest
from event_scenes import event_scene
from world_scenes import NOON, blocks

from simbev_ros.baselines.driving import drivers
from simbev_ros.evaluation.driving.drive_record import DriveRecord
from simbev_ros.evaluation.driving.referee import Referee
from simbev_ros.schema.scene.state import ACTOR_DTYPE
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


def test_an_open_door_belongs_to_its_vehicle_on_its_side() -> None:
    rows = np.zeros(3, ACTOR_DTYPE)
    rows["id"], rows["yaw"], rows["length"], rows["width"] = range(2, 5), np.pi / 2.0, 4.0, 2.0
    rows["doors"] = 0, 0b0100, 0b1111
    found = drivers._actors(rows)
    np.testing.assert_allclose(found.size_m, [[4.0, 2.0], [4.0, 2.95], [4.0, 3.9]])
    np.testing.assert_allclose(found.position_m, [[0.0, 0.0], [-0.475, 0.0], [0.0, 0.0]], atol=1e-6)


def test_what_is_on_a_bridge_over_the_route_or_below_it_does_not_concern_the_driver() -> None:
    spec = event_scene("blocked_lane", NORTH, 1, ticks=20)
    driver, route = drivers.RouteDriver(drivers.DriverKind.TRUTH, json.loads(spec.model_dump_json())), spec.drive.route
    rows = np.zeros(3, ACTOR_DTYPE)
    rows["id"], rows["x"], rows["y"] = range(2, 5), route.x_m[20], route.y_m[20]
    rows["z"] = np.array([0.0, 5.0, -5.0]) + route.z_m[20]
    assert driver._level_with_route(rows, 0.0)["id"].tolist() == [2]


def test_the_driver_counts_on_the_least_grip_of_the_scene() -> None:
    wet, snowy = (NOON.model_copy(update=each).model_dump() for each in ({"wetness": 100}, {"snow_cover": 100}))
    assert drivers._grip({"weather": NOON.model_dump(), "final_weather": None}) == 1.0
    assert drivers._grip({"weather": wet, "final_weather": NOON.model_dump()}) == pytest.approx(0.7)
    assert drivers._grip({"weather": wet, "final_weather": snowy}) == pytest.approx(0.25)
