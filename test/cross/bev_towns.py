"""Frames for checking the bird's-eye view: dense traffic with all kinds of objects, around points in towns."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import shapely
from synthetic_world import actor

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.static_cache import load_static_scene, load_streetside
from simbev_ros.config.agents import Ego
from simbev_ros.config.hazards import Hazards
from simbev_ros.config.load import load_scenario
from simbev_ros.config.places import SpawnPose
from simbev_ros.config.scenario import MapScenes, Timing
from simbev_ros.config.traffic import Traffic
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Reach
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.level_members import LevelGraph
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.hazard import HazardKind, HazardSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.annotation.bev.bev_annotator import BevAnnotator
from simbev_ros.simulation.annotation.bev.hazards import LabeledArea, hazard_areas
from simbev_ros.simulation.annotation.bev.levels import Levels
from simbev_ros.simulation.world.simulation import Simulation

MAX_FRAME_DISTANCE_M = 180.0  # maximum distance of frames from the ego's start
MAX_CORNER_DISTANCE_M = 105.0  # maximum distance of any grid's corners from the ego
MODELS = load_models()


@dataclass(frozen=True)
class Town:
    """Surroundings of a point in a town, the traffic there at one time, and the annotator."""

    static: StaticScene
    layout: Layout
    hazards: tuple[HazardSpec, ...]
    areas: tuple[LabeledArea, ...]
    annotator: BevAnnotator
    levels: Levels
    graph: LevelGraph
    state: WorldState

    def labels(self, state: WorldState, grid: BevGrid) -> dict[str, BoolArray]:
        """Labels of the annotator under test, by class."""
        labels = self.annotator.labels(state, grid, self.levels.ego_level(state), self.areas)
        return {name: labels >> bit & 1 == 1 for bit, name in enumerate(BEV_CLASSES)}


def load_town(name: str, near_m: tuple[float, float] | None = None) -> Town:
    """Traffic around a point, with hazards; additionally one actor of every blueprint and two more hazards on roads."""
    spawn = () if near_m is None else (SpawnPose(x_m=near_m[0], y_m=near_m[1]),)
    update = {
        "scenes": (MapScenes(map=name, train=1),),
        "traffic": Traffic(vehicles=60, pedestrians=120, spawn_radius_m=MAX_FRAME_DISTANCE_M, waypoint_spacing_m=12.0),
        "time": Timing(warm_up_s=6.0, duration_s=1.0),
        "hazards": Hazards(count=2, cone_missing_probability=0.0),
        "ego": Ego(spawn=spawn),
    }
    scenario = load_scenario("paper").model_copy(update=update)
    [planned] = planned_scenes(scenario)
    network = load_network(planned.map)
    spec = draw_scene(scenario, planned, network)
    start_m, _ = network.pose_on_lane(spec.vehicles[0].start.lane, spec.vehicles[0].start.s_m)
    position_m = float(start_m[0]), float(start_m[1])
    reach = Reach(position_m, MAX_FRAME_DISTANCE_M + MAX_CORNER_DISTANCE_M)
    beside = load_streetside(spec.map, network, reach=reach)
    with Simulation(spec, network, *beside[1:]) as simulation:
        state = [simulation.step() for _ in range(spec.warm_up_ticks + 1)][-1]
    static = load_static_scene(spec.map, network, reach=reach)
    layout = network.layout.near(shapely.Point(position_m).buffer(reach.radius_m + 200.0), 0.0)
    near = [strip for strip, _ in _driving(layout, shapely.Point(position_m).buffer(MAX_FRAME_DISTANCE_M))]
    near.sort(key=lambda strip: strip.level, reverse=True)
    steps = np.concatenate([_steps(strip) for strip in near])
    rng = np.random.default_rng(0)
    hazards = (*spec.hazards, *(_hazard(near[row]) for row in (0, rng.integers(len(near)))))
    crowd = [_on(steps[rng.integers(len(steps))], _any_actor(1000 + k, k, rng)) for k in range(len(MODELS))]
    state = replace(state, actors=np.concatenate([state.actors, *crowd]))
    annotator = BevAnnotator(static, MODELS)
    areas = hazard_areas(hazards, layout)
    return Town(static, layout, hazards, areas, annotator, Levels(layout), LevelGraph(layout), state)


def _driving(layout: Layout, area: shapely.Geometry) -> list[tuple[Strip, shapely.LineString]]:
    """Driving lanes in an area, with their center lines."""
    strips = [strip for strip in layout.strips_of(LaneKind.DRIVING) if len(strip.center_m) > 1]
    lines = [(strip, shapely.LineString(strip.center_m[:, :2])) for strip in strips]
    return [(strip, line) for strip, line in lines if line.intersects(area)]


def _hazard(strip: Strip) -> HazardSpec:
    """A hazard on at most 30 m of a lane."""
    path_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(strip.center_m, axis=0), axis=1)))
    count = max(int(np.searchsorted(path_m, 30.0)), 2)
    outline_m = np.concatenate([strip.right_m[:count], strip.left_m[:count][::-1]])
    z_m = float(outline_m[:, 2].mean())
    return HazardSpec(kind=HazardKind.WORK_ZONE, outline_m=tuple(map(tuple, outline_m[:, :2].tolist())), z_m=z_m)


def _any_actor(identity: int, blueprint: int, rng: np.random.Generator) -> Table:
    """An actor that leans, steers, walks and has its doors open."""
    angles = {name: rng.normal(0.0, 0.1) for name in ("roll", "pitch", "steer")}
    turns = {name: rng.uniform(0.0, 6.0) for name in ("yaw", "gait", "wheel", "vx")}
    doors = int(rng.integers(16))
    return actor(MODELS[blueprint], blueprint, id=identity, doors=doors, **angles, **turns)


def _steps(strip: Strip) -> Float64Array:
    """(N, 2, 3) ends of segments of a strip's center line, at most 4 m long."""
    path_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(strip.center_m, axis=0), axis=1)))
    at_m = np.linspace(0.0, path_m[-1], int(path_m[-1] / 4.0) + 2)
    points_m = np.stack([np.interp(at_m, path_m, axis_m) for axis_m in strip.center_m.T], axis=1)
    return np.stack([points_m[:-1], points_m[1:]], axis=1)


