"""What cells of the bird's-eye view hold, the slow way: vertical rays through the meshes, roads told apart by height.

Nothing of it is the annotator's: Embree finds what is above a sample, levels are those of the road, by shapely and by
height, on which a hit lies. Which roads belong to the ego's level is taken from ``LevelGraph``, which has tests itself.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import shapely
from synthetic_world import actor

from simbev_ros.annotation.bev import BevAnnotator
from simbev_ros.annotation.hazards import LabelledArea, hazard_areas
from simbev_ros.annotation.levels import Levels
from simbev_ros.assets.catalogue import load_models
from simbev_ros.assets.posing import pose_actors
from simbev_ros.assets.primitives import triangulate
from simbev_ros.assets.static_cache import load_static_scene, load_streetside
from simbev_ros.assets.static_scene import StaticScene
from simbev_ros.config.hazards import Hazards
from simbev_ros.config.load import load_scenario
from simbev_ros.config.scenario import Ego, MapScenes, SpawnPose, Timing, Traffic
from simbev_ros.geometry.grid import BevGrid
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Reach
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.maps.roads.level_members import LevelGraph, LevelMembers
from simbev_ros.raycast.embree import TriangleSet
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.draw import draw_scene, planned_scenes
from simbev_ros.scene.hazards import HazardKind, HazardSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.semantics import BEV_CLASSES, Tag
from simbev_ros.types import BoolArray, Float64Array, Int64Array, Table
from simbev_ros.world.simulation import Simulation

SAMPLES = 8  # along each side of a cell; the one in the middle of the second half is at its centre
CENTER = SAMPLES // 2
ROADSIDE_M = 5.0  # what lies so far beside a road belongs to it
APART_M = 2.5  # roads with more height between them pass above each other
BELOW_M = 100.0  # rays start so far below the ego
AROUND_M = 180.0  # frames are so far from the ego's start at most
FARTHEST_M = 75.0  # of any grid's corners
MODELS = load_models()
SEEN = {Tag.ROAD: "road", Tag.ROAD_LINE: "road_line", Tag.SIDEWALK: "sidewalk"}


@dataclass(frozen=True)
class Town:
    """A place in a town, its traffic at one moment, and the annotator there."""

    static: StaticScene
    layout: Layout
    hazards: tuple[HazardSpec, ...]
    areas: tuple[LabelledArea, ...]
    annotator: BevAnnotator
    levels: Levels
    graph: LevelGraph
    state: WorldState

    def labels(self, state: WorldState, grid: BevGrid) -> dict[str, BoolArray]:
        """What is to be checked."""
        labels = self.annotator.labels(state, grid, self.levels.of_ego(state), self.areas)
        return {name: labels >> bit & 1 == 1 for bit, name in enumerate(BEV_CLASSES)}


def load_town(name: str, near_m: tuple[float, float] | None = None) -> Town:
    """Traffic around a place, with hazards, and on any roads there one of every blueprint and two more hazards."""
    spawn = () if near_m is None else (SpawnPose(x_m=near_m[0], y_m=near_m[1]),)
    update = {
        "scenes": (MapScenes(map=name, train=1),),
        "traffic": Traffic(vehicles=60, pedestrians=120, spawn_radius_m=AROUND_M, waypoint_spacing_m=12.0),
        "time": Timing(warm_up_s=6.0, duration_s=1.0),
        "hazards": Hazards(count=2, cone_missing_probability=0.0),
        "ego": Ego(spawn=spawn),
    }
    scenario = load_scenario("paper").model_copy(update=update)
    [planned] = planned_scenes(scenario)
    network = load_network(planned.map)
    spec = draw_scene(scenario, planned, network)
    start_m, _ = network.pose_on_lane(spec.vehicles[0].start.lane, spec.vehicles[0].start.s_m)
    place_m = float(start_m[0]), float(start_m[1])
    reach = Reach(place_m, AROUND_M + FARTHEST_M)
    beside = load_streetside(spec.map, network, reach=reach)
    with Simulation(spec, network, beside.obstacles, beside.plazas) as simulation:
        state = [simulation.step() for _ in range(spec.warm_up_ticks + 1)][-1]
    static = load_static_scene(spec.map, network, reach=reach)
    layout = network.layout.near(shapely.Point(place_m).buffer(reach.radius_m + 200.0), 0.0)
    near = [strip for strip, _ in _driving(layout, shapely.Point(place_m).buffer(AROUND_M))]
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
    """Lanes in an area, with their middle lines."""
    strips = [strip for strip in layout.strips_of(LaneKind.DRIVING) if len(strip.center_m) > 1]
    lines = [(strip, shapely.LineString(strip.center_m[:, :2])) for strip in strips]
    return [(strip, line) for strip, line in lines if line.intersects(area)]


def _hazard(strip: Strip) -> HazardSpec:
    """At most 30 m of a lane."""
    way_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(strip.center_m, axis=0), axis=1)))
    count = max(int(np.searchsorted(way_m, 30.0)), 2)
    outline_m = np.concatenate([strip.right_m[:count], strip.left_m[:count][::-1]])
    z_m = float(outline_m[:, 2].mean())
    return HazardSpec(kind=HazardKind.WORK_ZONE, outline_m=tuple(map(tuple, outline_m[:, :2].tolist())), z_m=z_m)


def _any_actor(identity: int, blueprint: int, rng: np.random.Generator) -> Table:
    """One that leans, steers, walks and has its doors open."""
    angles = {name: rng.normal(0.0, 0.1) for name in ("roll", "pitch", "steer")}
    turns = {name: rng.uniform(0.0, 6.0) for name in ("yaw", "gait", "wheel", "vx")}
    doors = int(rng.integers(16))
    return actor(MODELS[blueprint], blueprint, id=identity, doors=doors, **angles, **turns)


def _steps(strip: Strip) -> Float64Array:
    """(N, 2, 3) ends of the pieces of a strip's middle, at most 4 m long."""
    way_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(strip.center_m, axis=0), axis=1)))
    at_m = np.linspace(0.0, way_m[-1], int(way_m[-1] / 4.0) + 2)
    points_m = np.stack([np.interp(at_m, way_m, axis_m) for axis_m in strip.center_m.T], axis=1)
    return np.stack([points_m[:-1], points_m[1:]], axis=1)


