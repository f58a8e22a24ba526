"""A vehicle that follows commands in the simulation: it is published as its model moves; wet and snowy roads slip."""

import numpy as np
import pytest
from event_scenes import LEFT, RIGHT, event_scene
from made_up_roads import clear_weather
from world_scenes import blocks

from simbev_ros.config.agents import Ego
from simbev_ros.config.drive import Drive
from simbev_ros.config.load import load_scenario
from simbev_ros.config.traffic import Traffic
from simbev_ros.config.weather import WeatherConfig
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.schema.scene.drive_spec import Command
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.route_progress import RouteProgress
from simbev_ros.schema.scene.state import Light
from simbev_ros.simulation.world.driving.commands import AckermannCommand, IndicatorsCommand, TrajectoryCommand
from simbev_ros.simulation.world.driving.vehicle_model import road_friction
from simbev_ros.simulation.world.simulation import Simulation

PLANNED = PlannedScene(3, MapSpec(name="Blocks"), "train")

SETTLING_TICKS = 4
"""Ticks by which published poses follow the model: three for the ground below the wheels, one for the derivatives."""
LAMP_TICKS = 14
"""Ticks after which published lamps are those of a command at the latest; they come with SUMO's smoothed traffic."""


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    return load_network(PLANNED.map)


def simulation(network: RoadNetwork, wetness: float = 0.0, snow: float = 0.0) -> tuple[Simulation, int]:
    """A simulation whose ego follows commands, and the number of its warm-up ticks; with snow it has a route."""
    weather = WeatherConfig.model_validate({"wetness": wetness, "precipitation_deposits": 0.0, "snow_cover": snow})
    changes = {
        "ego": Ego(driver="ackermann"),
        "traffic": Traffic(vehicles=0, pedestrians=0),
        "weather": weather,
        "drive": Drive() if snow else None,
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


def test_it_needs_a_longer_way_to_stop_on_a_wet_or_snowy_road(network: RoadNetwork) -> None:
    ways_m = []
    for wetness, snow in ((0.0, 0.0), (100.0, 0.0), (0.0, 50.0)):
        source, warm_up_ticks = simulation(network, wetness, snow)
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
    assert ways_m[2] == pytest.approx(14.0**2 / (2.0 * 9.81 * 0.625) + 14.0 * 0.1, rel=0.1)


def test_indicators_blink_as_the_driver_commands_until_the_next_command(network: RoadNetwork) -> None:
    source, warm_up_ticks = simulation(network, snow=1.0)  # with a route, which they would follow otherwise
    shown: dict[IndicatorsCommand, set[int]] = {}
    with source:
        for _ in range(warm_up_ticks + 1):
            source.step()
        for command in (IndicatorsCommand(False, True), IndicatorsCommand(True, True), IndicatorsCommand(False, False)):
            source.follow_command(0, command)
            ticks = [int(source.step().ego["lights"]) & (Light.TURN_LEFT | Light.TURN_RIGHT) for _ in range(32)]
            shown[command] = set(ticks[LAMP_TICKS:])
    assert [*shown.values()] == [{0, Light.TURN_RIGHT}, {0, Light.TURN_LEFT | Light.TURN_RIGHT}, {0}]


@pytest.mark.parametrize(
    ("weather", "friction"),
    [({}, 1.0), ({"snow_cover": 40}, 0.7), ({"snow_cover": 100}, 0.25), ({"wetness": 100, "snow_cover": 50}, 0.475)],
)
def test_snow_shares_the_road_with_dry_or_wet_asphalt_in_drives_alone(
    weather: dict[str, float], friction: float
) -> None:
    now = clear_weather(**weather)
    assert road_friction(now, with_snow=True) == pytest.approx(friction)
    assert road_friction(now, with_snow=False) == road_friction(
        now.model_copy(update={"snow_cover": 0}), with_snow=True
    )


@pytest.mark.parametrize(("edges", "lane", "side"), [(LEFT, 2, Light.TURN_LEFT), (RIGHT, 1, Light.TURN_RIGHT)])
def test_indicators_follow_the_route_from_30_m_before_a_turn_to_its_end(
    edges: tuple[str, str], lane: int, side: Light
) -> None:
    drawn = event_scene("fog_bank", edges, lane, ticks=300)
    assert drawn.drive is not None
    drive = drawn.drive.model_copy(update={"events": ()})
    agent = drawn.agents[0].model_copy(update={"driver": "path"})
    spec = drawn.model_copy(update={"agents": (agent,), "drive": drive})
    stamps_ns = [spec.start_ns + round(each / 7.0 * 1e9) for each in drive.route.distance_m]
    plan = TrajectoryCommand.of(stamps_ns, drive.route.points_m[:, :2].tolist())
    turn = [Command.FOLLOW is not each for each in drive.route.command]
    first_m, *_, last_m = np.array(drive.route.distance_m)[turn]
    front_m, shown = [], []
    with Simulation(spec, blocks()) as source:
        progress = RouteProgress(drive.route)
        for _ in range(spec.warm_up_ticks + spec.ticks):
            state = source.step()
            source.follow_command(0, plan)
            if state.tick >= 0:
                half_m = np.array([np.cos(state.ego["yaw"]), np.sin(state.ego["yaw"])]) * state.ego["length"] / 2.0
                front_m.append(progress.advance_to(np.array([state.ego["x"], state.ego["y"]]) + half_m).distance_m)
                shown.append(int(state.ego["lights"]) & (Light.TURN_LEFT | Light.TURN_RIGHT))
    assert front_m[0] < first_m - 35.0 and front_m[-1] > last_m + 5.0
    lit_m = np.array(front_m)[np.array(shown) > 0]
    assert {*shown} == {0, side}
    assert first_m - 32.0 < lit_m.min() < first_m - 25.0  # half a period of the blinker has 2.3 m
    assert last_m - 3.0 < lit_m.max() < last_m + 4.0  # lights lag up to 0.35 s behind the pose
