"""The same seed gives the same scene: identical bytes in a process with another hash seed."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from world_scenes import blocks, run, scene

from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.build import load_network
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.state import Behavior
from simbev_ros.simulation.world.simulation import Simulation

_EVERYTHING = {
    "seed": 7,
    "scenes": [{"map": "Blocks", "train": 1}],
    "rig": Rig(sensors=()),
    "time": {"warm_up_s": 2, "duration_s": 8},
    "weather": {"precipitation": 0, "final": {"precipitation": 80}},
    "traffic": {"vehicles": 60, "pedestrians": 40, "reckless_probability": 0.5, "walker_cross_factor": 1},
    "hazards": {"count": 2},
}


def digest() -> str:
    """Digest of a scene with hazards, jaywalkers, collisions and rain, and of all its states."""
    scenario = Scenario.model_validate(_EVERYTHING)
    planned = next(planned_scenes(scenario))
    spec = draw_scene(scenario, planned, load_network(planned.map))
    states = run(spec)
    assert len(spec.hazards) == 2
    assert any(state.events for state in states)
    assert any(((state.actors["behavior"] & Behavior.JAYWALKING) > 0).any() for state in states)
    assert states[0].weather != states[-1].weather
    content = hashlib.sha256(spec.model_dump_json().encode())
    for state in states:
        content.update(state.actors.tobytes() + state.signals.tobytes() + repr((state.events, state.weather)).encode())
    return content.hexdigest()


def test_the_same_seed_gives_the_same_bytes_whatever_the_order_of_hashes():
    other = subprocess.run(
        [sys.executable, "-c", "from test_same_seed import digest; print(digest())"],
        env={**os.environ, "PYTHONHASHSEED": "1", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parent,
    )
    assert not other.returncode, other.stderr
    assert digest() == other.stdout.strip()


def test_a_scene_that_ends_with_a_collision_leaves_no_trace_in_the_next_one():
    spec = scene(vehicles=4, pedestrians=0, ticks=4)
    first = run(spec)
    with Simulation(spec, blocks()) as simulation:
        simulation.step()
        simulation._population.hold_crashed(0, np.array([5.0, 5.0, 0.0]), 0.0)
    assert [state.actors.tobytes() for state in run(spec)] == [state.actors.tobytes() for state in first]


def test_scenes_on_one_map_share_its_ground_and_have_the_bytes_that_they_have_alone():
    spec, grounds, states = scene(ticks=20), [], []
    for network in (load_network(spec.map), blocks(), blocks()):
        with Simulation(spec, network) as simulation:
            grounds.append(simulation._actors.ground)
            states.append([simulation.step().actors.tobytes() for _ in range(spec.warm_up_ticks + spec.ticks)])
    alone, first, second = grounds
    assert first is second and first is not alone
    assert states[0] == states[1] == states[2]
