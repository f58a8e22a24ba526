"""Hazard areas are drawn with the configured frequencies and properties, and each of them is consistent."""

import itertools
from functools import cache

import numpy as np
import pytest
import shapely
from scipy.stats import binomtest, kstest, uniform

from simbev_ros.config.hazards import Hazards
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.types import BoolArray
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.hazards.draw_hazards import DrawnHazards, draw_hazards
from simbev_ros.schema.scene.hazard import HazardKind, HazardSpec, PropSpec
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import StandSpec, VehicleSpec

BLUEPRINTS = {blueprint.name: blueprint for blueprint in load_blueprints()}
TOWN = MapSpec(name="Town06", seed=0)
FAR_M = np.array([1e5, 0.0, 0.0])
MIN_P = 0.01


@cache
def network() -> RoadNetwork:
    return load_network(TOWN)


@cache
def starts() -> StartPositions:
    return StartPositions(network(), 24.0)


def draw(config: Hazards, seed: int, near: BoolArray | None = None) -> DrawnHazards:
    """The hazards of a scene with an ego far away."""
    positions = starts().vehicles
    near = np.ones(len(positions), bool) if near is None else near
    return draw_hazards(config, seed, starts().hazard_sites(config.taper_factor), positions, near, FAR_M[None])


@cache
def many_hazards(scenes: int) -> tuple[HazardSpec, ...]:
    return tuple(hazard for seed in range(scenes) for hazard in draw(Hazards(count=7), seed).hazards)


@cache
def scenes_of_six() -> tuple[DrawnHazards, ...]:
    return tuple(draw(Hazards(count=6), seed) for seed in range(6))


def box(blueprint: str, stand: StandSpec | PropSpec) -> shapely.Polygon:
    length_m, width_m, _ = BLUEPRINTS[blueprint].size_m
    plan = shapely.box(-length_m / 2.0, -width_m / 2.0, length_m / 2.0, width_m / 2.0)
    cosine, sine = np.cos(stand.yaw_rad), np.sin(stand.yaw_rad)
    return shapely.transform(plan, lambda xy: xy @ [[cosine, sine], [-sine, cosine]] + [stand.x_m, stand.y_m])


def footprint(vehicle: VehicleSpec) -> shapely.Polygon:
    assert vehicle.stands_at is not None
    return box(vehicle.blueprint, vehicle.stands_at)


def is_share(count: int, of: int, probability: float) -> bool:
    return bool(binomtest(int(count), int(of), probability).pvalue > MIN_P)


@pytest.mark.slow
def test_kinds_emergency_vehicles_and_missing_cones_have_the_papers_frequencies() -> None:
    hazards = many_hazards(90)
    assert len(hazards) > 500
    accidents = [hazard for hazard in hazards if hazard.kind is HazardKind.ACCIDENT]
    cones = sum(prop.blueprint == "prop.traffic_cone" for hazard in hazards for prop in hazard.props)
    missing = sum(hazard.cones_missing for hazard in hazards)
    assert is_share(len(accidents), len(hazards), 0.5)
    assert is_share(sum(bool(hazard.emergency_vehicle) for hazard in accidents), len(accidents), 0.5)
    assert is_share(missing, missing + cones, 0.32)


@pytest.mark.slow
def test_each_site_with_room_becomes_a_hazard_with_the_configured_probability() -> None:
    positions, sites = starts().vehicles, starts().hazard_sites(0.5)
    chosen: list[int] = []
    for index in range(0, len(positions), 3):
        gaps_m = np.linalg.norm(positions.position_m[chosen] - positions.position_m[index], axis=1)
        site = sites.site_at(positions.lanes[positions.row[index]])
        if site is not None and not site.closes_road and gaps_m.min(initial=np.inf) > 600.0:
            chosen.append(index)
    near = np.isin(np.arange(len(positions)), chosen)
    count = sum(len(draw(Hazards(probability=0.25), seed, near).hazards) for seed in range(30))
    assert len(chosen) >= 5
    assert is_share(count, 30 * len(chosen), 0.25)


@pytest.mark.slow
@pytest.mark.parametrize("scenes", [25, 90])
def test_the_warning_sign_is_40_to_160_m_ahead_uniformly_where_no_junction_is_near(scenes: int) -> None:
    hazards = many_hazards(scenes)
    signs_m = np.array([hazard.sign_distance_m for hazard in hazards if hazard.sign_distance_m is not None])
    assert len(signs_m) == len(hazards) and signs_m.min() >= 40.0 and signs_m.max() <= 160.0
    after_long_lanes = np.array(
        [hazard.sign_distance_m for hazard in hazards if hazard.blocked and hazard.blocked[0].from_s_m > 160.0]
    )
    assert len(after_long_lanes) > 30
    assert kstest(after_long_lanes, uniform(40, 120).cdf).pvalue > MIN_P


def test_a_sign_stands_beside_the_road_and_faces_approaching_traffic() -> None:
    signs, on_the_right = 0, 0
    for hazard in many_hazards(25)[:60]:
        for prop in hazard.props:
            if prop.blueprint.startswith("prop.sign"):
                position_m = np.array([[prop.x_m, prop.y_m, prop.z_m]])
                lane = network().nearest_lane(position_m)
                gap_m = float(np.linalg.norm(position_m[0, :2] - lane.position_m[0, :2]))
                width_m = network().lanes[lane.lane[0]].width_m
                assert 0.0 < gap_m - width_m / 2.0 < 6.0
                aside_m = (position_m[0, :2] - lane.position_m[0, :2]) @ [np.sin(prop.yaw_rad), -np.cos(prop.yaw_rad)]
                on_the_right += aside_m > 0.0
                signs += 1
    assert on_the_right > 0.9 * signs > 50  # where roads merge, the nearest lane may belong to another road