def _on(step: Float64Array, row: Table) -> Table:
    """Put on the middle of a (2, 3) piece of road, turned about its own yaw from there."""
    put, along_m = row.copy(), step[1] - step[0]
    put["x"], put["y"], put["z"] = step.mean(axis=0)
    put["yaw"] += np.arctan2(along_m[1], along_m[0])
    put["pitch"] -= np.arctan2(along_m[2], np.hypot(*along_m[:2]))
    return put


def places(town: Town, count: int, seed: int) -> Iterator[WorldState]:
    """The ego put on roads: by turns anywhere, on or beneath a structure, at a hazard, and near a cyclist."""
    rng = np.random.default_rng(seed)
    ego = town.state.ego
    around = shapely.Point(ego["x"], ego["y"]).buffer(AROUND_M)
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


class Truth:
    """What is in the samples of a frame's cells."""

    def __init__(self, town: Town, state: WorldState, grid: BevGrid) -> None:
        self._grid, self._origin_m = grid, np.array([state.ego["x"], state.ego["y"], state.ego["z"]])
        members = town.graph.members(self._origin_m)
        self._roads = None if members is None else Roads(town.graph, members, town.layout)
        self.told_apart = self._roads is not None and not self._roads.all_count
        fine = BevGrid(grid.rows * SAMPLES, grid.columns * SAMPLES, grid.cell_m / SAMPLES)
        # The samples' grid is half a sample further ahead and left, so that one of a cell's is at its centre.
        samples_ego = fine.centers_ego.reshape(-1, 2) + fine.cell_m / 2.0
        c, s = np.cos(float(state.ego["yaw"])), np.sin(float(state.ego["yaw"]))
        self._rays = np.zeros((len(samples_ego), 6), np.float32)
        self._rays[:, :2] = samples_ego @ np.array([[c, s], [-s, c]])
        self._rays[:, 2], self._rays[:, 5] = -BELOW_M, 1.0
        self._meshes = _merged([*self._static(town.static), *self._hazards(town.hazards), *self._actors(state)])

    def samples(self) -> Iterator[tuple[str, BoolArray, BoolArray | None]]:
        """Classes that occur: name, (rows, columns) whether the centre is covered, and (rows, columns) whether half is.

        Shares are not known where roads have to be told apart.
        """
        shape = self._grid.rows, SAMPLES, self._grid.columns, SAMPLES
        for name, (vertices_m, triangles) in self._meshes.items():
            mesh, covered = TriangleSet(vertices_m.astype(np.float32), triangles.astype(np.int32)), None
            if self.told_apart:
                center = np.arange(len(self._rays)).reshape(shape)[:, CENTER, :, CENTER].ravel()
                found = mesh.crossings(self._rays[center])
                hits_m = self._rays[center[found.ray], :3].astype(np.float64) + self._origin_m
                hits_m[:, 2] += found.range_m
                counting = self._counting(hits_m) if name not in ACTORS else np.ones(len(hits_m), bool)
                centers = np.bincount(found.ray[counting], minlength=len(center)) > 0
                yield name, centers.reshape(shape[::2]), None
            else:
                covered = np.isfinite(mesh.cast(self._rays).range_m).reshape(shape)
                yield name, covered[:, CENTER, :, CENTER], covered.mean(axis=(1, 3)) >= 0.5

    def _counting(self, places_m: Float64Array) -> BoolArray:
        return np.ones(len(places_m), bool) if self._roads is None else self._roads.count(places_m)

    def _static(self, static: StaticScene) -> Iterator[tuple[str, Float64Array, Int64Array]]:
        """Class, (V, 3) vertices relative to the ego, (T, 3) triangles."""
        for tile in static.tiles:
            offset_m = tile.origin_m - self._origin_m
            for tag, name in SEEN.items():
                yield name, tile.mesh.vertices + offset_m, tile.mesh.triangles[tile.mesh.triangle_tag == tag]
            for name, mesh in tile.surfaces.items():
                yield name, mesh.vertices + offset_m, mesh.triangles

    def _hazards(self, hazards: tuple[HazardSpec, ...]) -> Iterator[tuple[str, Float64Array, Int64Array]]:
        for hazard in hazards:
            points_m, triangles = triangulate(shapely.Polygon(hazard.outline_m))
            yield "hazard", np.column_stack([points_m, np.full(len(points_m), hazard.z_m)]) - self._origin_m, triangles

    def _actors(self, state: WorldState) -> Iterator[tuple[str, Float64Array, Int64Array]]:
        actors = state.actors
        carriers = np.where(actors["parent"] > 0, actors["parent"], actors["id"])
        carriers = actors[np.searchsorted(actors["id"], carriers)]
        counts = self._counting(np.stack([carriers["x"], carriers["y"], carriers["z"]], axis=1))
        counts |= carriers["id"] == state.ego_id
        for row in actors[counts]:
            name = load_blueprints()[row["blueprint"]].box_class or Tag(int(row["tag"])).name.lower()
            if name in BEV_CLASSES:
                posed = pose_actors(MODELS, row[None], self._origin_m)
                yield name, posed.vertices, posed.triangles


