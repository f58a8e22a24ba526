"""Pedestrians that walk in groups: side by side, on one route, at one speed."""

import numpy as np
import pytest
from pydantic import ValidationError

from simbev_ros.config.load import load_scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.scene.gait import transition_mps
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.simulation import Simulation

TOWN = map_spec("Town02")


def draw(probability, seed=5, pedestrians=120.0):
    scenario = load_scenario("paper")
    traffic = {"group_probability": probability, "vehicles": 2.0, "pedestrians": pedestrians, "spawn_radius_m": 300.0}
    time = scenario.time.model_copy(update={"warm_up_s": 4.0, "duration_s": 12.0})
    scenario = scenario.model_copy(update={"traffic": scenario.traffic.model_copy(update=traffic), "time": time})
    return draw_scene(scenario, PlannedScene(0, TOWN, "train", seed=seed), load_network(TOWN))


def groups(spec):
    return [(index, each.companion_of) for index, each in enumerate(spec.pedestrians) if each.companion_of is not None]


def test_companions_share_start_and_speed_and_can_walk_with_their_leader():
    spec = draw(0.5)
    assert 0.15 < len(groups(spec)) / len(spec.pedestrians) < 0.5
    for index, leader in groups(spec):
        own, first = spec.pedestrians[index], spec.pedestrians[leader]
        assert index - leader in (1, 2)
        assert first.companion_of is None
        assert (own.start, own.max_speed_mps) == (first.start, first.max_speed_mps)
        assert not (own.jaywalks or first.jaywalks or own.visits_plazas or first.visits_plazas)
        assert own.max_speed_mps <= transition_mps(blueprint_named(own.blueprint).tall_m)


def test_without_groups_everybody_walks_alone_and_other_draws_stay():
    alone, grouped = draw(0.0), draw(0.5)
    assert not groups(alone)
    assert [each.blueprint for each in alone.pedestrians] == [each.blueprint for each in grouped.pedestrians]
    single = {*range(len(alone.pedestrians))} - {index for pair in groups(grouped) for index in pair}
    assert all(alone.pedestrians[index] == grouped.pedestrians[index] for index in single)


def test_groups_stay_together():
    spec = draw(0.5)
    with Simulation(spec, load_network(TOWN)) as simulation:
        for _ in range(spec.warm_up_ticks + spec.ticks):
            actors = simulation.step().actors
    first_id = 1 + len(spec.vehicles) + sum(bool(blueprint_named(each.blueprint).rider) for each in spec.vehicles)
    place = {int(row["id"]) - first_id: np.array([row["x"], row["y"]]) for row in actors}
    apart_m = [np.linalg.norm(place[a] - place[b]) for a, b in groups(spec) if a in place and b in place]
    assert len(apart_m) > 15
    assert np.median(apart_m) < 2.0
    assert np.mean(np.array(apart_m) < 5.0) > 0.8


def test_a_companion_far_behind_its_leader_is_rejected():
    data = draw(0.0, pedestrians=6.0).model_dump(mode="json")
    data["pedestrians"][5]["companion_of"] = 2
    with pytest.raises(ValidationError, match=r"pedestrians\.5\.companion_of: is 2, not one of the two before it"):
        SceneSpec.model_validate(data)
