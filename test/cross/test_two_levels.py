"""Where Town04's motorway crosses itself, roads, cars and pedestrians are labeled on their own level only.

The ground truth uses height alone: near the crossing the upper road lies far above the lower one, also on its ramps.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import shapely
from synthetic_world import EGO_ID, actor, world

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Reach
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.level_members import LevelGraph
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.blueprints import blueprint_index
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.annotation.bev.bev_annotator import BevAnnotator
from simbev_ros.simulation.annotation.bev.levels import Levels
from simbev_ros.simulation.annotation.boxes.boxes import boxes_around_ego

pytestmark = pytest.mark.slow

SPEC = map_spec("Town04")
REACH = Reach((0.0, 0.0), 70.0)
CARLA_TOWN04 = Path(__file__).parents[2].parent / "shared/maps/carla/Town04.xodr"
GRID = BevGrid(rows=320, columns=320, cell_m=0.25)
MODELS = load_models()
CAMERA = Camera(type="camera", name="front", pose={"x_m": 0.3, "z_m": 1.6}, width_px=320, height_px=180)
LIDAR = Lidar(type="lidar", name="lidar", pose={"z_m": 1.8}, channels=32, columns=512)
BETWEEN_M = 2.5  # the roads of the two levels are further apart
FINE = BevGrid(rows=600, columns=600, cell_m=0.1)  # pedestrians are small
EGO_POSITIONS = ("on the deck", "on the ramp", "beneath the deck", "before the deck")
UPPER = EGO_POSITIONS[:2]


@dataclass(frozen=True)
class Crossing:
    """The map around the crossing, with traffic on both levels.

    Attributes:
        static: Meshes of the static world.
        levels: The level assignment under test.
        upper: Driving strips on the deck and of the same roads.
        lower: Driving strips that pass beneath.
        deck: Area of structures in plan.
        between_m: A height that separates the two levels.
        others: Cars and pedestrians on both levels, at the crossing and on the upper road's ramp.
    """

    static: StaticScene
    levels: Levels
    upper: list[Strip]
    lower: list[Strip]
    deck: shapely.Geometry
    between_m: float
    others: Table


def area_of(strip: Strip) -> shapely.Polygon:
    return shapely.Polygon(np.concatenate([strip.left_m, strip.right_m[::-1]])[:, :2]).buffer(0.0)


@pytest.fixture(scope="module")
def crossing() -> Crossing:
    network = load_network(SPEC)
    static = load_static_scene(SPEC, network, reach=REACH)
    layout = network.layout.near(shapely.Point(REACH.center_m).buffer(150.0), 0.0)
    near = [s for s in layout.strips if area_of(s).distance(shapely.Point(REACH.center_m)) < REACH.radius_m]
    deck = shapely.union_all([area_of(strip) for strip in near if strip.level > 0])
    driving = [strip for strip in near if strip.kind is LaneKind.DRIVING]
    roads = {strip.road for strip in driving if strip.level > 0}
    upper = [strip for strip in driving if strip.road in roads]
    lower = [strip for strip in driving if strip.road not in roads and area_of(strip).intersects(deck)]
    heights_m = [np.concatenate([dense_m(strip) for strip in strips])[:, 2] for strips in (upper, lower)]
    assert heights_m[0].min() - heights_m[1].max() > BETWEEN_M
    between_m = float(heights_m[0].min() + heights_m[1].max()) / 2.0
    others = actors_on(layout, upper, lower, deck)
    return Crossing(static, Levels(layout), upper, lower, deck, between_m, others)


def dense_m(strip: Strip, position_m: tuple[float, float] = REACH.center_m, near_m: float = 70.0) -> Float64Array:
    """(N, 3) points along the center of a strip, a meter apart, near the crossing."""
    center_m = strip.center_m
    path_m = np.cumsum([0.0, *np.linalg.norm(np.diff(center_m, axis=0), axis=1)])
    at_m = np.arange(0.5, path_m[-1], 1.0)
    points_m = np.stack([np.interp(at_m, path_m, center_m[:, axis]) for axis in range(3)], axis=1)
    return points_m[np.linalg.norm(points_m[:, :2] - position_m, axis=1) < near_m]


def on(strip: Strip, index: int, model: str, identity: int) -> Table:
    """An actor on one of a strip's points from ``dense_m``."""
    points_m = dense_m(strip)
    index = min(index % len(points_m), len(points_m) - 2)
    x, y, z = points_m[index]
    step_m = points_m[index + 1] - points_m[index]
    blueprint = blueprint_index()[model]
    yaw, pitch = np.arctan2(step_m[1], step_m[0]), -np.arctan2(step_m[2], np.hypot(*step_m[:2]))
    return actor(MODELS[blueprint], blueprint, id=identity, x=x, y=y, z=z, yaw=yaw, pitch=pitch)


