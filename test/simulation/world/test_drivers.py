"""Driver behavior besides driving: running lights, opening doors, blue lights, rain, and routes that do not end."""

from functools import cache

import libsumo
import numpy as np
import pytest
from event_scenes import event_scene
from world_scenes import NOON, TICK_S, blocks, of_kind, run, scene

from simbev_ros.config.traffic import Traffic
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.drivers import draw_driver
from simbev_ros.schema.scene.state import Behavior, Light
from simbev_ros.simulation.world.driving.rain import rain_effect
from simbev_ros.simulation.world.simulation import Simulation

BLUEPRINTS = {blueprint.name: blueprint for blueprint in load_blueprints()}


def changed(spec, **fields):
    """The scene with these fields set in all vehicles."""
    return spec.model_copy(update={"vehicles": tuple(each.model_copy(update=fields) for each in spec.vehicles)})


def vehicles_of(states):
    """(T, V) vehicle rows."""
    return of_kind(np.stack([state.actors for state in states]), "vehicle")


def red_light_runners(spec):
    """Names of the vehicles that cross a stop line at red, and the smallest gap (m) to a leader on the same lane."""
    ran, gap_m = set(), np.inf
    with Simulation(spec, blocks()) as simulation:
        for _ in range(spec.warm_up_ticks + spec.ticks):
            before = {name: libsumo.vehicle.getNextTLS(name)[:1] for name in libsumo.vehicle.getIDList()}
            simulation.step()
            for name, lights in before.items():
                now = libsumo.vehicle.getNextTLS(name)
                passed = bool(lights) and lights[0][2] < 1.0 and (not now or now[0][:2] != lights[0][:2])
                if passed and lights[0][3] == "r":
                    ran.add(name)
                leader = libsumo.vehicle.getLeader(name, 20.0)
                if leader and libsumo.vehicle.getLaneID(name) == libsumo.vehicle.getLaneID(leader[0]):
                    gap_m = min(gap_m, leader[1] + libsumo.vehicle.getMinGap(name))
    return ran, gap_m


@pytest.mark.slow
def test_distracted_drivers_run_red_lights_but_keep_their_distance_to_leaders():
    spec = scene(pedestrians=0, ticks=400)
    assert not red_light_runners(spec)[0]
    ran, gap_m = red_light_runners(changed(spec, distracted=True))
    assert len(ran) >= 3
    assert gap_m > 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("ignored", "vehicles_hit"), [("vehicles", 2), ("pedestrians", 1)])
def test_drivers_collide_with_what_they_ignore_alone(ignored, vehicles_hit):
    spec = changed(scene(vehicles=40, pedestrians=240, ticks=800), ignores=("lights", ignored))
    collisions = [event.ids for state in run(spec) for event in state.events if event.type == "collision"]
    assert len(collisions) >= 3
    assert {sum(actor <= len(spec.vehicles) for actor in ids) for ids in collisions} == {vehicles_hit}


@cache
def door_run():
    """(T, V) vehicles that open their doors whenever they stand."""
    spec = scene(vehicles=50, pedestrians=0, ticks=800, green_time_s=(20.0,))
    return vehicles_of(run(changed(spec, door_probability=1.0, blueprint="vehicle.sedan")))


@pytest.mark.slow
def test_doors_are_open_only_while_standing_and_close_again():
    rows = door_run()
    is_open = rows["doors"] > 0
    speed_mps = np.linalg.norm([rows["vx"], rows["vy"], rows["vz"]], axis=0)
    openings = np.count_nonzero(np.diff(is_open.astype(int), axis=0) == 1)
    assert openings >= 10
    assert np.count_nonzero(np.diff(is_open.astype(int), axis=0) == -1) >= openings - 10
    assert speed_mps[is_open].max() < 0.02


@pytest.mark.slow
def test_vehicles_stand_for_a_second_before_doors_open_and_have_only_the_doors_of_their_blueprint():
    rows = door_run()
    ticks = round(1.0 / TICK_S)
    position_m = np.stack([rows["x"], rows["y"]], axis=-1)
    for tick, vehicle in np.argwhere(np.diff((rows["doors"] > 0).astype(int), axis=0) == 1):
        assert np.ptp(position_m[tick - ticks : tick + 1, vehicle], axis=0).max() < 0.05
    doors = np.array([blueprint.doors for blueprint in load_blueprints()])[rows["blueprint"]]
    assert np.all(rows["doors"] < 2**doors)
    assert {1, 4} <= {int(bits).bit_count() for bits in rows["doors"].ravel()}


@pytest.mark.slow
def test_vehicles_drive_on_after_their_doors_were_open():
    rows = door_run()
    speed_mps = np.hypot(rows["vx"], rows["vy"])
    had_open = np.any(rows["doors"] > 0, axis=0)
    last_s = np.where(rows["doors"] > 0, np.arange(len(rows))[:, None], -1).max(axis=0) * TICK_S
    early = had_open & (last_s < 20.0)
    assert np.all(speed_mps[:, early][round(20.0 / TICK_S) :].max(axis=0) > 2.0)


