"""Labels at a two-level crossing, checked cell by cell: a road along x climbs onto a deck above a road along y."""

import numpy as np
import pytest
from synthetic_world import EGO_ID, actor, box_model, mesh, sheet, world

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.scene.blueprints import blueprint_index
from simbev_ros.schema.boxes import SIGN_IDS, blank_boxes
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.annotation.bev.bev_annotator import BevAnnotator
from simbev_ros.simulation.annotation.bev.levels import Levels, on_ego_level
from simbev_ros.simulation.annotation.boxes.boxes import StaticObjects, boxes_around_ego

GRID = BevGrid(rows=240, columns=240, cell_m=0.5)
CAR = box_model(Tag.CAR, (4.0, 2.0, 1.5))
SEDAN = blueprint_index()["vehicle.sedan"]
TRUCK, PERSON = box_model(Tag.TRUCK, (8.0, 2.5, 3.0)), box_model(Tag.PEDESTRIAN, (1.1, 1.3, 1.8))
MODELS = [*[CAR] * (SEDAN + 1), TRUCK, PERSON]
DECK_M, RAMP_M, HEIGHT_M = 20.0, 150.0, 6.0

WEST, DECK, EAST = ([-RAMP_M, -4], [-DECK_M, 4]), ([-DECK_M, -4], [DECK_M, 4]), ([DECK_M, -4], [RAMP_M, 4])
BELOW = [-3, -150], [3, 150]
CURB_M = 0.8  # asphalt extends this far beyond the lanes of the lower road
WALK = [3.8, -150], [6, 150]  # on the lower road's right
DASHES = [([x, -0.1], [x + 3, 0.1]) for x in np.arange(-140.0, 140.0, 10.0)]  # on the upper road
Rectangle = tuple[list[float], list[float]]
SURFACES: dict[str, tuple[list[Rectangle], list[Rectangle]]] = {
    "crosswalk": ([([-3, 10], [3, 13])], [([11, -4], [14, 4])]),
    "hazard": ([([-2, -3], [2, 3]), ([-2, -30], [2, -26])], [([-9, -3], [-6, 3])]),
}
"""Surfaces of the lower road, and of the deck."""


def height_m(x: Float64Array) -> Float64Array:
    """Height of the upper road: 0 in the west, then a ramp, constant on the deck, down again to the east."""
    return HEIGHT_M * np.clip((RAMP_M - np.abs(x)) / (RAMP_M - DECK_M), 0.0, 1.0)


def strip(name: str, rectangle: Rectangle, level: int = 0, kind: LaneKind = LaneKind.DRIVING) -> Strip:
    (x0, y0), (x1, y1) = rectangle
    if kind is LaneKind.DRIVING and y1 - y0 < 10:  # along x
        x = np.linspace(x0, x1, 21)
        sides = [np.column_stack([x, np.full(21, y), height_m(x)]) for y in (y1, y0)]
    else:
        y = np.linspace(y0, y1, 21)
        sides = [np.column_stack([np.full(21, x), y, np.zeros(21)]) for x in (x0, x1)]
    return Strip(name, name, kind, *sides, level=level)


def crossing() -> tuple[Levels, BevAnnotator]:
    layout = Layout(
        (
            strip("west", WEST),
            strip("deck", DECK, level=1),
            strip("east", EAST),
            strip("below", BELOW),
            strip("walk", WALK, kind=LaneKind.SIDEWALK),
        ),
        (),
        (),
        (),
    )
    wide = [BELOW[0][0] - CURB_M, BELOW[0][1]], [BELOW[1][0] + CURB_M, BELOW[1][1]]
    ground = [mesh(sheet(*each), Tag.ROAD) for each in (WEST, EAST, wide)]
    ground += [mesh(sheet(*WALK, 0.12), Tag.SIDEWALK)]
    ground += [mesh(sheet(*dash), Tag.ROAD_LINE) for dash in DASHES if abs(dash[0][0] + 1.5) > DECK_M]
    deck = [mesh(sheet(*DECK, HEIGHT_M), Tag.ROAD)]
    deck += [mesh(sheet(*dash, HEIGHT_M), Tag.ROAD_LINE) for dash in DASHES if abs(dash[0][0] + 1.5) < DECK_M]
    origin_m = np.zeros(3)
    surfaces = [
        {name: Mesh.merge([mesh(sheet(*each), Tag.ROAD) for each in areas[level]]) for name, areas in SURFACES.items()}
        for level in (0, 1)
    ]
    tiles = Tile(origin_m, Mesh.merge(ground), surfaces[0]), Tile(origin_m, Mesh.merge(deck), surfaces[1], level=1)
    return Levels(layout), BevAnnotator(StaticScene(tiles, ()), MODELS)


