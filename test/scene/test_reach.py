from dataclasses import replace

import numpy as np
import pytest
from analytic_maps import level_street
from made_up_scene import made_up_spec
from scene_edits import ego
from several_agents import car, roadside_unit, with_agents

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.region import Reaches, regions_of
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.scene.reach import loaded_reach, reach_of
from simbev_ros.schema.scene.agent_spec import AgentSpec
from simbev_ros.schema.scene.agents import agent_view, agent_views
from simbev_ros.schema.scene.spec import SceneSpec, VehicleSpec, WaypointSpec


def long_road() -> RoadNetwork:
    """A slow edge of 200 m that leads to a fast one of 9 km with two lanes; only the right lane can be entered."""
    slow, right, left = (
        lane("slow", "slow", 0, 0.0, 200.0, 10.0, ("right",)),
        lane("right", "fast", 0, 200.0, 9200.0, 20.0, ()),
        lane("left", "fast", 1, 200.0, 9200.0, 40.0, ()),
    )
    strips = [
        replace(strip, id=f"{strip.id}{k}", left_m=strip.left_m + np.array([512.0 * k, 0.0, 0.0]))
        for k in range(18)
        for strip in level_street().layout.strips
    ]
    lanes = {each.id: each for each in (slow, right, left)}
    return replace(level_street(), lanes=lanes, layout=Layout(tuple(strips), (), (), ()))


def lane(name: str, edge: str, index: int, start: float, end: float, speed: float, successors: tuple[str, ...]) -> Lane:
    x = np.arange(start, end + 1.0, 10.0)
    line_m = np.column_stack([x, np.full(len(x), 3.5 * index), np.zeros(len(x))])
    return Lane(name, edge, index, LaneKind.DRIVING, line_m, 3.5, speed, "", successors)


def scene(ticks: int, factor: float = 1.0) -> SceneSpec:
    vehicle = VehicleSpec.model_construct(start=WaypointSpec(lane="slow", s_m=0.0), speed_factor=factor)
    agent = AgentSpec.model_validate(ego())
    return SceneSpec.model_construct(
        agents=(agent,), vehicles=(vehicle,), warm_up_ticks=100, ticks=ticks, tick_ns=50_000_000
    )


def test_reach_covers_what_the_ego_can_drive_to_and_see() -> None:
    short, long = (reach_of(agent_view(scene(ticks)), long_road(), view_m=100.0) for ticks in (100, 900))
    assert short.center_m == (0.0, 0.0)
    assert short.radius_m == pytest.approx(10.0 * 10.0 + 100.0, abs=45.0)
    assert long.radius_m == pytest.approx(200.0 + 30.0 * 40.0 + 100.0, abs=45.0)


def test_an_ego_faster_than_the_limit_gets_farther() -> None:
    reach = reach_of(agent_view(scene(900, factor=1.25)), long_road(), view_m=100.0)
    assert reach.radius_m == pytest.approx(200.0 + (62.5 - 20.0) * 40.0 + 100.0, abs=45.0)


def test_small_maps_are_loaded_whole() -> None:
    assert loaded_reach(scene(100), level_street()) is None
    assert loaded_reach(scene(100), long_road(), 80.0) == reach_of(agent_view(scene(100)), long_road(), 80.0)


def test_several_agents_load_what_any_of_them_can_see() -> None:
    road = long_road()
    spec = made_up_spec([], number=1)
    ahead = spec.vehicles[1].model_copy(update={"start": WaypointSpec(lane="right", s_m=0.0)})
    behind = spec.vehicles[0].model_copy(update={"start": WaypointSpec(lane="slow", s_m=0.0)})
    spec = with_agents(
        spec.model_copy(update={"vehicles": (behind, ahead, behind)}), car("car", 1), roadside_unit(x_m=3000.0, y_m=0.0)
    )
    first, second, mast = (reach_of(view, road, 100.0) for view in agent_views(spec))
    assert first == reach_of(agent_view(spec.model_copy(update={"agents": spec.agents[:1]})), road, 100.0)
    assert (second.center_m, mast.center_m) == ((200.0, 0.0), (3000.0, 0.0))
    assert mast.radius_m == pytest.approx(100.0, abs=45.0), "it stays where it is"
    assert loaded_reach(spec, road, 100.0) == Reaches((first, second, mast))
    seen = {region for circle in (first, second, mast) for region in regions_of(road.layout, circle)}
    assert set(regions_of(road.layout, Reaches((first, second, mast)))) == seen != set(regions_of(road.layout))
