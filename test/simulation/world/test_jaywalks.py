"""Jaywalkers cross away from crosswalks, careful drivers stop for them, and they walk on on the other side."""

from functools import cache

import numpy as np
import pytest
import shapely
from world_scenes import BLOCKS, blocks, of_kind, run, scene

from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.spec import WaypointSpec
from simbev_ros.schema.scene.state import Behavior, Light
from simbev_ros.simulation.world.demand import demand_of
from simbev_ros.simulation.world.simulation import Simulation
from simbev_ros.simulation.world.sumo import walkers

_STREET = "-grid.ring.11"


@cache
def meeting(car_m: float, reckless: bool):
    """(T, 2) rows of a car on a street and of a pedestrian who crosses it 12 m from their start, and the events."""
    spec = scene(vehicles=1, pedestrians=1, ticks=300, seed=48)
    start = WaypointSpec(lane=f"{_STREET}_1", s_m=car_m)
    car = spec.vehicles[0].model_copy(update={"start": start, "speed_factor": 1.0, "reckless": reckless})
    walker = spec.pedestrians[0].model_copy(
        update={
            "blueprint": "pedestrian.man",
            "start": WaypointSpec(lane=f"{_STREET}_0", s_m=90.0),
            "max_speed_mps": 1.5,
            "jaywalks": True,
        }
    )
    states = run(spec.model_copy(update={"vehicles": (car,), "pedestrians": (walker,)}))
    return np.stack([state.actors for state in states]), [event for state in states for event in state.events]


def is_crossing(actors):
    return (actors["behavior"] & Behavior.JAYWALKING) > 0


def plan_m(rows):
    return np.stack([rows["x"], rows["y"]], axis=-1)


def along(rows, x, y):
    return rows[x] * np.cos(rows["yaw"]) + rows[y] * np.sin(rows["yaw"])


@pytest.mark.slow
def test_a_jaywalker_walks_on_to_an_edge_that_is_shorter_than_the_usual_arrival(monkeypatch):
    monkeypatch.setattr(walkers, "_ANY_ARRIVAL_M", 1e4)
    actors, _ = meeting.__wrapped__(40.0, reckless=False)
    last_crossed = np.flatnonzero(is_crossing(actors[:, 1]))[-1]
    later_m = plan_m(actors[last_crossed + 1 :, 1])
    assert np.hypot(*(later_m[-1] - later_m[0])) > 3.0


@pytest.mark.slow
def test_a_careful_driver_brakes_gently_for_a_jaywalker_and_then_drives_on():
    actors, events = meeting(40.0, reckless=False)
    car, crossing = actors[:, 0], is_crossing(actors[:, 1])
    assert not events
    assert along(car, "vx", "vy")[crossing].max() > 7.0
    assert along(car, "vx", "vy")[crossing].min() < 2.0
    assert -3.0 < along(car, "ax", "ay").min() < -2.0
    assert np.any(car["lights"][crossing] & Light.BRAKE)
    assert along(car, "vx", "vy")[-1] > 5.0
    gap_m = np.linalg.norm(plan_m(actors[:, 0]) - plan_m(actors[:, 1]), axis=1)
    assert gap_m[crossing].min() > car["length"][0] / 2.0 + 1.0


@pytest.mark.slow
def test_a_reckless_driver_runs_over_a_jaywalker():
    meetings = [meeting(car_m, reckless=True) for car_m in (37.0, 38.0, 39.0, 40.0, 41.0)]
    for actors, events in meetings:
        if not events:
            assert along(actors[:, 0], "ax", "ay")[is_crossing(actors[:, 1])].min() > -0.5
    hits = [(actors, events) for actors, events in meetings if events]
    assert hits
    for actors, events in hits:
        assert [(event.type, event.ids) for event in events] == [("collision", (1, 2))]
        assert is_crossing(actors[:, 1])[-1]  # it lies on the road


def test_a_jaywalker_waits_for_a_car_that_is_too_close():
    actors, events = meeting(50.0, reckless=False)
    car, walker = actors[:, 0], actors[:, 1]
    first = np.flatnonzero(is_crossing(walker))[0]
    waits = np.hypot(walker["vx"], walker["vy"])[:first] < 0.05
    assert np.count_nonzero(waits[20:]) > 20
    assert along(car, "ax", "ay").min() > -0.5
    assert not events


