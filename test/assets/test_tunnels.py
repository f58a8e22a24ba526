"""Tunnels: rays inside hit walls and ceiling where the cross-section puts them, and the land above has no holes."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
import shapely
from analytic_maps import tunnel
from synthetic_world import EGO_ID, actor, box_model, world
from test_static_ground import build, cast, top_of

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.simulation.annotation.bev.bev_annotator import BevAnnotator
from simbev_ros.simulation.annotation.bev.levels import Levels

START_M, END_M, MIDDLE_M, HALF_M = 176.0, 336.0, 256.0, 6.0  # of the tunnel, from walls 2.5 + 3.5 m off its middle
CEILING_M, ROOF_M = 5.0, 5.6
BELOW_STREET, FLAT = tunnel, partial(tunnel, None)
MAPS = pytest.mark.parametrize("make", [BELOW_STREET, FLAT])
CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))


def inside_m(count: int = 1500, margin_m: float = 1.0) -> Float64Array:
    """(N, 3) random points inside the tunnel."""
    low, high = (START_M + margin_m, MIDDLE_M - 5.8, 0.3), (END_M - margin_m, MIDDLE_M + 5.8, 4.7)
    return np.random.default_rng(2).uniform(low, high, (count, 3))


@MAPS
def test_a_tunnel_has_walls_a_ceiling_and_a_road(make: Callable[[], RoadNetwork]) -> None:
    mesh, points_m = build(make).mesh, inside_m()
    for direction, expected_m, tags in (
        ((0.0, 0.0, 1.0), CEILING_M - points_m[:, 2], (Tag.WALL, Tag.STATIC)),
        ((0.0, 1.0, 0.0), MIDDLE_M + HALF_M - points_m[:, 1], (Tag.WALL,)),
        ((0.0, -1.0, 0.0), points_m[:, 1] - MIDDLE_M + HALF_M, (Tag.WALL,)),
        ((0.0, 0.0, -1.0), points_m[:, 2], (Tag.ROAD, Tag.ROAD_LINE, Tag.SIDEWALK)),
    ):
        distance_m, tag = cast(mesh, points_m, direction)
        assert np.isin(tag, tags).all(), direction
        surface = ~np.isin(tag, (Tag.STATIC, Tag.SIDEWALK))
        assert np.abs(distance_m - expected_m)[surface].max() < 0.03, direction
        assert (np.abs(distance_m - expected_m) < 0.25).all(), "lamps and curbs are small"


@MAPS
def test_a_car_drives_in_and_out_without_hitting_anything(make: Callable[[], RoadNetwork]) -> None:
    y, z = (value.ravel() for value in np.meshgrid(np.linspace(-5.5, 5.5, 23) + MIDDLE_M, np.linspace(0.2, 4.8, 9)))
    origins_m = np.column_stack([np.full(len(y), START_M - 30.0), y, z])
    distance_m, _ = cast(build(make).mesh, origins_m, (1.0, 0.0, 0.0))
    assert (distance_m > END_M - START_M + 60.0).all()


@MAPS
def test_the_land_above_is_closed_and_higher_than_the_roof(make: Callable[[], RoadNetwork]) -> None:
    rng = np.random.default_rng(4)
    xy_m = rng.uniform((START_M + 0.5, MIDDLE_M - 5.9), (END_M - 0.5, MIDDLE_M + 5.9), (4000, 2))
    height_m, tags = top_of(build(make).mesh, xy_m)
    assert (height_m >= ROOF_M - 0.03).all()
    assert not np.isin(tags, (Tag.UNLABELED,)).any()
    street = np.abs(xy_m[:, 0] - MIDDLE_M) < 6.0
    if make is BELOW_STREET:
        assert np.abs(height_m[street] - 9.0).max() < 0.15
        assert np.isin(tags[street], (Tag.ROAD, Tag.ROAD_LINE, Tag.SIDEWALK)).all()
    wall = np.abs(height_m - 6.5) < 0.05  # headwalls
    assert np.isin(tags[~street & ~wall], (Tag.TERRAIN, Tag.WALL, Tag.ROAD, Tag.ROAD_LINE, Tag.SIDEWALK)).all()


@MAPS
def test_no_light_falls_in_from_above(make: Callable[[], RoadNetwork]) -> None:
    """Steep rays upward from anywhere inside end in the tunnel."""
    points_m = inside_m(margin_m=4.0)
    for direction in ((0.5, 0.0, 1.0), (0.0, 0.6, 1.0), (-0.5, -0.5, 1.0)):
        distance_m, tag = cast(build(make).mesh, points_m, direction)
        assert np.isin(tag, (Tag.WALL, Tag.STATIC)).all()
        assert (distance_m * np.linalg.norm(direction) < 20.0).all()


def test_the_land_is_as_high_as_the_street_above_and_the_street_is_no_bridge() -> None:
    network, case = tunnel(), build(BELOW_STREET)
    levels = {strip.road: strip.level for strip in network.layout.strips}
    assert levels == {"low40": 0, "low176": 1, "low336": 0, "up": 0}
    assert network.layout.tunnel_levels == range(1, 2)
    beside_m = np.array([[MIDDLE_M + 9.0, MIDDLE_M], [MIDDLE_M - 9.0, MIDDLE_M + 30.0]])
    assert np.abs(case.ground.land_m(beside_m) - 9.0).max() < 0.6


def test_points_inside_are_found_and_their_distances_to_the_portals() -> None:
    tunnels = Tunnels.of_layout(tunnel().layout)
    points_m = np.random.default_rng(8).uniform((150.0, 245.0, -4.0), (360.0, 267.0, 12.0), (5000, 3))
    x, y, z = points_m.T
    across_m = np.abs(y - MIDDLE_M)
    clear = (np.abs(across_m - HALF_M) > 0.35) & (np.abs(x - START_M) > 0.35) & (np.abs(x - END_M) > 0.35)
    inside = (x > START_M) & (x < END_M) & (across_m < HALF_M) & (z > -1.0) & (z < CEILING_M + 0.3)
    assert np.array_equal(tunnels.holds(points_m)[clear], inside[clear])
    depth_m = tunnels.depths_m(points_m)
    along_m = np.minimum(x - START_M, END_M - x)
    assert (depth_m[~inside & clear] == 0.0).all()
    deep = inside & clear
    assert (depth_m[deep] >= along_m[deep] - 1e-9).all()
    assert (depth_m[deep] <= along_m[deep] + 2.0 * HALF_M).all()


def test_a_map_without_tunnels_holds_nothing() -> None:
    tunnels = Tunnels.of_layout(tunnel().layout.__class__((), (), (), ()))
    assert not tunnels
    assert not tunnels.holds(np.zeros((3, 3))).any()


@pytest.mark.parametrize(
    ("ego_m", "yaw", "middle_left_m"),
    [((244.0, 254.25, 0.0), 0.0, 1.75), ((254.25, 244.0, 9.0), np.pi / 2, -1.75)],
)
def test_labels_show_only_the_road_that_the_ego_is_on(
    ego_m: tuple[float, float, float], yaw: float, middle_left_m: float
) -> None:
    """In the tunnel its road is labeled and the street above is not; on that street it is the other way around."""
    network, case = tunnel(), build(BELOW_STREET)
    state = world(actor(CAR, x=ego_m[0], y=ego_m[1], z=ego_m[2], yaw=yaw, id=EGO_ID))
    level = Levels(network.layout).ego_level(state)
    grid = BevGrid(rows=160, columns=160, cell_m=0.5)
    labels = BevAnnotator(StaticScene(case.tiles, ()), [CAR]).labels(state, grid, level)
    road = (labels >> BEV_CLASSES.index("road") & 1).astype(bool)
    ahead_m, left_m = np.meshgrid(*[(79.5 - np.arange(160.0)) / 2.0] * 2, indexing="ij")
    own = (np.abs(left_m - middle_left_m) < 3.0) & (np.abs(ahead_m) < 38.0)
    other = (np.abs(ahead_m - 12.0) < 3.0) & (np.abs(left_m) > 9.0) & (np.abs(left_m) < 38.0)
    assert road[own].mean() > 0.99
    assert road[other].mean() < 0.01


def test_the_tube_has_its_area_in_plan() -> None:
    tube = build(BELOW_STREET).ground.tubes[1]
    assert shapely.area(tube) == pytest.approx((END_M - START_M + 0.8) * (2.0 * HALF_M + 0.8), rel=1e-3)