def beneath(strip: Strip, deck: shapely.Geometry) -> int:
    """Index of the point on a strip where it first crosses the middle of a structure."""
    middle = shapely.get_parts(area_of(strip) & deck)[0].centroid
    return int(np.argmin(shapely.distance(shapely.points(dense_m(strip)[:, :2]), middle)))


def actors_on(layout: Layout, upper: list[Strip], lower: list[Strip], deck: shapely.Geometry) -> Table:
    """Cars on every lane above and beneath, pedestrians on the shoulders, cars on the upper road before the deck."""
    above = [strip for strip in upper if strip.level > 0]
    shoulders = layout.strips_of(LaneKind.SHOULDER)
    roads = {strip.road for strip in lower}
    rows = [on(strip, 15 + 9 * k, "vehicle.sedan", 100 + k) for k, strip in enumerate(above)]
    rows += [on(strip, beneath(strip, deck), "vehicle.sedan", 200 + k) for k, strip in enumerate(lower)]
    rows += [on(strip, 5 * k, "vehicle.sedan", 300 + k) for k, strip in enumerate(upper) if strip.level == 0]
    walks = [strip for strip in shoulders if strip.level > 0]
    positions = [(strip, index) for strip in walks if len(dense_m(strip)) > 35 for index in (4, 30)]
    rows += [on(strip, index, "pedestrian.man", 400 + k) for k, (strip, index) in enumerate(positions)]
    walks = [strip for strip in shoulders if strip.road in roads and area_of(strip).intersects(deck)]
    positions = [(strip, beneath(strip, deck) + ahead) for strip in walks for ahead in (-1, 0, 1)]
    rows += [on(strip, index, "pedestrian.woman", 500 + k) for k, (strip, index) in enumerate(positions)]
    return np.concatenate(rows)


def state_of(crossing: Crossing, ego_position: str) -> WorldState:
    deck = next(strip for strip in crossing.upper if strip.level > 0)
    under = crossing.lower[0]
    if ego_position == "on the deck":
        ego = on(deck, beneath(deck, crossing.deck), "vehicle.sedan", EGO_ID)
    elif ego_position == "on the ramp":
        ramps = [strip for strip in crossing.upper if strip.level == 0 and strip.road == deck.road]
        ramp = min(ramps, key=lambda strip: float(np.linalg.norm(strip.center_m[-1] - deck.center_m[0])))
        ego = on(ramp, len(dense_m(ramp)) - 12, "vehicle.sedan", EGO_ID)
    else:
        index = beneath(under, crossing.deck) - (0 if ego_position == "beneath the deck" else 30)
        ego = on(under, index, "vehicle.sedan", EGO_ID)
    ego["yaw"] += 0.07  # so that no line runs along between the centers of cells
    free = np.hypot(crossing.others["x"] - ego["x"], crossing.others["y"] - ego["y"]) > 5.0
    return world(ego, crossing.others[free])


def centers_m(state: WorldState, grid: BevGrid = GRID) -> Float64Array:
    """(rows, columns, 2) cell centers in the map frame."""
    c, s = np.cos(float(state.ego["yaw"])), np.sin(float(state.ego["yaw"]))
    return grid.centers_ego @ np.array([[c, s], [-s, c]]) + [state.ego["x"], state.ego["y"]]


def covered(points_m: Float64Array, corners_m: Float64Array) -> BoolArray:
    """Whether points of the plane lie in any of (T, 3, 3) triangles."""
    flat = shapely.polygons(corners_m[:, :, :2])
    flat = flat[shapely.area(flat) > 0.0]
    inside = np.zeros(points_m.shape[:-1], bool)
    inside.flat[shapely.STRtree(flat).query(shapely.points(points_m.reshape(-1, 2)), predicate="intersects")[0]] = True
    return inside


def triangles(static: StaticScene, tag: Tag, *levels: int) -> Float64Array:
    """(T, 3, 3) corners, map frame, of triangles with a tag in the tiles of some levels."""
    return np.concatenate(
        [
            tile.mesh.vertices[tile.mesh.triangles[tile.mesh.triangle_tag == tag]].astype(np.float64) + tile.origin_m
            for tile in static.tiles
            if tile.level in levels
        ]
    )


def labels_at(crossing: Crossing, state: WorldState, grid: BevGrid = GRID) -> dict[str, BoolArray]:
    ego_level = crossing.levels.ego_level(state)
    labels = BevAnnotator(crossing.static, MODELS).labels(state, grid, ego_level)
    return {name: labels >> bit & 1 == 1 for bit, name in enumerate(BEV_CLASSES)}


def ids_on_ego_level(crossing: Crossing, state: WorldState, ego_position: str) -> set[int]:
    """Ids of the actors on the ego's level."""
    actors = state.actors
    above = actors["z"] > crossing.between_m
    on_deck = above & shapely.contains_xy(crossing.deck, actors["x"], actors["y"])
    return set(actors["id"][above if ego_position in UPPER else ~on_deck].tolist())