ACTORS = frozenset(BEV_CLASSES[BEV_CLASSES.index("traffic_cone") :])


class Roads:
    """The roads around structures: those of the ego's level and the others."""

    def __init__(self, graph: LevelGraph, members: LevelMembers, layout: Layout) -> None:
        self._areas, self._members = graph.polygons[members.piece], members
        strips = {strip.id: strip.center_m for strip in layout.strips}
        self._height_m = np.array(
            [
                _nearest_height_m(strips[name], area)
                for name, area in zip(members.strip.tolist(), self._areas, strict=True)
            ]
        )
        self._tree = shapely.STRtree(self._areas)
        self.all_count = bool(members.belongs.all()) and not len(members.hidden)

    def count(self, places_m: Float64Array) -> BoolArray:
        """(N,) whether (N, 3) places lie on a road of the level, or beside one and on none; far from all: they do."""
        points = shapely.points(places_m[:, :2])
        place, piece = self._tree.query(points, "dwithin", distance=ROADSIDE_M)
        level = np.abs(self._height_m[piece] - places_m[place, 2]) < APART_M
        place, piece = place[level], piece[level]
        on = shapely.intersects(self._areas[piece], points[place])
        own = self._members.belongs[piece]
        on_own, on_other, by_own, by_other = (
            np.bincount(place[chosen], minlength=len(places_m)) > 0 for chosen in (on & own, on & ~own, own, ~own)
        )
        counts: BoolArray = on_own | (~on_other & (by_own | ~by_other))
        for area, hidden in zip(self._members.areas, self._members.hidden, strict=True):
            near = place[piece == hidden]
            counts[near[shapely.intersects(area, points[near])]] = False
        return counts


def _nearest_height_m(line_m: Float64Array, area: shapely.Geometry) -> float:
    """Height of a line of (N, 3) points where it is nearest to the middle of an area."""
    way = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1)))
    at = shapely.line_locate_point(shapely.LineString(line_m[:, :2]), shapely.centroid(area))
    return float(np.interp(at, way, line_m[:, 2]))


def _merged(meshes: list[tuple[str, Float64Array, Int64Array]]) -> dict[str, tuple[Float64Array, Int64Array]]:
    """One mesh a class."""
    merged: dict[str, tuple[Float64Array, Int64Array]] = {}
    for name in BEV_CLASSES:
        mine = [(vertices_m, triangles) for each, vertices_m, triangles in meshes if each == name and len(triangles)]
        if mine:
            starts = np.cumsum([0, *(len(vertices_m) for vertices_m, _ in mine)])
            triangles = [faces + start for (_, faces), start in zip(mine, starts, strict=False)]
            merged[name] = np.concatenate([vertices_m for vertices_m, _ in mine]), np.concatenate(triangles)
    return merged
