"""Traffic still flows after a minute, on a town and on a net of SUMO's own."""

import subprocess

import numpy as np
import pytest
from world_scenes import of_kind

from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.recipe import known_maps
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.sumo.netconvert import sumo_home
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.scene.state import EGO_ID
from simbev_ros.world.simulation import Simulation

_MOVING_MPS = 0.5


def moving(map_name: str, seed: int) -> np.ndarray:
    """(T, V) whether each vehicle moves, over a minute; those that belong to accidents and works are left out."""
    spec = map_spec(map_name)
    scenario = Scenario.model_validate(
        {
            "seed": seed,
            "scenes": [{"map": map_name, "train": 1}],
            "rig": Rig(sensors=()),
            "time": {"tick_s": 0.1, "duration_s": 60},
            "ego": {"reckless_probability": 0},
            "traffic": {"vehicles": 60, "pedestrians": 20, "reckless_probability": 0},
        }
    )
    network = load_network(spec)
    scene = draw_scene(scenario, PlannedScene(0, spec, "train"), network)
    with Simulation(scene, network) as simulation:
        states = [simulation.step() for _ in range(scene.warm_up_ticks + scene.ticks)]
    rows = of_kind(np.stack([state.actors for state in states[scene.warm_up_ticks :]]), "vehicle")
    placed = [EGO_ID + index for index, vehicle in enumerate(scene.vehicles) if vehicle.stands_at is not None]
    rows = rows[:, ~np.isin(rows["id"][0], placed)]
    return np.hypot(rows["vx"], rows["vy"]) > _MOVING_MPS


@pytest.fixture(scope="module")
def grid_net(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("nets") / "grid.net.xml"
    options = "--grid --grid.number 5 --grid.length 120 --tls.guess --sidewalks.guess --crossings.guess"
    command = [sumo_home() / "bin/netgenerate", *options.split(), "-o", path]
    subprocess.run(command, check=True, capture_output=True, env={"SUMO_HOME": str(sumo_home())})
    return str(path)


def flows(map_name: str, seed: int) -> None:
    moves = moving(map_name, seed)
    assert moves.mean() > 0.5
    assert moves[-100:].mean() > 0.3  # nobody would, in a jam; small towns are nearly full with 60


@pytest.mark.parametrize("town", [True, False])
def test_at_least_half_of_the_vehicles_move_over_a_minute_and_none_stands_at_a_routes_end(town, grid_net):
    flows("Town07" if town else grid_net, seed=0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [41, 42, 43])
@pytest.mark.parametrize("town", sorted(known_maps()))
def test_no_town_is_jammed_after_a_minute(town, seed):
    flows(town, seed)
