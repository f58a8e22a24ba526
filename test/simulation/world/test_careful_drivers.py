"""Collisions in whole scenes: careful drivers have none, reckless drivers do."""

import numpy as np
import pytest

from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.schema.scene.state import Behavior
from simbev_ros.simulation.world.simulation import Simulation


def collisions(map_name: str, seed: int, reckless: float) -> list[bool]:
    """For each collision of a scene, whether it involves a reckless driver."""
    scenario = Scenario.model_validate(
        {
            "seed": seed,
            "scenes": [{"map": map_name, "train": 1}],
            "rig": Rig(sensors=()),
            "time": {"duration_s": 14},
            "ego": {"reckless_probability": 0},
            "traffic": {"vehicles": 60, "pedestrians": 60, "reckless_probability": reckless},
        }
    )
    spec = map_spec(map_name)
    network = load_network(spec)
    scene = draw_scene(scenario, PlannedScene(0, spec, "train"), network)
    with Simulation(scene, network) as simulation:
        states = [simulation.step() for _ in range(scene.warm_up_ticks + scene.ticks)]
    rows = states[-1].actors
    by_id = dict(zip(rows["id"].tolist(), (rows["behavior"] & Behavior.RECKLESS) > 0, strict=True))
    events = [event for state in states for event in state.events if event.type == "collision"]
    return [bool(np.any([by_id[actor] for actor in event.ids])) for event in events]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("town", "seed"),
    [("Town01", 701), ("Town03", 702), ("Town05", 703), ("Town07", 704), ("Town10HD", 705), ("Town15", 706)],
)
def test_careful_drivers_have_no_collisions(town, seed):
    assert collisions(town, seed, 0.0) == []


@pytest.mark.slow
def test_reckless_drivers_have_collisions_and_careful_ones_only_with_them():
    involves_reckless = [each for seed in (710, 711, 712) for each in collisions("Town07", seed, 0.4)]
    assert involves_reckless
    assert all(involves_reckless)
