import logging

import libsumo
import numpy as np
import pytest
import shapely
from world_scenes import TICK_S, blocks, busy_run, of_kind, run, scene

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.maps.roads.lane_kind import CURB_HEIGHT_M
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.maps.sumo.crossfall import CROSSFALL
from simbev_ros.scene.blueprints import blueprint_index, blueprint_named, load_blueprints
from simbev_ros.scene.gait import stride_lengths_m
from simbev_ros.schema.scene.state import Light
from simbev_ros.simulation.world.population import Population
from simbev_ros.simulation.world.simulation import Simulation

_MAX_ACCELERATION_MPS2 = 10.0


def xyz(actors):
    return np.stack([actors["x"], actors["y"], actors["z"]], axis=-1)


def velocity(actors):
    return np.stack([actors["vx"], actors["vy"], actors["vz"]], axis=-1)


@pytest.mark.slow
def test_another_seed_sends_the_same_pedestrians_elsewhere():
    spec, actors = busy_run()
    others = run(spec.model_copy(update={"seed": 8, "ticks": 20}))[-1].actors
    assert others["id"].tolist() == actors[0]["id"].tolist()
    assert np.any(others["x"] != actors[len(actors) - spec.ticks + 19]["x"])


def test_ticks_run_from_minus_the_warm_up_to_the_last_recorded_one():
    spec = scene(vehicles=1, pedestrians=0, ticks=3, warm_up_ticks=2)
    states = run(spec)
    assert [state.tick for state in states] == [-2, -1, 0, 1, 2]
    assert [state.stamp_ns for state in states] == [spec.stamp_ns(tick) for tick in range(-2, 3)]


def test_at_60_hz_sumo_counts_whole_milliseconds_and_all_else_counts_ticks():
    """The published motion is consistent in time, and as fast as at 20 Hz within the 2 % that SUMO's step is longer."""
    speeds_mps = {}
    for rate_hz in (20, 60):
        spec = scene(16, 0, ticks=4 * rate_hz, warm_up_ticks=4 * rate_hz, tick_ns=round(1e9 / rate_hz))
        actors = [state.actors for state in run(spec)]
        way_m = np.linalg.norm(xyz(actors[-1]) - xyz(actors[-rate_hz]), axis=1)
        speeds_mps[rate_hz] = np.linalg.norm(np.mean([velocity(each) for each in actors[-rate_hz:]], axis=0), axis=1)
        assert way_m / (1 - 1 / rate_hz) == pytest.approx(speeds_mps[rate_hz], abs=0.3)
    assert speeds_mps[60].mean() == pytest.approx(speeds_mps[20].mean(), rel=0.1)


def test_all_actors_start_at_rest_at_their_drawn_positions():
    spec, actors = busy_run()
    names = ("vx", "vy", "vz", "ax", "ay", "az", "wx", "wy", "wz", "steer", "wheel", "gait")
    assert all(np.all(actors[0][name] == 0.0) for name in names)
    assert np.abs(actors[0]["roll"]).max() == pytest.approx(np.arctan(CROSSFALL), rel=0.2)
    for vehicle, row in zip(spec.vehicles, actors[0], strict=False):
        position, yaw_rad = blocks().pose_on_lane(vehicle.start.lane, vehicle.start.s_m)
        front = xyz(row) + row["length"] / 2 * np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
        offset = front - position
        assert abs(offset[0] * np.cos(yaw_rad) + offset[1] * np.sin(yaw_rad)) < max(0.05, 0.012 * row["length"])
        assert np.linalg.norm(offset) < 1.5
        assert abs(row["yaw"] - yaw_rad) < max(0.2, 0.02 * row["length"])  # a body in a bend lies on the chord


def test_no_actor_appears_vanishes_or_jumps():
    spec, actors = busy_run()
    assert np.all(actors["id"] == actors["id"][0])
    assert np.all(np.diff(actors["id"][0].astype(int)) > 0)
    blueprints = [blueprint_named(vehicle.blueprint) for vehicle in spec.vehicles]
    riders = sum(bool(blueprint.rider) for blueprint in blueprints)
    assert len(actors[0]) == len(spec.vehicles) + riders + len(spec.pedestrians)
    distance_m = np.linalg.norm(np.diff(xyz(actors), axis=0), axis=-1)
    assert distance_m.max() < 25.0 * TICK_S
    assert (
        np.linalg.norm(np.diff(xyz(of_kind(actors, "pedestrian")), axis=0), axis=-1).max() < 2.2 * 1.3 * 1.05 * TICK_S
    )


def test_most_vehicles_and_pedestrians_move_away_from_their_start():
    _, actors = busy_run()
    distance_m = np.linalg.norm(xyz(actors[-1]) - xyz(actors[0]), axis=-1)
    assert np.mean(distance_m > 5.0) > 0.75


