"""Drivers slow down at speed bumps until the rear of their vehicle has passed."""

from pathlib import Path

import numpy as np
import pytest
from lanelet2_sample import Crossing, LaneletSample
from world_scenes import of_kind

from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.land_features import SpeedBump
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.simulation.world.driving.speed_bumps import SpeedBumps
from simbev_ros.simulation.world.simulation import Simulation

FROM_M, TO_M, HALF_M = 100.0, 103.0, 8.0
BUMP_MPS = 8.0 / 3.6  # of 0.15 m, two fifths from 0.05 m (10 km/h) to 0.30 m (5 km/h)


def map_with_bump(folder: Path) -> RoadNetwork:
    """Four roads of 250 m, and a bump across the eastern one."""
    sample = LaneletSample()
    crossing = Crossing(sample, length_m=250.0)
    corners = [(FROM_M, -HALF_M), (TO_M, -HALF_M), (TO_M, HALF_M), (FROM_M, HALF_M)]
    outline = sample.line(corners, "speed_bump", "", area="yes", height="0.15")
    rule = sample.rule("speed_bump", ("way", "refers", outline))
    for lanelet in (*crossing.incoming[0], *crossing.outgoing[0]):
        sample.add_rule(lanelet, rule)
    path = folder / "crossing.osm"
    path.write_text(sample.text())
    return load_network(map_spec(str(path)), folder / "cache")


def test_vehicles_cross_a_bump_slowly_and_drive_fast_before_and_after(tmp_path: Path) -> None:
    network, path = map_with_bump(tmp_path), str(tmp_path / "crossing.osm")
    scenario = Scenario.model_validate(
        {
            "seed": 3,
            "scenes": [{"map": path, "train": 1}],
            "rig": Rig(sensors=()),
            "time": {"tick_s": 0.1, "warm_up_s": 1, "duration_s": 16},
            "traffic": {"vehicles": 16, "pedestrians": 0, "spawn_radius_m": 300, "reckless_probability": 0},
        }
    )
    scene = draw_scene(scenario, PlannedScene(0, map_spec(path), "train"), network)
    with Simulation(scene, network) as simulation:
        states = [simulation.step() for _ in range(scene.warm_up_ticks + scene.ticks)]
    rows = of_kind(np.stack([state.actors for state in states]), "vehicle")
    (middle_m,) = (junction.center_m for junction in network.junctions.values())
    x_m, y_m, half_m = rows["x"] - middle_m[0], rows["y"] - middle_m[1], rows["length"] / 2.0
    speed_mps = np.abs(rows["vx"])  # along the eastern road, without changes of lanes
    is_east = (np.abs(y_m) < HALF_M) & (x_m > 30.0)
    on_bump = is_east & (x_m + half_m > FROM_M) & (x_m - half_m < TO_M)
    assert on_bump.any(axis=0).sum() >= 1
    assert speed_mps[on_bump].max() < 1.1 * BUMP_MPS  # up to a tenth more where it catches up after a change of lanes
    assert speed_mps[is_east & (np.abs(x_m - FROM_M) > 60.0)].max() > 10.0
    braking_mps2 = -np.diff(speed_mps, axis=0)[is_east[1:] & (np.abs(x_m[1:] - FROM_M) < 40.0)] / 0.1
    assert braking_mps2.max() < 2.5


class OneVehicle:
    """A vehicle that drives along x at a height."""

    def __init__(self, height_m: float = 0.0) -> None:
        self.height_m, self.position_m, self.limit_mps, self.mps = height_m, 0.0, np.inf, 2.0

    def ahead_m(self, vehicle: Int64Array, distance_m: Float64Array, left_m: Float64Array) -> Float64Array:
        assert vehicle.tolist() == [0]
        return np.stack([self.position_m + distance_m, left_m, np.full_like(left_m, self.height_m)], axis=-1)

    def speed_mps(self, vehicle: int) -> float:
        return self.mps

    def limit_speed(self, vehicle: int, reason: str, speed_mps: float | None) -> None:
        assert (vehicle, reason) == (0, "speed bump")
        self.limit_mps = np.inf if speed_mps is None else speed_mps


def limits_mps(vehicle: OneVehicle, positions_m: Float64Array, height_m: float = 0.0) -> Float64Array:
    """The limit of a vehicle of 4 m at consecutive positions; a bump lies from 50 to 52 m."""
    corners_m = [(50.0, -2.0, height_m), (50.0, 2.0, height_m), (52.0, -2.0, height_m), (52.0, 2.0, height_m)]
    bumps, found = SpeedBumps([SpeedBump(np.array(corners_m), 2.0)], np.array([4.0]), vehicle, 0.1), []
    for vehicle.position_m in positions_m:
        bumps.slow_down()
        found.append(vehicle.limit_mps)
    return np.array(found)


def test_a_limit_falls_toward_the_bump_and_lasts_until_the_rear_has_passed_it() -> None:
    # v^2 - 2^2 = 2 a d with a = 1.5 m/s^2, to 1 m ahead of the bump.
    assert limits_mps(OneVehicle(), np.array([39.0])) == pytest.approx([np.sqrt(2.0**2 + 2.0 * 1.5 * 10.0)])
    positions_m = np.arange(48.0, 60.0, 0.2)
    found_mps = limits_mps(OneVehicle(), positions_m)
    slow_m = positions_m[found_mps == 2.0]
    assert slow_m.min() == pytest.approx(49.0, abs=0.21)
    assert 52.0 + 4.0 < slow_m.max() <= 52.0 + 4.0 + 1.0, "the rear has left the bump"
    assert found_mps[-1] == np.inf


@pytest.mark.parametrize(("height_m", "is_slow"), [(0.0, True), (6.0, False), (np.nan, True)])
def test_only_a_bump_at_the_level_of_the_vehicle_slows_it_down(height_m: float, is_slow: bool) -> None:
    assert (limits_mps(OneVehicle(), np.array([49.5]), height_m)[0] == 2.0) == is_slow