@pytest.mark.parametrize("car_m", [40.0, 50.0])
def test_the_behavior_bit_is_set_exactly_while_a_pedestrian_is_on_the_carriageway(car_m):
    actors, _ = meeting(car_m, reckless=False)
    walker = actors[:, 1]
    road = surfaces_of(blocks().layout, area=shapely.Point(walker["x"][0], walker["y"][0]).buffer(60.0)).road
    depth_m = shapely.distance(road.boundary, shapely.points(plan_m(walker)))
    depth_m = np.where(shapely.contains_xy(road, plan_m(walker)), depth_m, -depth_m)
    assert np.all(is_crossing(walker)[depth_m > 0.25])
    assert not np.any(is_crossing(walker)[depth_m < -0.25])
    assert np.count_nonzero(depth_m > 0.25) > 60


def test_a_jaywalker_crosses_at_a_right_angle_without_jumps_and_walks_on_the_other_side():
    actors, _ = meeting(40.0, reckless=False)
    walker = actors[:, 1]
    on_road = np.flatnonzero(is_crossing(walker))
    assert np.hypot(walker["vx"], walker["vy"]).max() < 1.5 * 1.3 * 1.05
    assert np.hypot(walker["ax"], walker["ay"]).max() < 5.1
    line_m = plan_m(walker[on_road])
    across = (line_m[-1] - line_m[0]) / np.linalg.norm(line_m[-1] - line_m[0])
    network = blocks()
    _, yaw_rad = network.pose_on_lane(f"{_STREET}_0", 100.0)
    assert abs(across @ [np.cos(yaw_rad), np.sin(yaw_rad)]) < 0.1
    assert np.linalg.norm(plan_m(walker)[-1] - line_m[-1]) > 5.0
    sidewalk = surfaces_of(network.layout).sidewalk.buffer(0.1)
    assert shapely.contains_xy(sidewalk, plan_m(walker)[on_road[-1] + 10 :]).all()


def test_other_pedestrians_keep_their_routes_when_some_may_jaywalk():
    spec = scene(vehicles=1, pedestrians=24)
    some = tuple(each.model_copy(update={"jaywalks": index % 2 == 0}) for index, each in enumerate(spec.pedestrians))
    changed = demand_of(spec.model_copy(update={"pedestrians": some}), blocks())
    assert not demand_of(spec, blocks()).excursions
    assert changed.excursions
    assert all(index % 2 == 0 for index in changed.excursions)
    for legs in changed.excursions.values():
        assert all(set(leg.edges) <= changed.edges for leg in legs)
        assert [leg.excursion is None for leg in legs] == [False] * (len(legs) - 1) + [True]


def draw_town(town: str, seed: int, **traffic):
    """A scene with careful drivers only, and its network."""
    scenario = Scenario.model_validate(
        {
            "seed": seed,
            "scenes": [{"map": town, "train": 1}],
            "rig": Rig(sensors=()),
            "ego": {"reckless_probability": 0.0},
            "traffic": {"spawn_radius_m": 250.0, "reckless_probability": 0.0, "group_probability": 0.0, **traffic},
        }
    )
    planned = next(iter(planned_scenes(scenario)))
    network = load_network(planned.map)
    return draw_scene(scenario, planned, network), network


def test_about_the_drawn_share_may_jaywalk_but_never_wheelchair_users():
    for factor in (0.0, 0.3, 1.0):
        spec, _ = draw_town(BLOCKS.name, 3, vehicles=1, pedestrians=300, walker_cross_factor=factor)
        walking_pedestrians = [each for each in spec.pedestrians if each.blueprint != "pedestrian.wheelchair"]
        assert spec.walker_cross_factor == factor
        assert np.mean([each.jaywalks for each in walking_pedestrians]) == pytest.approx(factor, abs=0.07)
        assert not any(each.jaywalks for each in spec.pedestrians if each.blueprint == "pedestrian.wheelchair")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("town", "seed"), [("Blocks", 1), ("Town01", 2), ("Town03", 3), ("Town05", 4), ("Town10HD", 5)]
)
def test_careful_drivers_hit_no_jaywalker_in_the_towns(town, seed):
    spec, network = draw_town(town, seed, vehicles=60, pedestrians=100)
    jaywalks, before = 0, np.zeros(0, bool)
    with Simulation(spec, network) as simulation:
        for _ in range(spec.warm_up_ticks + spec.ticks):
            state = simulation.step()
            now = is_crossing(state.actors)
            jaywalks += np.count_nonzero(now & ~before) if len(before) else 0
            before = now
            hit = np.isin(state.actors["id"], [each for event in state.events for each in event.ids])
            assert not np.any(hit & now)
    assert jaywalks >= 3
    assert len(of_kind(state.actors[None], "pedestrian"))