@pytest.mark.parametrize("ego_position", EGO_POSITIONS)
def test_roads_and_lines_are_those_of_the_egos_level(crossing: Crossing, ego_position: str) -> None:
    state = state_of(crossing, ego_position)
    labels, points_m = labels_at(crossing, state), centers_m(state)
    for tag, name in ((Tag.ROAD, "road"), (Tag.ROAD_LINE, "road_line")):
        corners_m = triangles(crossing.static, tag, 0, 1)
        above = corners_m[:, :, 2].mean(axis=1) > crossing.between_m
        if ego_position in UPPER:
            expected = covered(points_m, corners_m[above])
        else:
            expected = covered(points_m, triangles(crossing.static, tag, 0))
        asked = np.ones(expected.shape, bool)
        if ego_position == "on the ramp":  # away from the deck the lower road is on the ground as the ego is
            gap_m = shapely.distance(shapely.points(points_m), crossing.deck)
            expected |= covered(points_m, corners_m[~above]) & (gap_m > 0.0)
            asked = (gap_m == 0.0) | (gap_m > 8.0)
        assert expected.mean() > (0.1 if name == "road" else 0.001)
        assert (labels[name] != expected)[asked].mean() < 2e-4, name


@pytest.mark.parametrize("ego_position", EGO_POSITIONS)
def test_cars_and_pedestrians_are_labeled_on_their_level(crossing: Crossing, ego_position: str) -> None:
    state = state_of(crossing, ego_position)
    labels, points_m = labels_at(crossing, state, FINE), centers_m(state, FINE)
    counts = ids_on_ego_level(crossing, state, ego_position)
    for tag, name, core_m in ((Tag.CAR, "car", (1.6, 0.6)), (Tag.PEDESTRIAN, "pedestrian", (0.06, 0.12))):
        whole, cores = np.zeros((2, *points_m.shape[:2]), bool)
        for row in state.actors[(state.actors["tag"] == tag) & np.isin(state.actors["id"], sorted(counts))]:
            c, s = np.cos(row["yaw"]), np.sin(row["yaw"])
            x_m, y_m = points_m[..., 0] - row["x"], points_m[..., 1] - row["y"]
            along_m, across_m = np.abs(c * x_m + s * y_m), np.abs(c * y_m - s * x_m)
            whole |= (along_m <= row["length"] / 2.0 + 0.05) & (across_m <= row["width"] / 2.0 + 0.05)
            cores |= (along_m <= core_m[0]) & (across_m <= core_m[1])
        assert cores.any()
        assert not (labels[name] & ~whole).any()
        assert not (cores & ~labels[name]).any()


@pytest.mark.parametrize("ego_position", EGO_POSITIONS)
def test_boxes_mark_the_actors_on_the_egos_level(crossing: Crossing, ego_position: str) -> None:
    state = state_of(crossing, ego_position)
    found = boxes_around_ego(state, 200.0, crossing.levels.ego_level(state))
    counts = ids_on_ego_level(crossing, state, ego_position)
    assert set(found["id"].tolist()) | {EGO_ID} == set(state.actors["id"].tolist())
    assert set(found["id"][found["on_ego_level"] == 1].tolist()) == counts - {EGO_ID}
    assert {0, 1} == set(found["on_ego_level"].tolist())


@pytest.mark.parametrize(
    ("source", "position_m"),
    [
        ("Town04", (0.0, 0.0)),
        ("Town05", (-10.0, 0.0)),
        pytest.param(
            str(CARLA_TOWN04),
            (5.0, -27.0),
            marks=pytest.mark.skipif(not CARLA_TOWN04.is_file(), reason="CARLA's maps are not here"),
        ),
    ],
)
def test_both_carriageways_above_belong_together_and_so_do_both_beneath(
    source: str, position_m: tuple[float, float]
) -> None:
    layout = load_network(map_spec(source)).layout.near(shapely.Point(position_m).buffer(200.0), 0.0)
    graph = LevelGraph(layout)
    driving = [strip for strip in layout.strips_of(LaneKind.DRIVING) if len(dense_m(strip, position_m, 30.0))]
    decks = [strip for strip in driving if strip.level > 0]
    deck = shapely.union_all([area_of(strip) for strip in decks])
    above_m, beneath_m = (
        np.concatenate([dense_m(strip, position_m, 30.0) for strip in strips])
        for strips in (decks, [strip for strip in driving if strip.level == 0 and area_of(strip).intersects(deck)])
    )
    beneath_m = beneath_m[shapely.contains_xy(deck, *beneath_m[:, :2].T)]
    assert above_m[:, 2].min() - beneath_m[:, 2].max() > 4.0
    for own_m, other_m in ((above_m, beneath_m), (beneath_m, above_m)):
        for ego_m in own_m[:: len(own_m) // 7]:
            members = graph.members(ego_m)
            assert members is not None
            assert members.holds(own_m).all()
            assert not members.holds(other_m).any()