def test_vehicles_stand_apart_inside_the_area_and_off_the_open_lanes() -> None:
    for scene in scenes_of_six():
        outlines = [shapely.Polygon(hazard.outline_m) for hazard in scene.hazards]
        stands = [footprint(vehicle) for vehicle in scene.vehicles]
        assert all(any(outline.covers(stand) for outline in outlines) for stand in stands)
        assert not any(a.intersects(b) for a, b in itertools.combinations(stands, 2))
        for hazard, outline in zip(scene.hazards, outlines, strict=True):
            inside = [v for v, stand in zip(scene.vehicles, stands, strict=True) if outline.covers(stand)]
            helpers = [vehicle for vehicle in inside if BLUEPRINTS[vehicle.blueprint].emergency]
            assert len(inside) - len(helpers) >= (2 if hazard.kind is HazardKind.ACCIDENT else 1)
            assert len(helpers) == bool(hazard.emergency_vehicle) and all(each.emergency_lights for each in helpers)
            closed = {stretch.lane for stretch in hazard.blocked}
            edge = network().lanes[hazard.blocked[0].lane].edge
            for lane in network().lanes.values():
                if lane.edge == edge and lane.id not in closed and "passenger" in lane.classes:
                    open_lane = shapely.LineString(lane.centerline_m[:, :2]).buffer(
                        lane.width_m / 2.0, cap_style="flat"
                    )
                    assert outline.intersection(open_lane).area < 0.01


def test_props_and_vehicles_do_not_touch_and_leave_open_lanes_free() -> None:
    lanes = [lane for lane in network().lanes.values() if lane.kind is LaneKind.DRIVING]
    lines = np.array([shapely.LineString(lane.centerline_m[:, :2]) for lane in lanes], object)
    tree = shapely.STRtree(lines)
    half_m = np.array([lane.width_m / 2.0 for lane in lanes])
    height_m = np.array([lane.centerline_m[:, 2].mean() for lane in lanes])
    for scene in scenes_of_six():
        own = {stretch.lane for hazard in scene.hazards for stretch in hazard.blocked}
        other = np.array([lane.id not in own for lane in lanes])
        stands = shapely.union_all([footprint(vehicle) for vehicle in scene.vehicles])
        boxes = [(prop, box(prop.blueprint, prop)) for hazard in scene.hazards for prop in hazard.props]
        assert not any(prop_box.intersects(stands) for _, prop_box in boxes)
        assert not any(a.overlaps(b) for (_, a), (_, b) in itertools.combinations(boxes, 2))
        for prop, prop_box in boxes:
            near = tree.query(prop_box, "dwithin", half_m.max())
            near = near[other[near] & (np.abs(height_m[near] - prop.z_m) < 2.5)]
            intrusion_m = half_m[near] - shapely.distance(lines[near], prop_box)
            assert (intrusion_m < (0.0 if prop.blueprint.startswith("prop.sign") else 0.1)).all()


def test_workers_stand_in_work_zones_clear_of_each_other_and_of_vehicles() -> None:
    worker_count = 0
    for seed in range(8):
        scene = draw(Hazards(count=6, workers=4), seed)
        vehicles = shapely.union_all([footprint(vehicle) for vehicle in scene.vehicles])
        for hazard in scene.hazards:
            workers = [shapely.Point(prop.x_m, prop.y_m) for prop in hazard.props if prop.blueprint == "prop.worker"]
            assert not workers or hazard.kind is HazardKind.WORK_ZONE
            assert all(shapely.Polygon(hazard.outline_m).buffer(-0.5).covers(worker) for worker in workers)
            assert all(worker.distance(vehicles) > 0.59 for worker in workers)
            assert all(a.distance(b) > 1.19 for a, b in itertools.combinations(workers, 2))
            worker_count += len(workers)
    assert worker_count > 50


def test_no_vehicle_starts_in_or_close_to_an_area_and_the_fixed_count_is_kept() -> None:
    scenario = Scenario.model_validate(
        {
            "scenes": [{"map": TOWN.name, "train": 1}],
            "rig": Rig(sensors=()),
            "traffic": {"vehicles": 60, "pedestrians": 0},
            "hazards": {"count": 3},
        }
    )
    scene = draw_scene(scenario, PlannedScene(0, TOWN, "train"), network(), starts())
    assert len(scene.hazards) == 3 and len(scene.drivers) == 61
    assert scene.vehicles[: len(scene.drivers)] == scene.drivers
    ego_m, _ = network().pose_on_lane(scene.vehicles[0].start.lane, scene.vehicles[0].start.s_m)
    for stretch in (stretch for hazard in scene.hazards for stretch in hazard.blocked):
        ahead_m = [stretch.from_s_m - v.start.s_m for v in scene.drivers if v.start.lane == stretch.lane]
        behind_m = [v.start.s_m - stretch.to_s_m for v in scene.drivers if v.start.lane == stretch.lane]
        assert all(a > 20.0 or b > 10.0 for a, b in zip(ahead_m, behind_m, strict=True))
    assert all(shapely.Polygon(each.outline_m).distance(shapely.Point(ego_m[:2])) > 39.9 for each in scene.hazards)
    assert scene == type(scene).model_validate_json(scene.model_dump_json())


@pytest.mark.parametrize("field", ["probability", "cone_missing_probability"])
def test_other_draws_do_not_depend_on_these_fields(field: str) -> None:
    plain, changed = (draw(Hazards(count=2, **change), 3).vehicles for change in ({}, {field: 0.9}))
    assert plain == changed