def car(actor_id: int, x: float, y: float, z: float, yaw: float = 0.0) -> Table:
    return actor(CAR, SEDAN, id=actor_id, x=x, y=y, z=z, yaw=yaw)


def truck(actor_id: int, x: float, y: float, z: float, yaw: float = 0.0) -> Table:
    return actor(TRUCK, SEDAN + 1, id=actor_id, x=x, y=y, z=z, yaw=yaw)


def person(actor_id: int, x: float, y: float, z: float) -> Table:
    return actor(PERSON, SEDAN + 2, id=actor_id, x=x, y=y, z=z)


CUT_M = 4.0  # where a deck on the ego's level begins to hide the lower road
OTHERS = (
    *(car(8, 12.0, 1.0, HEIGHT_M), car(9, 0.5, 30.0, 0.0, 1.57), car(10, 0.0, 2.0, 0.0, 1.57)),
    *(truck(11, 5.0, 2.3, HEIGHT_M), truck(12, -1.4, -2.0, 0.0, 1.57), truck(13, 1.4, -45.0, 0.0, 1.57)),
    *(person(14, 18.0, -3.0, HEIGHT_M), person(15, 5.0, 1.0, 0.12), person(16, 5.0, 22.0, 0.12)),
)
ON_DECK, ON_LOWER, FAR_ON_LOWER = {8, 11, 14}, {9, 10, 12, 13, 15, 16}, {9, 13, 16}
EGOS = {
    "below": car(EGO_ID, -1.2, -25.0, 0.0, 1.4),
    "on the deck": car(EGO_ID, -6.0, -1.5, HEIGHT_M, 0.13),
    "on the ramp": car(EGO_ID, -55.0, -1.5, float(height_m(np.float64(-55.0))), -0.08),
}


def centers_m(state: WorldState) -> Float64Array:
    """(rows, columns, 2) cell centers in the map frame."""
    yaw = float(state.ego["yaw"])
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    return GRID.centers_ego @ turn.T + [state.ego["x"], state.ego["y"]]


def inside(points_m: Float64Array, *rectangles: Rectangle) -> BoolArray:
    return np.any([np.all((points_m >= low) & (points_m <= high), axis=-1) for low, high in rectangles], axis=0)


def under(points_m: Float64Array, rows: Table) -> BoolArray:
    """(rows, columns) whether cell centers are below actors."""
    covered = np.zeros(points_m.shape[:2], bool)
    for row in rows:
        c, s = np.cos(row["yaw"]), np.sin(row["yaw"])
        local = (points_m - [row["x"], row["y"]]) @ np.array([[c, -s], [s, c]])
        covered |= np.all(np.abs(local) <= [row["length"] / 2.0, row["width"] / 2.0], axis=-1)
    return covered


