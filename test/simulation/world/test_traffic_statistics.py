"""Statistics of the paper's scenes: what is drawn, who stands, and that traffic is steady while it is recorded."""

from collections import Counter
from functools import cache

import numpy as np
import pytest

from simbev_ros.config.load import load_scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.blueprints import blueprint_named, load_blueprints
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene, start_positions
from simbev_ros.simulation.world.simulation import Simulation

TOWN = "Town10HD"
SLOW_MPS, STANDING_MPS = 3.0, 0.1


def draw(seeds, **traffic):
    scenario, network = load_scenario("paper"), load_network(map_spec(TOWN))
    changed = {"traffic": scenario.traffic.model_copy(update=traffic)}
    scenario, starts = scenario.model_copy(update=changed), start_positions(scenario, network)
    return [
        draw_scene(scenario, PlannedScene(0, map_spec(TOWN), "train", seed=seed), network, starts) for seed in seeds
    ]


def test_shares_of_the_drawn_vehicles_are_the_papers():
    vehicles = [vehicle for spec in draw(range(30), pedestrians=0) for vehicle in spec.drivers[1:]]
    counts = Counter(blueprint_named(vehicle.blueprint).box_class for vehicle in vehicles)
    assert counts.total() > 4000
    assert counts["motorcycle"] / counts.total() == pytest.approx(0.074, abs=0.012)
    assert counts["bus"] / counts.total() == pytest.approx(0.017, abs=0.006)


@cache
def recorded():
    """(T, N) actors of the recorded ticks of a scene, every tenth tick, and (N,) their kinds of boxes."""
    (spec,) = draw([12], vehicles=220.0, pedestrians=220.0)
    with Simulation(spec, load_network(spec.map)) as simulation:
        states = [simulation.step().actors for _ in range(spec.warm_up_ticks + spec.ticks)]
    rows = np.stack(states[spec.warm_up_ticks :: 10])
    return rows, np.array([blueprint.box_class for blueprint in load_blueprints()])[rows["blueprint"][0]]


@pytest.mark.slow
def test_as_many_cars_are_slow_when_recording_starts_as_when_it_ends():
    rows, kinds = recorded()
    slow = np.hypot(rows["vx"], rows["vy"])[:, kinds == "car"] < SLOW_MPS
    first, second = (half.mean() for half in np.array_split(slow, 2))
    assert abs(second - first) < 0.1  # 0.15 after a warm-up of 4 s
    assert slow.mean() == pytest.approx(0.48, abs=0.15)


@pytest.mark.slow
def test_about_as_many_pedestrians_stand_as_in_the_paper():
    rows, kinds = recorded()
    standing = np.hypot(rows["vx"], rows["vy"])[:, kinds == "pedestrian"] < STANDING_MPS
    assert 0.09 < standing.mean() < 0.2  # 0.13 there; more in towns with many lights, as here
