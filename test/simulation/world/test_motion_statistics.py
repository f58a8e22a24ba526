"""Statistics of motion over drawn scenes in several towns."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
import shapely

from simbev_ros.assets.land.plazas import Plaza
from simbev_ros.assets.regions.static_cache import load_streetside
from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.scene.reach import loaded_reach
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import Behavior, Event, Light
from simbev_ros.simulation.world.cast import first_prop_id
from simbev_ros.simulation.world.kinematics.ground import GroundSurface
from simbev_ros.simulation.world.simulation import Simulation

TICK_S = 0.05
TOWNS = ("Town01", "Town02", "Town03", "Town04", "Town05", "Town06", "Town07", "Town10HD", "Town12", "Town13")
SCENES = [(town, 11) for town in TOWNS] + [
    (town, seed) for town in ("Town03", "Town05", "Town07", "Town10HD") for seed in (12, 13, 14)
]
CORNER_CUT_M = 0.3  # between sidewalk and crossing, pedestrians cut corners
pytestmark = [pytest.mark.slow, pytest.mark.parametrize("town, seed", SCENES)]


class Run(NamedTuple):
    """One scene: (T, N) actors, (T,) events, (N,) kinds, (T, N) whether in an impact, (N,) whether on walks only."""

    actors: Table
    events: list[tuple[Event, ...]]
    kinds: Float64Array
    impact: BoolArray
    keeps_to_sidewalks: BoolArray


@cache
def drawn(town: str, seed: int) -> tuple[SceneSpec, RoadNetwork, tuple[Plaza, ...]]:
    """A scene, its roads and its plazas."""
    scenario = Scenario.model_validate(
        {
            "seed": seed,
            "scenes": [{"map": town, "train": 1}],
            "rig": Rig(sensors=()),
            "time": {"warm_up_s": 4, "duration_s": 10},
            "traffic": {"vehicles": 60, "pedestrians": 60, "reckless_probability": 0.05},
        }
    )
    planned = next(planned_scenes(scenario))
    network = load_network(planned.map)
    spec = draw_scene(scenario, planned, network)
    return spec, network, load_streetside(spec.map, network, reach=loaded_reach(spec, network)).plazas


@cache
def run(town: str, seed: int) -> Run:
    spec, network, plazas = drawn(town, seed)
    with Simulation(spec, network, plazas=plazas) as simulation:
        states = [simulation.step() for _ in range(spec.warm_up_ticks + spec.ticks)]
    actors = np.stack([state.actors for state in states])
    kinds = np.array([blueprint.kind for blueprint in load_blueprints()])[actors["blueprint"][0]]
    events = [state.events for state in states]
    impact = np.zeros(actors.shape, bool)
    for tick, at_tick in enumerate(events):
        for event in at_tick:
            hit = np.isin(actors["id"][0], event.ids) | np.isin(actors["parent"][0], event.ids)
            impact[max(tick - 2, 0) : tick + 3, hit] = True
    pedestrians = range(first_prop_id(spec) - len(spec.pedestrians), first_prop_id(spec))
    keeping_ids = [
        id_
        for id_, each in zip(pedestrians, spec.pedestrians, strict=True)
        if not (each.jaywalks or each.visits_plazas)
    ]
    return Run(actors, events, kinds, impact, np.isin(actors["id"][0], keeping_ids))


def vector(actors: Table, names: tuple[str, str, str]) -> Float64Array:
    return np.stack([actors[name] for name in names], axis=-1).astype(np.float64)


def test_speeds_from_poses_are_the_reported_ones(town: str, seed: int) -> None:
    actors = run(town, seed).actors
    position_m = vector(actors, ("x", "y", "z"))
    from_poses = np.linalg.norm(position_m[2:] - position_m[:-2], axis=-1) / (2.0 * TICK_S)
    reported = np.linalg.norm(vector(actors, ("vx", "vy", "vz")), axis=-1)[1:-1]
    assert np.all(np.abs(from_poses - reported) <= np.maximum(0.02 * from_poses, 0.05))


def test_accelerations_and_yaw_rates_are_plausible_for_vehicles_and_pedestrians(town: str, seed: int) -> None:
    actors, _, kinds, impact, _ = run(town, seed)
    acceleration = np.linalg.norm(vector(actors, ("ax", "ay", "az")), axis=-1)
    assert acceleration[~impact].max() < 12.0
    is_vehicle = np.broadcast_to(kinds != "pedestrian", impact.shape)
    yaw_rate = np.abs(actors["wz"])
    is_long = np.array([blueprint.wheelbase_m for blueprint in load_blueprints()])[actors["blueprint"]] > 2.0
    assert yaw_rate[is_vehicle & is_long & ~impact].max() < 1.2
    # At walking pace, a motorcycle of 1.4 m turns on a radius of 1.7 m; its rider, who has no wheelbase, turns with it.
    assert yaw_rate[is_vehicle & ~impact].max() < 1.4
    # Pedestrians who step off the curb turn by 90° within half a second, as people do; nobody spins on the spot.
    assert yaw_rate[~is_vehicle & ~impact].max(initial=0.0) < 3.0
    is_standing = np.linalg.norm(vector(actors, ("vx", "vy", "vz")), axis=-1) < 0.1
    assert yaw_rate[is_standing & ~impact].max(initial=0.0) < 0.3


def test_headings_never_jump_and_steering_is_within_human_limits(town: str, seed: int) -> None:
    actors, _, kinds, impact, _ = run(town, seed)
    turn_rad = np.abs(np.diff(np.unwrap(actors["yaw"].astype(np.float64), axis=0), axis=0))
    is_vehicle = np.broadcast_to(kinds != "pedestrian", turn_rad.shape)
    assert turn_rad[is_vehicle & ~impact[1:]].max() < 1.3 * TICK_S
    assert turn_rad[~is_vehicle & ~impact[1:]].max(initial=0.0) < 3.1 * TICK_S
    steer_rad = actors["steer"].astype(np.float64)
    assert np.abs(steer_rad).max() < 0.71
    assert np.abs(np.diff(steer_rad, axis=0)).max() < 1.51 * TICK_S


def test_vehicles_move_where_their_wheels_point(town: str, seed: int) -> None:
    actors, _, _, impact, _ = run(town, seed)
    speed_mps = np.hypot(actors["vx"], actors["vy"])
    steering = [each.wheelbase_m if each.kind == "vehicle" else 0.0 for each in load_blueprints()]  # trailers do not
    wheelbase_m = np.array(steering)[actors["blueprint"]]
    is_rolling = (speed_mps > 2.0) & (wheelbase_m > 0.0) & ~impact
    needed_rad = np.arctan2(wheelbase_m * actors["wz"], speed_mps)
    off_rad = np.abs(actors["steer"] - needed_rad)[is_rolling]
    assert np.quantile(off_rad, 0.999) < 0.05  # steering is slower than the start of the sharpest turns


def test_wheels_stand_on_the_road_whatever_its_slope(town: str, seed: int) -> None:
    actors, _, kinds, impact, _ = run(town, seed)
    is_checked = (kinds == "vehicle") & ~impact.any(axis=0)
    rows = actors[::10, is_checked].ravel()
    half_m = np.array([blueprint.wheelbase_m for blueprint in load_blueprints()])[rows["blueprint"]] / 2.0
    ground = GroundSurface(load_network(map_spec(town)).layout)
    ahead = np.stack([np.cos(rows["yaw"]), np.sin(rows["yaw"]), -np.sin(rows["pitch"])], axis=-1).astype(np.float64)
    center_m = vector(rows, ("x", "y", "z"))
    for axle_m in (half_m, -half_m):
        wheel_m = center_m + axle_m[:, None] * ahead
        gap_m = np.abs(wheel_m[:, 2] - ground.heights_m(wheel_m))
        assert np.quantile(gap_m, 0.99) < 0.02
        assert gap_m.max() < 0.1  # springs give where slopes change


def outlines(rows: Table) -> Float64Array:
    c, s = np.cos(rows["yaw"])[:, None], np.sin(rows["yaw"])[:, None]
    x = rows["length"][:, None] / 2.0 * [1, -1, -1, 1]
    y = rows["width"][:, None] / 2.0 * [1, 1, -1, -1]
    return shapely.polygons(np.stack([rows["x"][:, None] + c * x - s * y, rows["y"][:, None] + s * x + c * y], axis=-1))


def test_no_footprints_overlap_even_after_collisions(town: str, seed: int) -> None:
    actors, _, kinds, _, _ = run(town, seed)
    apart = np.zeros((actors.shape[1],) * 2, bool)  # bodies that have been apart must not overlap later
    for rows in actors:
        shapes = outlines(rows)
        a, b = shapely.STRtree(shapes).query(shapes, predicate="intersects")
        own = (a < b) & (rows["parent"][a] == 0) & (rows["parent"][b] == 0)
        own &= (kinds[a] == "vehicle") | (kinds[b] == "vehicle")
        bottom, top = rows["z"], rows["z"] + rows["height"]
        own &= (bottom[a] < top[b]) & (bottom[b] < top[a])
        a, b = a[own], b[own]
        depth_m2 = shapely.area(shapely.intersection(shapes[a], shapes[b]))
        assert depth_m2[apart[a, b]].max(initial=0.0) < 1e-4  # headings are stored with 7 digits
        now = np.ones_like(apart)
        now[a, b] = False
        apart |= now


def test_crashed_vehicles_come_to_rest_with_hazard_lights(town: str, seed: int) -> None:
    actors, events, kinds, impact, _ = run(town, seed)
    blinkers = Light.TURN_LEFT | Light.TURN_RIGHT
    for tick, at_tick in enumerate(events):
        for event in at_tick:
            hit = np.isin(actors["id"][0], event.ids)
            speed_mps = np.linalg.norm(vector(actors[tick + 1 :, hit], ("vx", "vy", "vz")), axis=-1)
            slows = np.diff(speed_mps[3:], axis=0) < 0.5
            assert np.all(slows | impact[tick + 5 :, hit])  # pushed only by another collision, if at all
            blinking = actors["lights"][tick + 1 :, hit & (kinds == "vehicle")] & blinkers
            assert np.isin(blinking, (0, blinkers)).all()
            assert len(blinking) < 20 or np.any(blinking == blinkers, axis=0).all()


def test_pedestrians_keep_to_sidewalks_and_crossings(town: str, seed: int) -> None:
    pedestrians = run(town, seed).actors[::10, run(town, seed).keeps_to_sidewalks].ravel()
    assert not np.any(pedestrians["behavior"] & Behavior.JAYWALKING)
    if not len(pedestrians):
        return
    points = shapely.points(pedestrians["x"], pedestrians["y"])
    off_m = np.zeros(len(points))
    paved = shapely.union_all([plaza.free for plaza in drawn(town, seed)[2]])
    off = ~shapely.contains_xy(walkable(town), pedestrians["x"], pedestrians["y"])
    off &= ~shapely.dwithin(paved, points, CORNER_CUT_M)
    off_m[off] = shapely.distance(points[off], walkable(town))
    assert np.mean(off_m > CORNER_CUT_M) < 0.01
    assert off_m.max() < 1.0


@cache
def walkable(town: str) -> shapely.MultiPolygon:
    network = load_network(map_spec(town))
    surfaces = [surfaces_of(network.layout, level) for level in network.layout.levels]
    paved = [each for surface in surfaces for each in (surface.sidewalk, surface.crosswalk)]
    area = shapely.union_all([*paved, network.verges])
    shapely.prepare(area)
    return area