@pytest.mark.parametrize("place", EGOS)
def test_cells_are_labeled_only_with_surfaces_and_actors_on_the_egos_level(place: str) -> None:
    levels, annotator = crossing()
    state = world(EGOS[place], *OTHERS)
    labels = annotator.labels(state, GRID, levels.ego_level(state))
    points_m = centers_m(state)
    wide = [BELOW[0][0] - CURB_M, BELOW[0][1]], [BELOW[1][0] + CURB_M, BELOW[1][1]]
    upper = {"below": [WEST, EAST], "on the deck": [WEST, DECK, EAST], "on the ramp": [WEST, DECK, EAST]}[place]
    hidden_half_m = {"below": 0.0, "on the deck": np.inf, "on the ramp": CUT_M}[place]
    lower = np.abs(points_m[..., 1]) > hidden_half_m
    dashes = [dash for dash in DASHES if place != "below" or abs(dash[0][0] + 1.5) > DECK_M]
    ids = {"below": ON_LOWER, "on the deck": ON_DECK, "on the ramp": ON_DECK | FAR_ON_LOWER}[place] | {EGO_ID}
    expected = {
        "road": inside(points_m, *upper) | (inside(points_m, wide) & lower),
        "sidewalk": inside(points_m, WALK) & lower,
        "road_line": inside(points_m, *dashes),
    }
    for name, (below, above) in SURFACES.items():
        expected[name] = inside(points_m, *below) & lower | inside(points_m, *above) & (place != "below")
    labeled = state.actors[np.isin(state.actors["id"], sorted(ids))]
    for name, tag in (("car", Tag.CAR), ("truck", Tag.TRUCK), ("pedestrian", Tag.PEDESTRIAN)):
        expected[name] = under(points_m, labeled[labeled["tag"] == tag])
        assert expected[name].any()
    for name in BEV_CLASSES:
        found = labels >> BEV_CLASSES.index(name) & 1 == 1
        target = expected.get(name, np.zeros_like(found))
        assert not (wrong := found != target).any(), f"{name}: {np.argwhere(wrong)[:5]}"


@pytest.mark.parametrize(
    ("place", "ids"), [("below", ON_LOWER), ("on the deck", ON_DECK), ("on the ramp", ON_DECK | FAR_ON_LOWER)]
)
def test_boxes_of_all_levels_are_listed_with_a_flag_for_the_egos_level(place: str, ids: set[int]) -> None:
    levels, _ = crossing()
    state = world(EGOS[place], *OTHERS)
    found = boxes_around_ego(state, 120.0, levels.ego_level(state))
    assert list(found["id"]) == list(range(8, 17))
    assert set(found["id"][found["on_ego_level"] == 1].tolist()) == ids


@pytest.mark.parametrize(("place", "counts"), [("below", [0, 1, 1]), ("on the deck", [1, 0, 0])])
def test_lights_and_signs_are_on_the_level_of_the_road_beside_them(place: str, counts: list[int]) -> None:
    levels, _ = crossing()
    state = world(EGOS[place])
    feet_m = np.array([[10.0, -4.5, HEIGHT_M], [3.3, 2.0, 0.0], [-3.3, 60.0, 0.0]])
    signs = blank_boxes(3)
    signs["id"], signs["tag"] = SIGN_IDS + 1 + np.arange(3), Tag.TRAFFIC_SIGN
    signs["x"], signs["y"], signs["z"] = feet_m.T
    found = boxes_around_ego(state, 120.0, levels.ego_level(state), static_objects=StaticObjects(signs, feet_m))
    assert found["on_ego_level"].tolist() == counts


def test_a_rider_is_on_the_level_of_the_bicycle() -> None:
    levels, _ = crossing()
    bicycle, rider = car(11, 0.0, 0.0, HEIGHT_M), actor(CAR, SEDAN, id=12, parent=11, x=0.0, y=0.0, z=2.0)
    state = world(EGOS["on the deck"], bicycle, rider)
    assert on_ego_level(state, levels.ego_level(state)).tolist() == [True, True, True]


def test_far_from_structures_everything_counts() -> None:
    levels, _ = crossing()
    state = world(car(EGO_ID, 0.0, 900.0, 0.0), *OTHERS)
    assert levels.ego_level(state) is None
    assert boxes_around_ego(state, 2000.0, None)["on_ego_level"].all()
