from dataclasses import replace

import numpy as np
import pytest
from analytic_maps import level_street

from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.scene.reach import loaded_reach, reach_of
from simbev_ros.scene.spec import SceneSpec, VehicleSpec, WaypointSpec


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
    ego = VehicleSpec.model_construct(start=WaypointSpec(lane="slow", s_m=0.0), speed_factor=factor)
    return SceneSpec.model_construct(vehicles=(ego,), warm_up_ticks=100, ticks=ticks, tick_ns=50_000_000)


def test_reach_covers_what_the_ego_can_drive_to_and_see() -> None:
    short, long = (reach_of(scene(ticks), long_road(), view_m=100.0) for ticks in (100, 900))
    assert short.center_m == (0.0, 0.0)
    assert short.radius_m == pytest.approx(10.0 * 10.0 + 100.0, abs=45.0)
    assert long.radius_m == pytest.approx(200.0 + 30.0 * 40.0 + 100.0, abs=45.0)


def test_an_ego_faster_than_the_limit_gets_farther() -> None:
    reach = reach_of(scene(900, factor=1.25), long_road(), view_m=100.0)
    assert reach.radius_m == pytest.approx(200.0 + (62.5 - 20.0) * 40.0 + 100.0, abs=45.0)


def test_small_maps_are_loaded_whole() -> None:
    assert loaded_reach(scene(100), level_street()) is None
    assert loaded_reach(scene(100), long_road(), 80.0) == reach_of(scene(100), long_road(), 80.0)