def test_velocity_integrates_to_position_and_acceleration_to_velocity():
    _, actors = busy_run()
    v = velocity(actors).astype(float)
    a = np.stack([actors["ax"], actors["ay"], actors["az"]], axis=-1).astype(float)
    path = np.cumsum((v[1:] + v[:-1]) / 2 * TICK_S, axis=0)
    np.testing.assert_allclose(xyz(actors)[1:] - xyz(actors)[0], path, atol=0.02)
    np.testing.assert_allclose(v[1:] - v[0], np.cumsum((a[1:] + a[:-1]) / 2 * TICK_S, axis=0), atol=0.002)


def test_motion_of_vehicles_is_physical():
    _, actors = busy_run()
    vehicles = of_kind(actors, "vehicle")
    heading = np.stack([np.cos(vehicles["yaw"]), np.sin(vehicles["yaw"])], axis=-1)
    ahead = np.sum(velocity(vehicles)[..., :2] * heading, axis=-1)
    assert ahead.min() > -0.3
    assert np.abs(vehicles["wz"]).max() < 1.2
    assert np.hypot(vehicles["ax"], vehicles["ay"]).max() < _MAX_ACCELERATION_MPS2
    # The rear axle rolls without slip: it has no speed to the side.
    wheelbase_m = 0.6 * vehicles["length"]
    side = velocity(vehicles)[..., 1] * heading[..., 0] - velocity(vehicles)[..., 0] * heading[..., 1]
    rear_side = side - vehicles["wz"] * wheelbase_m / 2
    assert np.percentile(np.abs(rear_side), 99) < 0.25


def test_angular_velocity_is_the_derivative_of_yaw():
    _, actors = busy_run()
    yaw = np.unwrap(actors["yaw"].astype(float), axis=0)
    np.testing.assert_allclose(actors["wz"][1:-1], (yaw[2:] - yaw[:-2]) / (2 * TICK_S), atol=2e-3)


def test_riders_stay_on_their_seats():
    _, actors = busy_run()
    riders = of_kind(actors, "rider")
    assert riders.shape[1] >= 2
    for column in riders.T:
        bike = actors.T[actors["id"][0] == column["parent"][0]][0]
        gap_m = xyz(column) - xyz(bike)
        assert np.ptp(np.linalg.norm(gap_m, axis=-1)) < 1e-6
        assert np.array_equal(column["yaw"], bike["yaw"])
        assert np.array_equal(column["gait"], bike["gait"])
        turned = velocity(bike) + np.cross(np.stack([bike["wx"], bike["wy"], bike["wz"]], axis=-1), gap_m)
        np.testing.assert_allclose(velocity(column), turned, atol=5e-3)


def test_two_wheelers_lean_into_curves():
    _, actors = busy_run()
    bikes = actors[:, np.isin(actors["id"][0], of_kind(actors, "rider")["parent"][0])]
    curves = np.abs(bikes["wz"]) > 0.25
    assert np.count_nonzero(curves) > 10
    assert np.mean(np.sign(bikes["roll"][curves]) == -np.sign(bikes["wz"][curves])) > 0.95


def test_pedestrians_stay_on_sidewalks_and_crossings_at_their_height():
    _, actors = busy_run()
    pedestrians = of_kind(actors, "pedestrian")
    surfaces = surfaces_of(blocks().layout)
    sidewalk = surfaces.sidewalk
    walkable = shapely.union_all([sidewalk, surfaces.crosswalk]).buffer(0.2)
    points = np.stack([pedestrians["x"], pedestrians["y"]], axis=-1)[::10].reshape(-1, 2)
    assert shapely.contains_xy(walkable, points).all()
    deep, z = shapely.contains_xy(sidewalk.buffer(-1.0), points), pedestrians["z"][::10].ravel()
    assert z[deep] == pytest.approx(blocks().elevation.height_m(points[deep]) + CURB_HEIGHT_M, abs=0.01)
    on_road = shapely.contains_xy(surfaces.road.buffer(-1.5), points)
    assert np.all(z[on_road] < 0.02)


@pytest.mark.parametrize("name", ["pedestrian.man", "pedestrian.wheelchair"])
def test_feet_and_wheelchair_wheels_do_not_slide(name):
    _, actors = busy_run()
    index = blueprint_index()[name]
    pedestrian = actors[:, actors["blueprint"][0] == index][:, 0]
    distance_m = np.linalg.norm(np.diff(xyz(pedestrian)[:, :2], axis=0), axis=-1).sum()
    strides = np.diff(np.unwrap(pedestrian["gait"])) / (2 * np.pi)
    blueprint = load_blueprints()[index]
    speed_mps = np.hypot(pedestrian["vx"], pedestrian["vy"])[1:].astype(np.float64)
    stride_m = blueprint.stride_m or stride_lengths_m(blueprint.size_m[2], speed_mps)
    assert np.sum(strides * stride_m) == pytest.approx(distance_m, rel=0.03)


