"""Routes are legal lane by lane, as long as asked for, and what the traffic driver follows."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import shapely

from simbev_ros.config.drive import Drive
from simbev_ros.config.load import load_scenario
from simbev_ros.config.traffic import Traffic
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.scene.streets.vehicle_route import draw_vehicle_route
from simbev_ros.schema.scene.drive_spec import Command, RouteSpec
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec

PLANNED = PlannedScene(3, MapSpec(name="Blocks"), "train")
CHANGES = {Command.CHANGE_LEFT: 1, Command.CHANGE_RIGHT: -1}
TURNS = {Command.LEFT: (30.0, 180.0), Command.RIGHT: (-180.0, -30.0), Command.STRAIGHT: (-30.5, 30.5)}


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    return load_network(PLANNED.map)


def drawn(network: RoadNetwork, number: int = 3, **drive: Any) -> SceneSpec:
    changes = {"traffic": Traffic(vehicles=3, pedestrians=0), "drive": Drive.model_validate(drive)}
    return draw_scene(load_scenario("paper").model_copy(update=changes), PLANNED._replace(number=number), network)


def route_of(spec: SceneSpec) -> RouteSpec:
    assert spec.drive is not None
    return spec.drive.route


def runs(route: RouteSpec) -> list[tuple[Command, int, int]]:
    """Maneuvers with their first and last rows."""
    starts = [row for row, each in enumerate(route.command) if row == 0 or route.command[row - 1] != each]
    return [(route.command[a], a, b - 1) for a, b in pairwise([*starts, len(route.command)])]


@pytest.mark.parametrize("number", range(8))
def test_each_lane_follows_the_one_before_or_lies_beside_it(network: RoadNetwork, number: int) -> None:
    route = route_of(drawn(network, number, goal_m=[200, 700]))
    for row, (before, lane) in enumerate(pairwise(route.lane)):
        if before == lane:
            continue
        a, b = network.lanes[before], network.lanes[lane]
        if a.edge == b.edge:
            assert b.index - a.index == CHANGES[route.command[row + 1]]
        else:
            assert lane in a.successors
    assert all("passenger" in network.lanes[lane].classes for lane in route.lane)
    assert list(route.limit_mps) == pytest.approx([network.lanes[lane].speed_mps for lane in route.lane], abs=1e-3)


@pytest.mark.parametrize("number", range(8))
def test_points_lie_on_lane_centers_a_meter_apart_except_in_lane_changes(network: RoadNetwork, number: int) -> None:
    route = route_of(drawn(network, number, goal_m=300))
    steps_m = np.linalg.norm(np.diff(route.points_m[:, :2], axis=0), axis=1)
    assert steps_m.max() < 1.05
    assert np.cumsum(steps_m) == pytest.approx(route.distance_m[1:], abs=1e-3)
    assert route.length_m == pytest.approx(300.0, abs=0.2)
    on_lane = [row for row, each in enumerate(route.command) if each not in CHANGES]
    for row in on_lane[::7]:
        center = shapely.LineString(network.lanes[route.lane[row]].centerline_m[:, :2])
        assert center.distance(shapely.Point(route.points_m[row, :2])) < 0.002


@pytest.mark.parametrize("number", range(8))
def test_commands_of_junctions_tell_the_turn(network: RoadNetwork, number: int) -> None:
    route = route_of(drawn(network, number, goal_m=500))
    found = [each for each in runs(route) if each[0] in TURNS and each[1] > 1 and each[2] < len(route.x_m) - 3]
    assert found
    for command, first, last in found:
        turn_deg = np.degrees((route.yaw_rad[last + 1] - route.yaw_rad[first - 2] + np.pi) % (2.0 * np.pi) - np.pi)
        low, high = TURNS[command]
        assert low < turn_deg < high


def test_traffic_follows_the_route(network: RoadNetwork) -> None:
    spec = drawn(network, goal_m=600)
    edges = [network.lanes[lane].edge for lane in route_of(spec).lane if not network.lanes[lane].junction]
    passed = [edge for row, edge in enumerate(edges) if row == 0 or edges[row - 1] != edge]
    assert list(draw_vehicle_route(spec, network, 0).edges[: len(passed)]) == passed


def test_traffic_leaves_a_junction_with_the_goal_where_the_route_leads(network: RoadNetwork) -> None:
    whole = route_of(drawn(network, goal_m=600))
    turns = [row for row, each in enumerate(whole.command) if each in (Command.LEFT, Command.RIGHT)]
    assert len({whole.lane[row] for row in turns}) > 1
    for row in turns:
        spec = drawn(network, goal_m=whole.distance_m[row])
        lanes = [network.lanes[lane] for lane in route_of(spec).lane]
        behind = lanes[-1]
        while behind.junction:
            behind = network.lanes[behind.successors[0]]
        assert (
            draw_vehicle_route(spec, network, 0).edges[len({lane.edge for lane in lanes if not lane.junction})]
            == behind.edge
        )


def test_a_route_of_points_begins_and_ends_at_them(network: RoadNetwork) -> None:
    whole = route_of(drawn(network, 5, goal_m=400))
    rows = [0, len(whole.x_m) // 2, len(whole.x_m) - 1]
    outside = [next(row for row in range(each, -1, -1) if not network.lanes[whole.lane[row]].junction) for each in rows]
    points = [
        {
            "x_m": whole.x_m[row],
            "y_m": whole.y_m[row],
            "yaw_deg": float(np.degrees(whole.yaw_rad[row - 1 if row else 0])),
        }
        for row in outside
    ]
    route = route_of(drawn(network, route=points))
    assert route.points_m[0] == pytest.approx(whole.points_m[0], abs=0.02)
    assert route.points_m[-1] == pytest.approx(whole.points_m[outside[-1]], abs=0.02)
    ends = {"from": {"lane": whole.lane[0], "s_m": 5.0}, "to": points[-1]}
    from_lane = route_of(drawn(network, route=ends))
    assert from_lane.lane[0] == whole.lane[0]
    assert from_lane.points_m[0] == pytest.approx(network.pose_on_lane(whole.lane[0], 5.0)[0], abs=0.02)


@pytest.mark.parametrize(
    ("route", "problem"),
    [
        ([{"lane": "nowhere_0"}, {"x_m": 0, "y_m": 0}], r"drive.route\[0\].lane: map Blocks has no lane 'nowhere_0'"),
        ([{"x_m": 1e5, "y_m": 0}, {"x_m": 0, "y_m": 0}], r"drive.route\[0\]: \(100000, 0\) is"),
    ],
)
def test_points_off_the_roads_are_refused_with_their_field(
    network: RoadNetwork, route: list[dict[str, Any]], problem: str
) -> None:
    with pytest.raises(InputError, match=problem):
        drawn(network, route=route)


def test_a_goal_behind_the_start_is_refused(network: RoadNetwork) -> None:
    lane = next(each for each in network.lanes.values() if each.length_m > 50 and not each.junction and each.index == 1)
    with pytest.raises(InputError, match=r"drive.route: the goal is behind the start on the same road in map Blocks"):
        drawn(network, route=[{"lane": lane.id, "s_m": 40.0}, {"lane": lane.id, "s_m": 10.0}])


def test_a_route_changes_nothing_of_the_rest_of_the_scene(network: RoadNetwork) -> None:
    with_route = drawn(network, goal_m=200)
    scenario = load_scenario("paper").model_copy(update={"traffic": Traffic(vehicles=3, pedestrians=0)})
    without = draw_scene(scenario, PLANNED, network)
    ego = with_route.vehicles[0].model_copy(update={"via": ()})
    of_drives = {"drive": None, "yields_to_emergency": False, "wrecks_cleared_s": None}
    assert with_route.model_copy(update={**of_drives, "vehicles": (ego, *with_route.vehicles[1:])}) == without
    assert "drive" not in without.model_dump()