def _on(step: Float64Array, row: Table) -> Table:
    """Put an actor on the middle of a (2, 3) segment of road, turned by its own yaw relative to the segment."""
    put, along_m = row.copy(), step[1] - step[0]
    put["x"], put["y"], put["z"] = step.mean(axis=0)
    put["yaw"] += np.arctan2(along_m[1], along_m[0])
    put["pitch"] -= np.arctan2(along_m[2], np.hypot(*along_m[:2]))
    return put


def ego_states(town: Town, count: int, seed: int) -> Iterator[WorldState]:
    """States with the ego on roads: in turn anywhere, on or beneath a structure, at a hazard, and near a cyclist."""
    rng = np.random.default_rng(seed)
    ego = town.state.ego
    around = shapely.Point(ego["x"], ego["y"]).buffer(MAX_FRAME_DISTANCE_M)
    lines = _driving(town.layout, around)
    decks = shapely.union_all([line for strip, line in lines if strip.level > 0])
    sites = shapely.union_all([shapely.Polygon(hazard.outline_m) for hazard in town.hazards])
    cyclists = town.state.actors[town.state.actors["tag"] == Tag.RIDER]
    riding = shapely.union_all(shapely.points(cyclists["x"], cyclists["y"])) & around
    steps = np.concatenate([_steps(strip) for strip, _ in lines])
    middles = shapely.points(steps.mean(axis=1)[:, :2])
    for number in range(count):
        focus, reach_m = ((around, 0.0), (decks, 4.0), (sites, 15.0), (riding, 6.0))[number % 4]
        near = np.flatnonzero(shapely.dwithin(middles, focus, reach_m))
        near = near if len(near) else np.arange(len(steps))
        actors = town.state.actors.copy()
        row = int(np.searchsorted(actors["id"], town.state.ego_id))
        start = ego.copy()
        start["yaw"], start["pitch"] = rng.normal(0.0, 0.2), 0.0
        actors[row] = _on(steps[near[rng.integers(len(near))]], start)
        yield replace(town.state, actors=actors)
