import math
from dataclasses import replace

import numpy as np
import pytest
from synthetic_world import EGO_ID, actor, box_model, mesh, sheet, static_scene, world

from simbev_ros.assets.materials import Material
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.foundation.types import BoolArray, UInt16Array
from simbev_ros.simulation.annotation.bev.bev_annotator import BevAnnotator

GRID = BevGrid(rows=20, columns=30, cell_m=1.0)
MODELS = (
    box_model(Tag.CAR, (4.0, 2.0, 1.5)),
    box_model(Tag.BICYCLE, (3.0, 1.0, 1.0)),
    box_model(Tag.RIDER, (1.0, 1.0, 1.6)),
    box_model(Tag.PEDESTRIAN, (0.2, 0.2, 1.8)),
    replace(box_model(Tag.DYNAMIC, (1.0, 2.0, 1.0)), box_class="barrier"),
    replace(box_model(Tag.DYNAMIC, (1.0, 1.0, 1.0)), box_class="traffic_cone"),
    replace(box_model(Tag.TRAFFIC_SIGN, (1.0, 1.0, 1.0)), box_class="traffic_sign"),
    box_model(Tag.DYNAMIC, (1.0, 1.0, 1.0)),
)
NOTHING = static_scene()


def cells(labels: UInt16Array, name: str) -> BoolArray:
    return labels >> BEV_CLASSES.index(name) & 1 == 1


def block(rows: slice, columns: slice) -> BoolArray:
    expected = np.zeros((GRID.rows, GRID.columns), bool)
    expected[rows, columns] = True
    return expected


# Row r has its center at x = 9.5 - r, column c at y = 14.5 - c.


@pytest.mark.parametrize("yaw", [0.0, 0.5, math.pi / 2, -2.3])
def test_a_car_ahead_on_the_left_is_in_the_upper_left_for_every_heading(yaw: float) -> None:
    forward, left = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
    position_m = np.array([40.0, -70.0]) + 6.0 * forward + 9.1 * left
    ego = actor(MODELS[0], x=40.0, y=-70.0, z=3.0, yaw=yaw)
    other = actor(MODELS[0], id=9, x=position_m[0], y=position_m[1], z=3.0, yaw=yaw)
    labels = BevAnnotator(NOTHING, MODELS).labels(world(ego, other), GRID)
    # The other: x 4..8 → rows 2..5; y 8.1..10.1 → columns 5..6. The ego: x -2..2, y -1..1 → rows 8..11, columns 14..15.
    expected = block(slice(2, 6), slice(5, 7)) | block(slice(8, 12), slice(14, 16))
    assert np.array_equal(cells(labels, "car"), expected)
    assert not (labels & ~np.uint16(1 << BEV_CLASSES.index("car"))).any()


def test_a_car_across_the_heading_covers_more_columns_than_rows() -> None:
    other = actor(MODELS[0], id=9, x=-5.0, y=-7.0, yaw=math.pi / 2)
    labels = BevAnnotator(NOTHING, MODELS).labels(world(actor(MODELS[0]), other), GRID)
    # x -6..-4 → rows 14..15; y -9..-5 → columns 20..23.
    expected = block(slice(14, 16), slice(20, 24)) | block(slice(8, 12), slice(14, 16))
    assert np.array_equal(cells(labels, "car"), expected)


def test_a_cell_under_a_cyclist_is_rider_and_bicycle_and_road() -> None:
    road = mesh(sheet([-50, -50], [50, 50]), Tag.ROAD, Material.ASPHALT)
    bicycle = actor(MODELS[1], 1, id=8, x=5.5, y=4.5)
    rider = actor(MODELS[2], 2, id=9, parent=8, x=5.5, y=4.5, z=0.5)
    labels = BevAnnotator(static_scene(road), MODELS).labels(world(actor(MODELS[0]), bicycle, rider), GRID)
    assert cells(labels, "road").all()
    assert np.array_equal(cells(labels, "bicycle"), block(slice(3, 6), slice(10, 11)))
    assert np.array_equal(cells(labels, "rider"), block(slice(4, 5), slice(10, 11)))


def test_surfaces_and_markings_have_separate_bits_and_sidewalks_end_with_their_mesh() -> None:
    road = mesh(sheet([-50, -3], [50, 3]), Tag.ROAD)
    line = mesh(sheet([2, -0.6], [7, 0.3], 0.01), Tag.ROAD_LINE)
    sidewalk = mesh(sheet([-50, 3], [50, 5], 0.15), Tag.SIDEWALK)
    roof = mesh(sheet([-50, -50], [50, 50], 9.0), Tag.BUILDING)
    crosswalk, hazard = mesh(sheet([-4, -3], [-2, 3]), Tag.ROAD), mesh(sheet([6, -14], [9, -12]), Tag.ROAD)
    origin_m = (5000.0, -6000.0, 20.0)
    static = static_scene(road, line, sidewalk, roof, origin_m=origin_m, crosswalk=crosswalk, hazard=hazard)
    ego = actor(MODELS[3], 3, x=origin_m[0], y=origin_m[1], z=origin_m[2])
    labels = BevAnnotator(static, MODELS).labels(world(ego), GRID)
    all_rows = slice(0, 20)
    assert np.array_equal(cells(labels, "road"), block(all_rows, slice(12, 18)))
    assert np.array_equal(cells(labels, "road_line"), block(slice(3, 8), slice(15, 16)))
    assert np.array_equal(cells(labels, "sidewalk"), block(all_rows, slice(10, 12)))
    assert np.array_equal(cells(labels, "crosswalk"), block(slice(12, 14), slice(12, 18)))
    assert np.array_equal(cells(labels, "hazard"), block(slice(1, 4), slice(27, 29)))
    assert not cells(labels, "pedestrian").any()  # smaller than a cell and beside all centers


def test_actors_partly_inside_the_grid_are_labeled() -> None:
    other = actor(MODELS[0], id=9, x=11.2, y=0.0)  # x 9.2..13.2: only row 0 (x = 9.5)
    labels = BevAnnotator(NOTHING, MODELS).labels(world(actor(MODELS[3], 3, id=EGO_ID), other), GRID)
    assert np.array_equal(cells(labels, "car"), block(slice(0, 1), slice(14, 16)))


def test_a_tilted_ego_has_the_same_horizontal_grid() -> None:
    other = actor(MODELS[0], id=9, x=6.0, y=9.1)
    level = BevAnnotator(NOTHING, MODELS).labels(world(actor(MODELS[3], 3), other), GRID)
    tilted = actor(MODELS[3], 3, pitch=0.1, roll=-0.1)
    assert np.array_equal(BevAnnotator(NOTHING, MODELS).labels(world(tilted, other), GRID), level)


def test_barriers_and_cones_have_separate_bits_and_signs_and_other_props_have_none() -> None:
    row = [actor(MODELS[4 + k], 4 + k, id=10 + k, x=5.5, y=9.6 - 4.0 * k) for k in range(4)]
    labels = BevAnnotator(NOTHING, MODELS).labels(world(actor(MODELS[3], 3), *row), GRID)
    assert np.array_equal(cells(labels, "barrier"), block(slice(4, 5), slice(4, 6)))
    assert np.array_equal(cells(labels, "traffic_cone"), block(slice(4, 5), slice(9, 10)))
    assert np.count_nonzero(labels) == 3