def test_wheels_roll_the_distance_driven():
    _, actors = busy_run()
    ego = actors[:, 0]
    distance_m = np.linalg.norm(np.diff(xyz(ego), axis=0), axis=-1).sum()
    assert ego["wheel"][-1] * 0.33 == pytest.approx(distance_m, rel=0.02)


def test_vehicles_stand_with_brake_lights_and_drive_off_without():
    _, actors = busy_run()
    vehicles = of_kind(actors, "vehicle")
    assert np.all(vehicles["lights"][0] & Light.BRAKE)
    is_accelerating = (
        np.hypot(vehicles["vx"], vehicles["vy"])[1:] > np.hypot(vehicles["vx"], vehicles["vy"])[:-1] + 0.02
    )
    assert np.mean((vehicles["lights"][1:][is_accelerating] & Light.BRAKE) > 0) < 0.05


def test_vehicles_hardly_ever_overlap():
    _, actors = busy_run()
    overlaps = count = 0
    for rows in of_kind(actors, "vehicle")[::10]:
        c, s = np.cos(rows["yaw"]), np.sin(rows["yaw"])
        a, b = rows["length"] / 2 - 0.05, rows["width"] / 2 - 0.05
        corners = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
        boxes = shapely.polygons(
            np.stack(
                [[rows["x"] + i * a * c - j * b * s, rows["y"] + i * a * s + j * b * c] for i, j in corners]
            ).transpose(2, 0, 1)
        )
        overlaps += (shapely.STRtree(boxes).query(boxes, predicate="intersects").shape[1] - len(boxes)) // 2
        count += len(boxes)
    assert overlaps <= 0.01 * count


def test_only_one_simulation_runs_in_a_process():
    spec = scene(vehicles=1, pedestrians=0)
    with Simulation(spec, blocks()), pytest.raises(SimulationError, match="running in this process already"):
        Simulation(spec, blocks())
    run(spec.model_copy(update={"ticks": 1}))


def test_a_vehicle_without_room_is_left_out_and_logged(caplog):
    spec = scene(vehicles=3, pedestrians=0, ticks=200)
    twice = spec.model_copy(update={"vehicles": (*spec.vehicles, spec.vehicles[1], spec.vehicles[2])})
    with caplog.at_level(logging.WARNING):
        states = run(twice)
    assert {tuple(state.actors["id"]) for state in states} == {(1, 2, 3)}
    assert [record.args[2] for record in caplog.records] == [3, 4]


def test_an_ego_without_room_is_an_error(monkeypatch):
    class Crowded(Population):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            self.vehicles = self.vehicles[1:]

    monkeypatch.setattr("simbev_ros.simulation.world.simulation.Population", Crowded)
    with pytest.raises(SimulationError, match=r"agent ego does not fit at its start, lane \S+, \d+\.\d m"):
        Simulation(scene(vehicles=2, pedestrians=0), blocks())


def test_a_lost_vehicle_is_an_error():
    with Simulation(scene(vehicles=2, pedestrians=0), blocks()) as simulation:
        simulation.step()
        libsumo.vehicle.remove("v1")
        with pytest.raises(SimulationError, match="v1"):
            simulation.step()


def test_a_pedestrian_for_whom_sumo_has_no_position_stays_where_it_is(monkeypatch):
    results = libsumo.person.getAllSubscriptionResults
    with Simulation(scene(vehicles=1, pedestrians=2, ticks=100), blocks()) as simulation:
        before = [simulation.step().actors for _ in range(60)]
        lost = {libsumo.VAR_POSITION3D: (libsumo.INVALID_DOUBLE_VALUE,) * 2}  # as libsumo returns Position::INVALID
        monkeypatch.setattr(libsumo.person, "getAllSubscriptionResults", lambda: {**results(), "p1": lost})
        after = [simulation.step().actors for _ in range(40)]
    walked_m = np.linalg.norm(np.diff([xyz(actors)[-2:, :2] for actors in (*before, *after)], axis=0), axis=2)
    assert walked_m[:59].sum(axis=0).min() > 1.0
    assert walked_m[-10:, 0].min() > 0.02 and walked_m[-10:, 1].max() == 0.0


def test_ticks_far_from_whole_milliseconds_are_refused():
    spec = scene(vehicles=1, pedestrians=0, tick_ns=12_500_000)
    with pytest.raises(SimulationError, match="whole milliseconds"):
        Simulation(spec, blocks())
