"""Statistics of motion over drawn scenes on several towns."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
import shapely

from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.draw import draw_scene, planned_scenes
from simbev_ros.scene.state import Behavior, Event, Light
from simbev_ros.types import BoolArray, Float64Array, Table
from simbev_ros.world.simulation import Simulation

TICK_S = 0.05
TOWNS = ("Town01", "Town02", "Town03", "Town04", "Town05", "Town06", "Town07", "Town10HD", "Town12", "Town13")
SCENES = [(town, 11) for town in TOWNS] + [
    (town, seed) for town in ("Town03", "Town05", "Town07", "Town10HD") for seed in (12, 13, 14)
]
STEPPED_OFF_M = 0.3  # between sidewalk and crossing people cut corners
pytestmark = [pytest.mark.slow, pytest.mark.parametrize("town, seed", SCENES)]


class Run(NamedTuple):
    """(T, N) actors, (T,) events and (N,) kinds of one scene, and whether (T, N) actors are in an impact."""

    actors: Table
    events: list[tuple[Event, ...]]
    kinds: Float64Array
    impact: BoolArray


@cache
def run(town: str, seed: int) -> Run:
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
    with Simulation(spec, network) as simulation:
        states = [simulation.step() for _ in range(spec.warm_up_ticks + spec.ticks)]
    actors = np.stack([state.actors for state in states])
    kinds = np.array([blueprint.kind for blueprint in load_blueprints()])[actors["blueprint"][0]]
    events = [state.events for state in states]
    impact = np.zeros(actors.shape, bool)
    for tick, at_tick in enumerate(events):
        for event in at_tick:
            hit = np.isin(actors["id"][0], event.ids) | np.isin(actors["parent"][0], event.ids)
            impact[max(tick - 2, 0) : tick + 3, hit] = True
    return Run(actors, events, kinds, impact)


def vector(actors: Table, names: tuple[str, str, str]) -> Float64Array:
    return np.stack([actors[name] for name in names], axis=-1).astype(np.float64)


def test_speeds_from_poses_are_the_reported_ones(town: str, seed: int) -> None:
    actors = run(town, seed).actors
    place_m = vector(actors, ("x", "y", "z"))
    from_poses = np.linalg.norm(place_m[2:] - place_m[:-2], axis=-1) / (2.0 * TICK_S)
    reported = np.linalg.norm(vector(actors, ("vx", "vy", "vz")), axis=-1)[1:-1]
    assert np.all(np.abs(from_poses - reported) <= np.maximum(0.02 * from_poses, 0.05))


def test_accelerations_and_yaw_rates_are_those_of_vehicles_and_people(town: str, seed: int) -> None:
    actors, _, kinds, impact = run(town, seed)
    acceleration = np.linalg.norm(vector(actors, ("ax", "ay", "az")), axis=-1)
    assert acceleration[~impact].max() < 12.0
    drives = np.broadcast_to(kinds != "pedestrian", impact.shape)
    yaw_rate = np.abs(actors["wz"])
    assert yaw_rate[drives & ~impact].max() < 1.2
    # Whoever steps off the curb to cross turns by a quarter within a second, as people do; nobody spins on the spot.
    assert yaw_rate[~drives & ~impact].max(initial=0.0) < 2.5
    stands = np.linalg.norm(vector(actors, ("vx", "vy", "vz")), axis=-1) < 0.1
    assert yaw_rate[stands & ~impact].max(initial=0.0) < 0.3


def test_headings_never_jump_and_steering_is_that_of_hands(town: str, seed: int) -> None:
    actors, _, kinds, impact = run(town, seed)
    turn_rad = np.abs(np.diff(np.unwrap(actors["yaw"].astype(np.float64), axis=0), axis=0))
    drives = np.broadcast_to(kinds != "pedestrian", turn_rad.shape)
    assert turn_rad[drives & ~impact[1:]].max() < 1.3 * TICK_S
    assert turn_rad[~drives & ~impact[1:]].max(initial=0.0) < 2.6 * TICK_S
    steer_rad = actors["steer"].astype(np.float64)
    assert np.abs(steer_rad).max() < 0.71
    assert np.abs(np.diff(steer_rad, axis=0)).max() < 1.51 * TICK_S


def outlines(rows: Table) -> Float64Array:
    c, s = np.cos(rows["yaw"])[:, None], np.sin(rows["yaw"])[:, None]
    x = rows["length"][:, None] / 2.0 * [1, -1, -1, 1]
    y = rows["width"][:, None] / 2.0 * [1, 1, -1, -1]
    return shapely.polygons(np.stack([rows["x"][:, None] + c * x - s * y, rows["y"][:, None] + s * x + c * y], axis=-1))


def test_no_footprints_overlap_also_not_after_collisions(town: str, seed: int) -> None:
    actors, _, kinds, _ = run(town, seed)
    apart = np.zeros((actors.shape[1],) * 2, bool)  # who has been apart must not overlap later
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


def test_who_has_collided_comes_to_rest_with_hazard_lights(town: str, seed: int) -> None:
    actors, events, kinds, impact = run(town, seed)
    blinkers = Light.TURN_LEFT | Light.TURN_RIGHT
    for tick, at_tick in enumerate(events):
        for event in at_tick:
            hit = np.isin(actors["id"][0], event.ids)
            speed_mps = np.linalg.norm(vector(actors[tick + 1 :, hit], ("vx", "vy", "vz")), axis=-1)
            slows = np.diff(speed_mps[3:], axis=0) < 0.5
            assert np.all(slows | impact[tick + 5 :, hit])  # pushed on, if at all, by another collision
            blinking = actors["lights"][tick + 1 :, hit & (kinds == "vehicle")] & blinkers
            assert np.isin(blinking, (0, blinkers)).all()
            assert len(blinking) < 20 or np.any(blinking == blinkers, axis=0).all()


def test_people_keep_to_sidewalks_and_crossings(town: str, seed: int) -> None:
    actors, _, kinds, _ = run(town, seed)
    people = actors[::10, (kinds == "pedestrian")]
    people = people[(people["behavior"] & Behavior.JAYWALKING) == 0]
    if not len(people):
        return
    here = shapely.points(people["x"], people["y"])
    away_m = np.zeros(len(here))
    off = ~shapely.contains_xy(walkable(town), people["x"], people["y"])
    away_m[off] = shapely.distance(here[off], walkable(town))
    assert np.mean(away_m > STEPPED_OFF_M) < 0.005
    assert np.mean(away_m > 1.0) < 0.001


@cache
def walkable(town: str) -> shapely.MultiPolygon:
    layout = load_network(map_spec(town)).layout
    surfaces = [surfaces_of(layout, level) for level in layout.levels]
    area = shapely.union_all([each for one in surfaces for each in (one.sidewalk, one.crosswalk)])
    shapely.prepare(area)
    return area
