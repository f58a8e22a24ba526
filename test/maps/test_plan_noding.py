import numpy as np
import pytest
from numpy.typing import ArrayLike

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.plan.draft import Draft, DraftRoad, RoadClass
from simbev_ros.maps.plan.lines import arc, length_m
from simbev_ros.maps.plan.noding import divide_draft
from simbev_ros.maps.plan.plan import Plan

STREET = RoadClass(sidewalk_m=2.0)
ONE_WAY = RoadClass(one_way=True)


def road(name: str, points_m: ArrayLike, kind: RoadClass = STREET, layer: int = 0) -> DraftRoad:
    return DraftRoad(name, kind, np.array(points_m, np.float64), layer)


def arms_at(plan: Plan, x_m: float, y_m: float) -> list[str]:
    """Ids of the links at the node nearest to a position, which must be within 1 m."""
    away_m = np.linalg.norm(plan.nodes_m - [x_m, y_m], axis=1)
    assert away_m.min() < 1.0
    return sorted(link.id for link in plan.links_at()[int(away_m.argmin())])


def test_roads_of_one_layer_meet_where_they_cross_and_where_one_ends_on_another() -> None:
    plan = divide_draft(
        Draft([road("a", [[0, 0], [200, 0]]), road("b", [[50, -80], [50, 80]]), road("c", [[120, 0], [120, 90]])])
    )
    assert arms_at(plan, 50, 0) == ["a.0", "a.1", "b.0", "b.1"]
    assert arms_at(plan, 120, 0) == ["a.1", "a.2", "c"]


def test_road_that_ends_just_short_of_another_is_extended_and_one_that_ends_just_past_it_is_cut() -> None:
    plan = divide_draft(
        Draft([road("a", [[0, 0], [200, 0]]), road("b", [[50, 7], [50, 80]]), road("c", [[120, -9], [120, 90]])])
    )
    assert arms_at(plan, 50, 0) == ["a.0", "a.1", "b"]
    assert len(arms_at(plan, 120, 0)) == 3


def test_layers_meet_only_where_one_ends_at_a_vertex_of_the_other() -> None:
    over = road("over", [[50, -80], [50, 80]], layer=1)
    ramp = road("ramp", [[50, 80], [90, 90], [120, 0]], layer=1)
    plan = divide_draft(Draft([road("a", [[0, 0], [120, 0], [200, 0]]), over, ramp]))
    assert arms_at(plan, 120, 0) == ["a.0", "a.1", "ramp"]
    assert np.linalg.norm(plan.nodes_m - [50, 0], axis=1).min() > 30.0


def test_parallel_carriageways_a_few_meters_apart_stay_separate() -> None:
    pieces = [road(f"{y}.{x}", [[x, y], [x + 100, y]], ONE_WAY) for y in (0, 3) for x in (0, 100)]
    loops = [
        road("r", [[200, 0], [260, -40], [-60, -40], [0, 0]], ONE_WAY),
        road("l", [[200, 3], [260, 40], [-60, 40], [0, 3]], ONE_WAY),
    ]
    plan = divide_draft(Draft([*pieces, *loops]))
    assert arms_at(plan, 100, 0) == ["0.0", "0.100"]
    assert arms_at(plan, 100, 3) == ["3.0", "3.100"]


def test_junctions_that_are_too_close_are_merged() -> None:
    plan = divide_draft(
        Draft([road("a", [[0, 0], [200, 0]]), road("b", [[95, 0], [95, 80]]), road("c", [[105, 0], [105, -80]])])
    )
    assert len(arms_at(plan, 100, 0)) == 4


def test_closed_road_is_cut_only_where_others_meet_it() -> None:
    ring_m = arc(np.zeros(2), 60.0, -np.pi / 2.0, 2.0 * np.pi)
    ring_m[-1] = ring_m[0]
    plan = divide_draft(
        Draft([road("ring", ring_m, ONE_WAY), road("a", [[-200, 0], [-60, 0]]), road("b", [[60, 0], [200, 0]])])
    )
    halves = [link for link in plan.links if link.road.name == "ring"]
    assert len(halves) == 2
    assert [length_m(half.line_m) for half in halves] == pytest.approx([np.pi * 60.0] * 2, rel=0.01)


def test_dead_end_gets_a_turning_circle() -> None:
    plan = divide_draft(Draft([road("a", [[0, 0], [200, 0]])]))
    assert all(len(links) >= 2 for links in plan.links_at())
    circle = [link for link in plan.links if link.road.kind.one_way]
    assert len(circle) == 4
    eastern_m = np.concatenate([link.line_m for link in circle if link.line_m[:, 0].max() > 100.0])
    np.testing.assert_allclose(np.linalg.norm(eastern_m - [200, 0], axis=1), 11.0)


def test_sharp_angle_between_streets_is_widened() -> None:
    plan = divide_draft(Draft([road("a", [[0, 0], [300, 0]]), road("b", [[100, 0], [300, 60]])]))
    bent = next(link for link in plan.links if link.road.name == "b")
    start = bent.line_m[1] - bent.line_m[0]
    assert np.degrees(np.arctan2(start[1], start[0])) > 50.0


@pytest.mark.parametrize(
    ("roads", "message"),
    [
        ([road("a", [[0, 0], [50, 0]]), road("a", [[0, 9], [50, 9]])], "two roads have this name"),
        ([road("a", [[0, 0], [5, 0]])], "shorter than 8 m"),
        ([road("a", [[0, 0], [90, 0], [50, 50], [50, -50]])], "crosses itself"),
        ([road("a", [[0, 0], [90, 0]], ONE_WAY)], "one-way road must lead from road to road"),
    ],
)
def test_impossible_roads_are_refused(roads: list[DraftRoad], message: str) -> None:
    with pytest.raises(InputError, match=message):
        divide_draft(Draft(roads))
