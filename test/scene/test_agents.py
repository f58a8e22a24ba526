"""A scene with several agents: each has its own view of the specification and of the states."""

import pickle
from typing import Any

import numpy as np
import pytest
from made_up_scene import SENSORS, made_up_spec
from pydantic import ValidationError
from scene_edits import with_ego
from several_agents import blocks_agents, car, made_up_agents, roadside_unit, with_agents

from simbev_ros.config.sensor import Pose
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.frames import ego_size_m
from simbev_ros.schema.scene.agents import STATION_IDS, agent_view, agent_views
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE, WorldState


def state() -> WorldState:
    """Vehicles 1 to 4 in a row along x, 10 m apart; a rider on the third."""
    actors = np.zeros(5, ACTOR_DTYPE)
    actors["id"], actors["x"], actors["yaw"] = 1 + np.arange(5), 10.0 * np.arange(5), 0.1 * np.arange(5)
    actors["parent"][4] = 3
    spec = made_up_agents()
    return WorldState(spec.stamp_ns(0), 0, EGO_ID, actors, np.zeros(0, SIGNAL_DTYPE), spec.weather)


def test_the_only_agent_is_the_ego() -> None:
    spec = made_up_spec(SENSORS)
    (view,) = agent_views(spec)
    assert view == agent_view(spec) == agent_view(spec, "ego") and view.is_ego
    assert (view.vehicle, view.ego_id, view.noise_seed) == (spec.vehicles[0], EGO_ID, spec.seed)
    assert view.station is None and view.rig == spec.agents[0].rig


def test_the_ego_is_the_first_agent_and_rides_in_the_first_vehicle() -> None:
    data = made_up_agents().model_dump(mode="json")
    for agents, message in (
        ([], "at least 1 item"),
        (data["agents"][1:], "agents: car, the ego, must have vehicle 0"),
        (data["agents"][::-1], "agents: rsu, the ego, must have vehicle 0"),
    ):
        with pytest.raises(ValidationError, match=message):
            SceneSpec.model_validate(data | {"agents": agents})


@pytest.mark.parametrize("spec", [made_up_agents, blocks_agents])
def test_a_specification_with_agents_survives_json(spec: Any) -> None:
    assert SceneSpec.model_validate_json(spec().model_dump_json()) == spec()


@pytest.mark.parametrize(
    ("agents", "message"),
    [
        ([car("car", 4)], "agents: there is no vehicle 4; the scene has 4"),
        ([car("car", 0)], "agents: two agents have the same vehicle"),
        ([car("a", 2), car("b", 2)], "agents: two agents have the same vehicle"),
        ([car("a", 1), roadside_unit("a")], "agents: two agents are called a; names must be unique"),
        ([car("ego", 1)], "agents: two agents are called ego; names must be unique"),
        ([{**car("a", 1), **roadside_unit("a")}], "agent a: needs either a vehicle or a station"),
        ([{**car("a", 1), "vehicle": None}], "agent a: needs either a vehicle or a station"),
        (
            [{**roadside_unit("r"), "frames": {"odom": True}}],
            "agent r: a roadside unit has neither wheels nor a driver",
        ),
        ([{**roadside_unit("r"), "base_link_x_m": -1}], "agent r: a roadside unit has neither wheels nor a driver"),
        ([{**roadside_unit("r"), "driver": "twist"}], "agent r: a roadside unit has neither wheels nor a driver"),
        (
            [roadside_unit("r", [{"type": "odometry", "name": "wheel"}])],
            "agent r: a roadside unit has neither wheels nor a driver",
        ),
        ([roadside_unit(f"r{k}") for k in range(32)], "agents: Tuple should have at most 32 items after validation"),
    ],
)
def test_agents_that_a_scene_cannot_have_are_refused(agents: list[dict[str, Any]], message: str) -> None:
    with pytest.raises(ValidationError) as refusal:
        with_agents(made_up_spec([], number=2), *agents)
    (error,) = refusal.value.errors()
    place = "".join(f"{part}." for part in error["loc"]).rstrip(".")
    assert message in f"{place}: {error['msg']}"


def test_each_agent_has_a_view_with_its_own_rig_frames_labels_and_vehicle() -> None:
    own = {"frames": {"base_link": "rear_axle"}, "base_link_x_m": -1.4, "annotation": {"box_radius_m": 50}}
    spec = with_agents(made_up_spec(SENSORS, number=2), car("car", 2, [], **own, driver="twist"), roadside_unit())
    first, second, mast = agent_views(spec)
    assert [view.agent for view in (first, second, mast)] == ["ego", "car", "rsu"]
    assert [view.ego_id for view in (first, second, mast)] == [1, 3, STATION_IDS + 1]
    assert [view.is_ego for view in (first, second, mast)] == [True, False, False]
    assert (second.vehicle, second.station) == (spec.vehicles[2], None)
    assert (mast.vehicle, mast.station) == (None, spec.agents[2].station)
    assert second.rig == spec.agents[1].rig and second.frames == spec.agents[1].frames
    assert (second.base_link_x_m, second.annotation.box_radius_m, second.spec.driver) == (-1.4, 50, "twist")
    assert (mast.base_link_x_m, mast.spec.driver) == (0.0, "traffic")