def test_blue_lights_blink_twice_a_second_and_only_where_they_are_on():
    spec = scene(vehicles=3, pedestrians=0, ticks=60)
    on = spec.vehicles[1].model_copy(update={"blueprint": "vehicle.police", "emergency_lights": True})
    off = spec.vehicles[2].model_copy(update={"blueprint": "vehicle.police"})
    rows = vehicles_of(run(spec.model_copy(update={"vehicles": (spec.vehicles[0], on, off)})))
    blue = rows["lights"] & Light.EMERGENCY > 0
    assert not blue[:, [0, 2]].any()
    assert np.abs(np.diff(blue[-41:, 1].astype(int))).sum() == 8
    assert np.mean(blue[-40:, 1]) == pytest.approx(0.5)


def test_each_value_of_a_driver_is_drawn_independently():
    traffic = Traffic()
    drivers = [draw_driver(traffic, BLUEPRINTS["vehicle.police"], 3, f"vehicles.{index}") for index in range(2000)]
    assert np.mean([driver["distracted"] for driver in drivers]) == pytest.approx(0.02, abs=0.01)
    assert np.mean([driver["emergency_lights"] for driver in drivers]) == pytest.approx(0.5, abs=0.04)
    assert np.mean([driver["headway_s"] for driver in drivers]) == pytest.approx(1.2, abs=0.05)
    fixed = draw_driver(traffic.model_copy(update={"headway_s": 2.0}), BLUEPRINTS["vehicle.police"], 3, "vehicles.0")
    assert fixed == {**drivers[0], "headway_s": 2.0}
    closed = draw_driver(traffic, BLUEPRINTS["vehicle.sedan"], 3, "ego", opens_doors=False)
    assert closed["door_probability"] == 0.0
    assert not any(draw_driver(traffic, BLUEPRINTS["vehicle.sedan"], 3, f"{n}")["emergency_lights"] for n in range(20))


def test_distraction_is_a_behavior_bit_of_the_actors_table():
    behavior = vehicles_of(run(changed(scene(vehicles=3, pedestrians=0, ticks=1), distracted=True)))["behavior"]
    assert np.all(behavior == Behavior.DISTRACTED)


def test_in_heavy_rain_drivers_are_slower_and_keep_more_distance():
    assert rain_effect(NOON) == (1.0, 1.0)
    assert rain_effect(NOON.model_copy(update={"precipitation": 100})) == pytest.approx((0.91, 1 / 0.89))
    puddles = rain_effect(NOON.model_copy(update={"precipitation_deposits": 50}))
    assert puddles.speed == 1.0
    assert puddles.headway == pytest.approx(1 / 0.945)


@pytest.mark.slow
def test_vehicles_drive_on_when_their_routes_end():
    spec = scene(vehicles=12, pedestrians=0, ticks=20)
    with Simulation(spec, blocks()) as simulation:
        states = [simulation.step() for _ in range(1800)]
    rows = vehicles_of(states)
    assert rows.shape[1] == 12
    assert np.all(np.hypot(rows["vx"], rows["vy"])[-800:].max(axis=0) > 1.0)


def test_drivers_slow_down_when_it_begins_to_rain():
    spec = scene(vehicles=12, pedestrians=0, ticks=100)
    storm = spec.model_copy(update={"final_weather": NOON.model_copy(update={"precipitation": 100})})
    with Simulation(storm, blocks()) as simulation:
        factors = []
        for _ in range(spec.warm_up_ticks + spec.ticks + 20):
            simulation.step()
            factors.append((libsumo.vehicle.getSpeedFactor("v3"), libsumo.vehicle.getTau("v3")))
    first, last = np.array(factors[1]), np.array(factors[-1])
    assert first == pytest.approx((spec.vehicles[3].speed_factor, spec.vehicles[3].headway_s), rel=1e-3)
    assert last / first == pytest.approx((0.91, 1 / 0.89), rel=1e-3)


def test_traffic_speeds_up_in_a_drive_as_the_score_finds_comfortable():
    drive = event_scene("fog_bank", ("grid.ns2.0.0", "grid.ns2.0.1"), ticks=200)
    drive = drive.model_copy(update={"agents": (drive.agents[0].model_copy(update={"driver": "traffic"}),)})
    fastest_mps2 = []
    for spec in (drive, drive.model_copy(update={"drive": None})):
        speed_mps = np.array([np.hypot(state.ego["vx"], state.ego["vy"]) for state in run(spec)])
        fastest_mps2.append(float(np.diff(speed_mps).max() / TICK_S))
    assert fastest_mps2[0] <= 2.4 + 1e-3 < 2.5 < fastest_mps2[1]
