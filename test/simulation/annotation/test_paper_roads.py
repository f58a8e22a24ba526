"""The paper's roads: cells nearer to the middle of a lane than its width, on the lane's level, without small gaps."""

import numpy as np
import pytest
from synthetic_world import actor, box_model, static_scene, world

from simbev_ros.config.annotation import Annotation
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.simulation.annotation.bev.bev_annotator import BevAnnotator
from simbev_ros.simulation.annotation.bev.paper_roads import close_roads, lane_areas
from simbev_ros.simulation.annotation.scene_annotator import MeshAnnotators, SceneAnnotator

GRID = BevGrid(rows=60, columns=40, cell_m=0.5)
MODELS = (box_model(Tag.CAR, (4.0, 2.0, 1.5)),)
ROAD = np.uint16(1 << BEV_CLASSES.index("road"))


def strip(left_m: list[tuple[float, float]], right_m: list[tuple[float, float]], kind: LaneKind, level: int) -> Strip:
    borders_m = [np.array([(x_m, y_m, 6.0 * level) for x_m, y_m in border_m]) for border_m in (left_m, right_m)]
    return Strip("road", "road", kind, *borders_m, level=level)


def test_a_cell_is_road_if_it_is_nearer_to_the_middle_of_a_lane_than_its_width() -> None:
    # The lane widens from 2 m to 4 m.
    widening = strip([(-6, 1), (6, 2)], [(-6, -1), (6, -2)], LaneKind.DRIVING, 0)
    sidewalk = strip([(-6, 9), (6, 9)], [(-6, 7), (6, 7)], LaneKind.SIDEWALK, 0)
    (area,) = lane_areas(Layout((widening, sidewalk), (), (), ()))
    assert area.level == 0
    labels = BevAnnotator(static_scene(), MODELS).labels(world(actor(MODELS[0], x=0.0, y=0.0)), GRID, areas=(area,))
    ahead_m, left_m = np.meshgrid((29.5 - np.arange(60)) / 2.0, (19.5 - np.arange(40)) / 2.0, indexing="ij")
    waypoints_m = np.linspace(-6, 6, 4001)
    expected = np.zeros(labels.shape, bool)
    for x_m, width_m in zip(waypoints_m, np.interp(waypoints_m, [-6, 6], [2, 4]), strict=True):
        expected |= np.hypot(ahead_m - x_m, left_m) < width_m
    # Discs are polygons that lie up to 0.5 % of their radius inside.
    assert np.count_nonzero((labels & ROAD > 0) != expected) <= 2
    assert expected.sum() > 250


def test_lanes_of_each_level_are_an_area_of_their_own() -> None:
    layout = load_network(MapSpec(name="Town05", seed=0)).layout
    deck = next(each for each in layout.strips_of(LaneKind.DRIVING) if each.level > 0)
    areas = lane_areas(Layout((deck, layout.strips_of(LaneKind.DRIVING, level=0)[0]), (), (), ()))
    assert [area.level for area in areas] == [0, deck.level]


@pytest.mark.parametrize("gap", [1, 2, 3])
def test_small_gaps_are_closed_and_the_border_and_other_classes_stay(gap: int) -> None:
    labels = np.full((12, 12), 2, np.uint16)
    labels[:, :5] |= ROAD
    labels[:, 5 + gap :] |= ROAD
    closed = close_roads(labels)
    assert np.array_equal(closed & ROAD > 0, (labels & ROAD > 0) | (gap < 3))
    assert np.array_equal(closed & ~ROAD, labels & ~ROAD)


def test_an_agent_has_the_roads_that_its_configuration_asks_for() -> None:
    planned = PlannedScene(0, MapSpec(name="Blocks"), "train")
    network = load_network(planned.map)
    meshes = MeshAnnotators(static_scene(), MODELS)  # without any roads of meshes
    counts = []
    for road in ("exact", "paper"):
        annotation = Annotation.model_validate({"bev": {"road": road}})
        spec = draw_scene(load_scenario("paper").model_copy(update={"annotation": annotation}), planned, network)
        start_m, _ = network.pose_on_lane(spec.vehicles[0].start.lane, spec.vehicles[0].start.s_m)
        state = world(actor(MODELS[0], x=start_m[0], y=start_m[1], z=start_m[2]))
        (view,) = agent_views(spec)
        counts.append(np.count_nonzero(SceneAnnotator(view, network, meshes).surroundings(state).grid & ROAD))
        assert ('"road"' in spec.model_dump_json()) == (road == "paper")
    assert counts[0] == 0
    assert counts[1] > 10_000