def test_an_agent_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(KeyError, match="Blocks-0002: no agent 'bus'; there are: ego, car, rsu"):
        agent_view(made_up_agents(), "bus")


def test_views_survive_pickling() -> None:
    _, view, _ = agent_views(made_up_agents())
    assert pickle.loads(pickle.dumps(view)) == view


def test_agents_with_equal_rigs_have_different_noise_whatever_other_agents_there_are() -> None:
    spec = made_up_spec(SENSORS, number=2)
    cars, mast = [car("a", 1), car("b", 2)], roadside_unit()
    views = agent_views(with_agents(spec, *cars, mast))
    seeds = {view.agent: view.noise_seed for view in views}
    assert len(set(seeds.values())) == 4 and seeds["ego"] == spec.seed
    for agents in ([mast, *cars[::-1]], [cars[1]]):
        for view in agent_views(with_agents(spec, *agents)):
            assert view.noise_seed == seeds[view.agent]
    other = with_agents(spec.model_copy(update={"seed": 3}), *cars)
    assert agent_view(other, "a").noise_seed != seeds["a"]


def test_the_lead_in_covers_the_slowest_sensor_of_all_agents() -> None:
    slow = [{"type": "lidar", "name": "slow", "rate_hz": 2}]
    spec = made_up_spec([{"type": "lidar", "name": "lidar", "rate_hz": 5}]).model_copy(update={"warm_up_ticks": 40})
    assert spec.lead_in_ticks == 4
    several = with_agents(spec, car("car", 1, []), roadside_unit("rsu", slow))
    assert (several.lead_in_ticks, several.loaded_tick) == (10, -11)
    assert made_up_spec([]).lead_in_ticks == 1


@pytest.mark.parametrize(("first", "second"), [("traffic", "twist"), ("twist", "traffic")])
def test_a_scene_is_driven_by_traffic_if_all_its_agents_are(first: str, second: str) -> None:
    spec = made_up_spec([])
    assert spec.is_driven_by_traffic
    assert not with_agents(with_ego(spec, driver=first), car("car", 1, driver=second)).is_driven_by_traffic


def test_a_car_sees_itself_as_the_ego() -> None:
    seen = agent_view(made_up_agents(), "car").ego_state(state())
    assert (seen.ego["id"], seen.ego["x"], seen.ego_ids) == (3, 20.0, {3, 5})
    np.testing.assert_array_equal(seen.distance_to_ego_m, [20.0, 10.0, 0.0, 10.0, 20.0])


def test_a_roadside_unit_sees_all_actors_from_the_foot_of_its_mast() -> None:
    before = state()
    seen = agent_view(made_up_agents(), "rsu").ego_state(before)
    assert seen.actors is before.actors and seen.ego_ids == {STATION_IDS + 1}
    pose = {name: float(seen.ego[name]) for name in ("x", "y", "z", "roll", "pitch", "yaw")}
    assert pose == {"x": 12.0, "y": -3.0, "z": 1.0, "roll": 0.0, "pitch": 0.0, "yaw": 1.5}
    assert not any(seen.ego[name] for name in ("vx", "vy", "vz", "wz", "length", "width", "height", "parent"))
    np.testing.assert_allclose(seen.distance_to_ego_m, np.hypot(10.0 * np.arange(5) - 12.0, 3.0))


def test_the_first_agent_is_the_ego_again_in_its_own_view() -> None:
    spec = made_up_agents()
    seen = agent_view(spec).ego_state(agent_view(spec, "rsu").ego_state(state()))
    assert (seen.ego_id, seen.ego["x"], seen.station) == (1, 0.0, None)


def test_a_roadside_unit_has_no_size() -> None:
    sizes_m = [ego_size_m(view) for view in agent_views(made_up_agents())]
    assert sizes_m == [blueprint_named("vehicle.sedan").size_m] * 2 + [(0.0, 0.0, 0.0)]


def test_the_row_of_an_agent_is_that_of_the_state_which_it_sees() -> None:
    for view in agent_views(made_up_agents()):
        assert view.ego_row(state().actors) == view.ego_state(state()).ego


def test_a_table_without_the_vehicle_of_an_agent_is_refused() -> None:
    with pytest.raises(ValueError, match="actor 3, which carries car, is missing"):
        agent_view(made_up_agents(), "car").ego_row(state().actors[:2])


def test_poses_are_equal_whatever_they_have_cached() -> None:
    first, second = Pose(x_m=1.0), Pose(x_m=1.0)
    assert first.ego_from_sensor is not second.ego_from_sensor
    assert first == second and hash(first) == hash(second) and first != Pose(x_m=2.0)
