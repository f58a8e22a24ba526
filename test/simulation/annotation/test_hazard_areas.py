"""Hazard areas in the BEV grid match their outlines exactly and are on the right road level."""

import numpy as np
import pytest
import shapely
from synthetic_world import actor, box_model, static_scene, world

from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.maps.build import load_network
from simbev_ros.schema.scene.hazard import HazardKind, HazardSpec
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.simulation.annotation.bev.bev_annotator import BevAnnotator
from simbev_ros.simulation.annotation.bev.hazards import hazard_areas

GRID = BevGrid(rows=60, columns=40, cell_m=0.5)
MODELS = (box_model(Tag.CAR, (4.0, 2.0, 1.5)),)
TAPERED = ((2.0, -3.0), (14.0, -6.3), (13.0, 0.4), (6.0, 2.1), (-9.5, -3.2))


def hazard(outline_m: tuple[tuple[float, float], ...], z_m: float = 0.0) -> HazardSpec:
    return HazardSpec(kind=HazardKind.WORK_ZONE, outline_m=outline_m, z_m=z_m)


@pytest.mark.parametrize("yaw_rad", [0.0, 0.7, -2.0])
def test_the_hazard_bit_matches_the_outline(yaw_rad: float) -> None:
    x_m, y_m = 30.0, -200.0
    outline_m = tuple((x + x_m, y + y_m) for x, y in TAPERED)
    areas = hazard_areas([hazard(outline_m)], load_network(MapSpec(name="Blocks", seed=0)).layout)
    ego = actor(MODELS[0], x=x_m, y=y_m, yaw=yaw_rad)
    labels = BevAnnotator(static_scene(), MODELS).labels(world(ego), GRID, areas=areas)
    # Row r has its center at x = (29.5 - r) / 2 of the ego, column c at y = (19.5 - c) / 2.
    ahead_m, left_m = np.meshgrid((29.5 - np.arange(60)) / 2.0, (19.5 - np.arange(40)) / 2.0, indexing="ij")
    east_m = ahead_m * np.cos(yaw_rad) - left_m * np.sin(yaw_rad)
    north_m = ahead_m * np.sin(yaw_rad) + left_m * np.cos(yaw_rad)
    expected = shapely.contains_xy(shapely.Polygon(TAPERED), east_m, north_m)
    assert expected.sum() > 200
    assert np.array_equal(labels >> BEV_CLASSES.index("hazard") & 1 == 1, expected)


def test_an_area_is_on_the_level_of_the_road_below_it() -> None:
    layout = load_network(MapSpec(name="Town05", seed=0)).layout
    deck = next(strip for strip in layout.strips if strip.level > 0)
    x_m, y_m, z_m = deck.center_m[len(deck.center_m) // 2].tolist()
    outline_m = tuple((x_m + x, y_m + y) for x, y in ((0.5, 0.0), (0.0, 0.5), (-0.5, 0.0)))
    areas = hazard_areas([hazard(outline_m, z_m), hazard(outline_m, z_m - 6.0)], layout)
    assert [area.level for area in areas] == [deck.level, 0]
