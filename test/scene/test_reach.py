from dataclasses import replace

import pytest
from analytic_maps import level_street

from simbev_ros.scene.reach import reach_of
from simbev_ros.scene.spec import SceneSpec, VehicleSpec, WaypointSpec


def scene(ticks: int, s_m: float) -> SceneSpec:
    ego = VehicleSpec.model_construct(start=WaypointSpec(lane="a.1", s_m=s_m), speed_factor=1.1)
    return SceneSpec.model_construct(vehicles=(ego,), warm_up_ticks=20, ticks=ticks, tick_ns=50_000_000)


def test_a_scene_reaches_as_far_as_its_ego_can_drive_and_see() -> None:
    reach = reach_of(scene(ticks=40, s_m=100.0), level_street())
    assert reach.center_m == pytest.approx((140.0, 257.75))
    assert reach.radius_m == pytest.approx(30.0 * 1.1 * 3.0 + 500.0)


def test_no_scene_reaches_beyond_its_map_and_what_is_seen_from_there() -> None:
    reach = reach_of(scene(ticks=4000, s_m=100.0), level_street())
    assert reach.radius_m == pytest.approx(328.0 + 500.0, abs=5.0)


def test_it_is_the_fastest_road_that_counts() -> None:
    network = level_street()
    faster = {name: replace(lane, speed_mps=60.0) for name, lane in network.lanes.items() if name == "a.2"}
    reach = reach_of(scene(ticks=40, s_m=100.0), replace(network, lanes={**network.lanes, **faster}))
    assert reach.radius_m == pytest.approx(60.0 * 1.1 * 3.0 + 500.0)
