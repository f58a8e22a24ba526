"""Towed units follow the hitch on a tractrix, and stay on it."""

import numpy as np
import pytest

from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Ego, MapScenes, Timing
from simbev_ros.config.traffic import Traffic
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint, blueprint_named, load_blueprints
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.nuscenes import category_of_blueprint
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.cast import cast_of
from simbev_ros.simulation.world.kinematics.collisions import Collisions
from simbev_ros.simulation.world.kinematics.contacts import BodyBoxes
from simbev_ros.simulation.world.kinematics.towing import TowedUnits, Towing, towed_headings
from simbev_ros.simulation.world.simulation import Simulation

RIGS = [each for each in load_blueprints() if each.tows]


def unit(angle_rad: float) -> Float64Array:
    return np.array([[np.cos(angle_rad), np.sin(angle_rad)]])


@pytest.mark.parametrize("steps", [1, 7])
def test_on_a_straight_line_half_the_angles_tangent_decays_exponentially(steps: int) -> None:
    heading, length_m = unit(0.3 + 0.8), np.array([4.0])
    for _ in range(steps):
        heading = towed_headings(heading, 6.0 / steps * unit(0.3), length_m)
    angle_rad = np.arctan2(heading[0, 1], heading[0, 0]) - 0.3
    assert np.tan(angle_rad / 2.0) == pytest.approx(np.tan(0.4) * np.exp(-6.0 / 4.0), rel=1e-9)


def test_on_a_steady_circle_the_axle_runs_on_the_circle_of_pythagoras() -> None:
    radius_m, length_m, step_rad = 15.0, np.array([9.0]), 1e-3
    heading, hitch_m = unit(np.pi / 2.0), radius_m * unit(0.0)
    for number in range(1, 12_000):
        now_m = radius_m * unit(number * step_rad)
        heading, hitch_m = towed_headings(heading, now_m - hitch_m, length_m), now_m
    assert np.linalg.norm(hitch_m - length_m * heading) == pytest.approx(np.sqrt(15.0**2 - 9.0**2), abs=1e-3)


def test_a_unit_that_is_pushed_straight_back_keeps_its_heading_and_one_askew_folds() -> None:
    back_m, length_m = -3.0 * unit(0.0), np.array([4.0])
    np.testing.assert_array_equal(towed_headings(unit(0.0), back_m, length_m), unit(0.0))
    np.testing.assert_array_equal(towed_headings(unit(0.2), 0.0 * back_m, length_m), unit(0.2))
    askew = towed_headings(unit(0.2), back_m, length_m)
    assert np.arctan2(askew[0, 1], askew[0, 0]) > 0.2


def test_no_joint_bends_farther_than_it_can() -> None:
    towing = Towing(np.array([0]), np.array([2.0]), np.array([4.0]))
    forward, point_m = np.array([[1.0, 0.0, 0.0]]), np.zeros((1, 3))
    units = TowedUnits(towing, point_m, forward)
    for number in range(200):
        turned = np.array([[np.cos(0.01 * number), np.sin(0.01 * number), 0.0]])
        point_m = point_m - 0.1 * turned
        units.follow(point_m, turned)
        assert np.sum(units.forward * turned) > np.cos(1.21)
    assert np.sum(units.forward * turned) < np.cos(1.19)


def test_a_vehicle_and_what_it_tows_slide_on_together_after_a_crash() -> None:
    start_m = np.array([[0.0, 0.0, 0.0], [-7.0, 0.0, 0.0], [-7.0, 12.0, 0.0]])
    size_m, rpy_rad = np.array([[6.0, 2.5, 3.0], [8.0, 2.5, 3.0], [4.5, 2.0, 1.5]]), np.zeros((3, 3))
    rpy_rad[2, 2] = -np.pi / 2.0
    step_m = np.array([[0.2, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, -0.6, 0.0]])
    collisions = Collisions(BodyBoxes(size_m, 3), start_m, rpy_rad, 0.05, coupled=np.array([[0, 1]]))
    position_m, pairs = start_m, []
    for _ in range(80):
        position_m, _ = collisions.resolve(position_m + step_m, rpy_rad)
        pairs += [impact.bodies for impact in collisions.impacts]
        np.testing.assert_allclose(position_m[0] - position_m[1], start_m[0] - start_m[1], atol=1e-9)
    assert pairs == [(1, 2)]
    assert collisions.crashed.all()


def scene(rig: str, town: str, vehicles: float) -> tuple[SceneSpec, RoadNetwork]:
    """A scene in which the ego tows."""
    update = {
        "scenes": (MapScenes(map=town, train=1),),
        "ego": Ego(blueprint=rig),
        "traffic": Traffic(vehicles=vehicles, pedestrians=40, spawn_radius_m=200.0),
        "time": Timing(warm_up_s=4.0, duration_s=30.0),
    }
    scenario = load_scenario("paper").model_copy(update=update)
    [planned] = planned_scenes(scenario)
    network = load_network(planned.map)
    return draw_scene(scenario, planned, network), network


def hitch_m(row: Table, blueprint: Blueprint) -> Float64Array:
    """(2,) hitch of a vehicle or trailer."""
    return np.array([row["x"], row["y"]]) + blueprint.hitch_m * np.cos(row["pitch"]) * unit(row["yaw"])[0]


@pytest.mark.parametrize(
    "rig, town, vehicles", [("vehicle.articulated_bus", "Town10HD", 60.0), ("vehicle.semi_curtain", "Town07", 5.0)]
)
def test_a_towed_unit_hangs_on_its_hitch_bends_with_it_and_shows_its_lights(
    rig: str, town: str, vehicles: float
) -> None:
    spec, network = scene(rig, town, vehicles)
    towing, towed = blueprint_named(rig), blueprint_named(blueprint_named(rig).tows)
    bends_rad, unit_id = [], _trailer_id(spec)
    with Simulation(spec, network) as simulation:
        for _ in range(spec.warm_up_ticks + spec.ticks):
            actors = simulation.step().actors
            ego, trailer = actors[0], actors[actors["id"] == unit_id][0]
            assert load_blueprints()[trailer["blueprint"]] == towed
            np.testing.assert_allclose(hitch_m(trailer, towed), hitch_m(ego, towing), atol=0.03)
            assert trailer["lights"] == ego["lights"]
            assert trailer["steer"] == 0.0
            bends_rad.append(float(np.angle(np.exp(1j * (trailer["yaw"] - ego["yaw"])))))
    assert max(map(abs, bends_rad)) > 0.15
    assert max(map(abs, np.diff(bends_rad))) < 0.05


def _trailer_id(spec: SceneSpec) -> int:
    cast = cast_of(spec, range(len(spec.vehicles)), range(len(spec.pedestrians)))
    return int(cast.rows["id"][np.flatnonzero(cast.bodies.point == cast.bodies.towed.start)[0]])


@pytest.mark.parametrize("blueprint", RIGS, ids=lambda each: each.name)
def test_units_of_a_rig_meet_at_the_hitch_without_a_gap(blueprint: Blueprint) -> None:
    towed = blueprint_named(blueprint.tows)
    gap_m = blueprint.train_length_m - blueprint.size_m[0] - towed.size_m[0]
    assert towed.kind == "trailer"
    assert -3.5 < gap_m < 0.3  # a semi-trailer lies on its tractor
    assert blueprint.train_length_m < 18.8
    assert blueprint.turning_footprint.length_m < blueprint.train_length_m
    category = "vehicle.bus.bendy" if blueprint.box_class == "bus" else "vehicle.trailer"
    assert category_of_blueprint(towed.name, towed.box_class) == category
