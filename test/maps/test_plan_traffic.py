"""Random vehicles and pedestrians travel through every built-in town without getting stuck."""

from collections.abc import Callable

import libsumo
import numpy as np
import pytest
from numpy.random import Generator

from simbev_ros.maps.parts import MapParts

VEHICLES = {
    "Blocks": 100,
    "Town01": 100,
    "Town02": 30,
    "Town03": 100,
    "Town04": 150,
    "Town05": 100,
    "Town06": 150,
    "Town07": 40,
    "Town10HD": 100,
    "Town13": 150,
    "Town15": 100,
}
FAST = "Town06"
"""The town of every test run; the others wait for the slow tests."""
NUM_PEDESTRIANS = 100  # in small towns at most two per vehicle
STEP_S, SPAWN_S, RUN_S = 0.1, 30.0, 60.0
MOVING_MPS = 0.5


@pytest.mark.parametrize(
    "town", [pytest.param(town, marks=() if town == FAST else pytest.mark.slow) for town in VEHICLES]
)
def test_traffic_flows_without_teleports_or_lasting_jams_and_with_few_collisions(
    town: str, built_town: Callable[[str], MapParts]
) -> None:
    net = built_town(town).net
    options = f"--step-length {STEP_S} --no-step-log --no-warnings --collision.action warn --collision.check-junctions"
    libsumo.start(["sumo", "-n", str(net), *options.split(), "--time-to-teleport", "85", "--seed", "1"])
    try:
        _populate(np.random.default_rng(0), VEHICLES[town])
        start_m: dict[str, float] = {}
        end_m: dict[str, float] = {}
        teleports, crashes, walkers_hit = 0, set(), set()
        for step in range(round((SPAWN_S + RUN_S) / STEP_S)):
            libsumo.simulationStep()
            teleports += libsumo.simulation.getStartingTeleportNumber()
            for hit in libsumo.simulation.getCollisions():
                if hit.colliderSpeed > MOVING_MPS:
                    (walkers_hit if hit.type == "crossing" else crashes).add(hit.collider)
            for vehicle in libsumo.vehicle.getIDList() if step * STEP_S >= SPAWN_S else ():
                end_m[vehicle] = libsumo.vehicle.getDistance(vehicle)
                start_m.setdefault(vehicle, end_m[vehicle])
    finally:
        libsumo.close()
    assert teleports == 0
    # Due to SUMO itself: pedestrians at green ignore turning vehicles, left-turning vehicles may misjudge a gap.
    assert (len(crashes) <= 1, len(walkers_hit) <= 2) == (True, True), (crashes, walkers_hit)
    assert len(end_m) > 0.9 * VEHICLES[town], "the roads have room for all vehicles"
    moved_m = np.array([end_m[vehicle] - start_m[vehicle] for vehicle in end_m])
    assert np.mean(moved_m > 10.0) > 0.9, "only vehicles at a red light stand for a minute"


def _allowed(edge: str) -> set[str]:
    """SUMO vehicle classes that may use at least one lane of an edge."""
    lanes = [f"{edge}_{index}" for index in range(libsumo.edge.getLaneNumber(edge))]
    allowed: set[str] = set()
    for lane in lanes:
        only = set(libsumo.lane.getAllowed(lane))
        allowed |= only or {"passenger", "pedestrian"} - set(libsumo.lane.getDisallowed(lane))
    return allowed


def _populate(rng: Generator, vehicles: int) -> None:
    """Insert vehicles and pedestrians with random origins and destinations within the first seconds."""
    edges = [edge for edge in libsumo.edge.getIDList() if not edge.startswith(":")]
    driving = [edge for edge in edges if "passenger" in _allowed(edge)]
    walking = [edge for edge in edges if "pedestrian" in _allowed(edge)]
    for number in range(vehicles):
        route: list[str] = []
        while len(route) < 8:
            start = route.pop() if route else str(rng.choice(driving))
            route += libsumo.simulation.findRoute(start, str(rng.choice(driving)), "DEFAULT_VEHTYPE").edges
        libsumo.route.add(f"r{number}", route)
        depart = f"{rng.uniform(0.0, SPAWN_S / 2.0):.1f}"
        libsumo.vehicle.add(
            f"v{number}", f"r{number}", depart=depart, departLane="best", departPos="random_free", departSpeed="0"
        )
    for number in range(min(NUM_PEDESTRIANS, 2 * vehicles)):
        start, end = (str(edge) for edge in rng.choice(walking, 2))
        stages = libsumo.simulation.findIntermodalRoute(start, end)
        if stages and all(stage.edges for stage in stages):
            libsumo.person.add(f"p{number}", start, 0.0, float(rng.uniform(0.0, SPAWN_S)))
            for stage in stages:
                libsumo.person.appendStage(f"p{number}", stage)
