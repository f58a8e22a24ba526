"""A vehicle that follows commands in the simulation: its published motion is that of its model, and wet roads slip."""

import numpy as np
import pytest

from simbev_ros.config.agents import Ego
from simbev_ros.config.load import load_scenario
from simbev_ros.config.traffic import Traffic
from simbev_ros.config.weather import WeatherConfig
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.simulation.world.driving.commands import AckermannCommand
from simbev_ros.simulation.world.simulation import Simulation

PLANNED = PlannedScene(3, MapSpec(name="Blocks"), "train")
SETTLING_TICKS = 4
"""Ticks by which published poses follow the model: three for the ground below the wheels, one for the derivatives."""


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    return load_network(PLANNED.map)


def simulation(network: RoadNetwork, wetness: float = 0.0) -> tuple[Simulation, int]:
    """A simulation whose ego follows commands, and the number of its warm-up ticks."""
    weather = WeatherConfig.model_validate({"wetness": wetness, "precipitation_deposits": 0.0})
    changes = {
        "ego": Ego(driver="ackermann"),
        "traffic": Traffic(vehicles=0, pedestrians=0),
        "weather": weather,
    }
    spec = draw_scene(load_scenario("paper").model_copy(update=changes), PLANNED, network)
    return Simulation(spec, network), spec.warm_up_ticks


def test_published_motion_is_that_of_the_model_a_few_ticks_later(network: RoadNetwork) -> None:
    half_m = blueprint_named("vehicle.sedan").wheelbase_m / 2.0
    source, warm_up_ticks = simulation(network)
    models_m, found_m, speeds_mps = [], [], []
    with source:
        for _ in range(warm_up_ticks + 1):
            source.step()
        for tick in range(1, 81):
            source.follow_command(0, AckermannCommand(0.04 if tick > 30 else 0.0, 8.0))
            ego = source.step().ego
            driver = source._outside_drivers._drivers[0]
            models_m.append(driver.axle_m[:2].copy())
            ahead = np.array([np.cos(ego["yaw"]), np.sin(ego["yaw"])])
            found_m.append(np.array([ego["x"], ego["y"]]) - half_m * ahead)
            speeds_mps.append(float(np.hypot(ego["vx"], ego["vy"])))
    late = np.array(found_m)[SETTLING_TICKS:] - np.array(models_m)[:-SETTLING_TICKS]
    assert np.abs(late).max() < 1e-3
    assert speeds_mps[-1] > 7.0


def test_it_needs_a_longer_way_to_stop_on_a_wet_road(network: RoadNetwork) -> None:
    ways_m = []
    for wetness in (0.0, 100.0):
        source, warm_up_ticks = simulation(network, wetness)
        with source:
            for _ in range(warm_up_ticks + 1):
                source.step()
            driver = source._outside_drivers._drivers[0]
            driver.model.speed_mps = 14.0
            start_m = driver.axle_m.copy()
            for _ in range(80):
                source.follow_command(0, AckermannCommand(0.0, 0.0))
                source.step()
            assert driver.model.speed_mps == 0.0
            ways_m.append(float(np.linalg.norm(driver.axle_m - start_m)))
    assert ways_m[0] == pytest.approx(14.0**2 / (2.0 * 9.81) + 14.0 * 0.2, rel=0.25)
    assert ways_m[1] > 1.15 * ways_m[0]
