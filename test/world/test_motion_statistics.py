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
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.draw import draw_scene, planned_scenes
from simbev_ros.scene.state import Behavior, Event, Light
from simbev_ros.types import BoolArray, Float64Array, Table
from simbev_ros.world.simulation import Simulation

TICK_S = 0.05
SCENES = [(town, seed) for town in ("Town02", "Town03", "Town05", "Town10HD") for seed in (1, 2, 3)] + [
    (town, seed) for town in ("Town01", "Town04", "Town06", "Town07") for seed in (1, 2)
]
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
    assert np.abs(actors["wz"])[drives & ~impact].max() < 1.2
    assert np.abs(actors["wz"])[~drives & ~impact].max(initial=0.0) < 4.0


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
        assert depth_m2[apart[a, b]].max(initial=0.0) < 0.02
        now = np.ones_like(apart)
        now[a, b] = False
        apart |= now


def test_who_has_collided_comes_to_rest_with_hazard_lights(town: str, seed: int) -> None:
    actors, events, kinds, _ = run(town, seed)
    blinkers = Light.TURN_LEFT | Light.TURN_RIGHT
    for tick, at_tick in enumerate(events):
        for event in at_tick:
            hit = np.isin(actors["id"][0], event.ids)
            speed_mps = np.linalg.norm(vector(actors[tick + 1 :, hit], ("vx", "vy", "vz")), axis=-1)
            assert np.all(np.diff(speed_mps[3:], axis=0) < 0.5)  # pushed on, if at all, by another collision
            blinking = actors["lights"][tick + 1 :, hit & (kinds == "vehicle")] & blinkers
            assert np.isin(blinking, (0, blinkers)).all()
            assert len(blinking) < 20 or np.any(blinking == blinkers, axis=0).all()


def test_people_keep_to_sidewalks_and_crossings(town: str, seed: int) -> None:
    actors, _, kinds, _ = run(town, seed)
    people = actors[::10, (kinds == "pedestrian")]
    people = people[(people["behavior"] & Behavior.JAYWALKING) == 0]
    if not len(people):
        return
    layout = load_network(next(planned_scenes(_plan(town))).map).layout
    levels = {strip.level for strip in layout.strips}
    surfaces = [surfaces_of(layout, level) for level in sorted(levels)]
    walkable = shapely.union_all([each for one in surfaces for each in (one.sidewalk, one.crosswalk)]).buffer(0.5)
    shapely.prepare(walkable)
    on = shapely.contains_xy(walkable, people["x"].ravel(), people["y"].ravel())
    assert np.mean(on) > 0.99


def _plan(town: str) -> Scenario:
    return Scenario.model_validate({"scenes": [{"map": town, "train": 1}], "rig": Rig(sensors=())})
