import numpy as np
import pytest
import shapely
from scipy.optimize import LinearConstraint, minimize
from scipy.sparse import csc_array, csr_array

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land_features import Water
from simbev_ros.maps.plan.draft import Draft, DraftRoad, RoadClass
from simbev_ros.maps.plan.heights.profile import add_heights
from simbev_ros.maps.plan.heights.quadratic import solve_qp
from simbev_ros.maps.plan.heights.structures import split_structures
from simbev_ros.maps.plan.lines import points_at, stations_m
from simbev_ros.maps.plan.noding import divide_draft
from simbev_ros.maps.plan.plan import Plan

STREET = RoadClass(sidewalk_m=2.0)


def flat(xy_m: Float64Array) -> Float64Array:
    return np.full(len(xy_m), 3.0)


def cross(layer: int, elevated_m: float = 0.0) -> Plan:
    """Two streets that cross in the middle, the second on another layer over 400 m."""
    under = DraftRoad("under", STREET, np.array([[-400.0, 0.0], [400.0, 0.0]]))
    pieces = [((0, -600), (0, -200), 0), ((0, -200), (0, 200), layer), ((0, 200), (0, 600), 0)]
    roads = [
        DraftRoad(f"over{start}", STREET, np.array([start, end], np.float64), at, elevated_m if at else 0.0)
        for start, end, at in pieces
    ]
    return divide_draft(Draft([under, *roads]))


def heights_along(plan: Plan, name: str) -> tuple[Float64Array, Float64Array]:
    link = next(link for link in plan.links if link.id == name)
    return stations_m(link.line_m), link.line_m[:, 2]


def test_solver_finds_the_same_minimum_as_scipy() -> None:
    rng = np.random.default_rng(5)
    root, rows = rng.normal(size=(6, 6)), rng.normal(size=(9, 6))
    quadratic, linear = root @ root.T + np.eye(6), rng.normal(size=6) * 5.0
    low, high = np.array([-0.2] * 5 + [-np.inf] * 4), np.array([0.2] * 5 + [0.1] * 4)
    x = solve_qp(csc_array(quadratic), linear, csr_array(rows), low, high)
    truth = minimize(
        lambda v: v @ quadratic @ v / 2.0 - linear @ v,
        np.zeros(6),
        jac=lambda v: quadratic @ v - linear,
        constraints=LinearConstraint(rows, low, high),
        method="trust-constr",
        options={"gtol": 1e-10, "maxiter": 3000},
    )
    np.testing.assert_allclose(x, truth.x, atol=5e-4)


def test_roads_on_flat_land_lie_on_it() -> None:
    plan = add_heights(divide_draft(Draft([DraftRoad("a", STREET, np.array([[0.0, 0.0], [300.0, 0.0]]))])), flat, ())
    assert np.abs(np.concatenate([link.line_m[:, 2] for link in plan.links]) - 3.0).max() < 1e-3


@pytest.mark.parametrize("layer", [1, -1])
def test_other_layer_adapts_where_roads_cross(layer: int) -> None:
    plan = add_heights(cross(layer), flat, ())
    assert plan.notes == ()
    on_ground = next(link for link in plan.links if link.id == "under").line_m
    other = next(link for link in plan.links if link.road.layer == layer).line_m
    apart_m = points_at(other, np.array([200.0]))[0, 2] - points_at(on_ground, np.array([400.0]))[0, 2]
    assert 6.5 <= layer * apart_m < 8.0
    assert np.abs(on_ground[:, 2] - 3.0).max() < 0.5
    along_m, height_m = stations_m(other), other[:, 2]
    assert np.abs(np.diff(height_m) / np.diff(along_m)).max() <= 0.08


def test_violated_limits_are_noted_with_their_position() -> None:
    lines_m = {
        "a": [[-200, 0], [200, 0]],
        "b": [[-200, 60], [-30, 60], [30, 60], [200, 60]],
        "west": [[-60, 0], [-60, 60]],
        "east": [[60, 0], [60, 60]],
        "hump": [[-30, 60], [-10, -40], [10, -40], [30, 60]],
    }
    roads = [
        DraftRoad(name, STREET, np.array(line_m, np.float64), int(name == "hump")) for name, line_m in lines_m.items()
    ]
    plan = add_heights(divide_draft(Draft(roads)), flat, ())
    assert any("hump" in note and "no room for" in note for note in plan.notes)


def test_bridge_over_water_has_room_for_boats() -> None:
    water = Water(shapely.box(100, -200, 130, 200), 2.5)
    plan = add_heights(
        divide_draft(Draft([DraftRoad("a", STREET, np.array([[0.0, 0.0], [300.0, 0.0]]))])), flat, (water,)
    )
    road = next(link for link in plan.links if link.id == "a").line_m
    over = (road[:, 0] >= 100) & (road[:, 0] <= 130)
    assert road[over, 2].min() >= 5.49
    assert road[~over, 2].min() < 4.0


def test_elevated_road_is_a_bridge_only_where_it_is_above_the_land() -> None:
    plan = split_structures(add_heights(cross(1, elevated_m=8.0), flat, ()), flat)
    for link in plan.links:
        raised_m = link.line_m[:, 2] - 3.0
        if link.structure:
            assert raised_m.min() > 2.5
        elif link.road.elevated_m > 0.0:
            assert raised_m.max() < 3.5
    assert any(link.structure for link in plan.links)
    ends: dict[int, list[float]] = {}
    for link in plan.links:
        for node, end in ((link.start, 0), (link.end, -1)):
            ends.setdefault(node, []).append(float(link.line_m[end, 2]))
    assert max(max(heights) - min(heights) for heights in ends.values()) < 0.02
