"""Ground truth of bird's-eye-view cells by brute force: vertical rays through the meshes, roads separated by height.

It shares no code with the annotator: Embree finds the surfaces above a sample, and the level of a hit is that of the
road it lies on, found with shapely and by height. Only the assignment of roads to the ego's level comes from
``LevelGraph``, which has its own tests.
"""

from collections.abc import Iterator

import numpy as np
import shapely
from bev_towns import MODELS, Town

from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.mesh.primitives import triangulate
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.level_members import LevelGraph, LevelMembers
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.schema.scene.hazard import HazardSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.embree import TriangleSet

SAMPLES = 8  # along each side of a cell; the fifth one is at its center
CENTER = SAMPLES // 2
ROADSIDE_M = 5.0  # surfaces up to this distance beside a road belong to it
APART_M = 2.5  # roads with a larger height difference are on different levels
BELOW_M = 100.0  # depth below the ego at which rays start
SEEN = {Tag.ROAD: "road", Tag.ROAD_LINE: "road_line", Tag.SIDEWALK: "sidewalk"}


class Truth:
    """Ground truth of the samples in a frame's cells."""

    def __init__(self, town: Town, state: WorldState, grid: BevGrid) -> None:
        self._grid, self._origin_m = grid, np.array([state.ego["x"], state.ego["y"], state.ego["z"]])
        members = town.graph.members(self._origin_m)
        self._roads = None if members is None else Roads(town.graph, members, town.layout)
        self.told_apart = self._roads is not None and not self._roads.all_count
        fine = BevGrid(grid.rows * SAMPLES, grid.columns * SAMPLES, grid.cell_m / SAMPLES)
        # The grid of samples is shifted half a sample ahead and left, so that one sample is at each cell's center.
        samples_ego = fine.centers_ego.reshape(-1, 2) + fine.cell_m / 2.0
        c, s = np.cos(float(state.ego["yaw"])), np.sin(float(state.ego["yaw"]))
        self._rays = np.zeros((len(samples_ego), 6), np.float32)
        self._rays[:, :2] = samples_ego @ np.array([[c, s], [-s, c]])
        self._rays[:, 2], self._rays[:, 5] = -BELOW_M, 1.0
        self._meshes = _merged([*self._static(town.static), *self._hazards(town.hazards), *self._actors(state)])

    def samples(self) -> Iterator[tuple[str, BoolArray, BoolArray | None]]:
        """Per class that occurs: name, (rows, columns) whether the center is covered, and whether half the cell is.

        The latter is None where roads on several levels have to be separated.
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

    def _counting(self, positions_m: Float64Array) -> BoolArray:
        return np.ones(len(positions_m), bool) if self._roads is None else self._roads.count(positions_m)

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
    """Roads around structures, on the ego's level and on others."""

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

    def count(self, positions_m: Float64Array) -> BoolArray:
        """(N,) whether (N, 3) points are on the ego's level: on or beside one of its roads, or far from all roads."""
        points = shapely.points(positions_m[:, :2])
        point_index, piece = self._tree.query(points, "dwithin", distance=ROADSIDE_M)
        level = np.abs(self._height_m[piece] - positions_m[point_index, 2]) < APART_M
        point_index, piece = point_index[level], piece[level]
        on = shapely.intersects(self._areas[piece], points[point_index])
        own = self._members.belongs[piece]
        on_own, on_other, by_own, by_other = (
            np.bincount(point_index[chosen], minlength=len(positions_m)) > 0
            for chosen in (on & own, on & ~own, own, ~own)
        )
        counts: BoolArray = on_own | (~on_other & (by_own | ~by_other))
        for area, hidden in zip(self._members.areas, self._members.hidden, strict=True):
            near = point_index[piece == hidden]
            counts[near[shapely.intersects(area, points[near])]] = False
        return counts


def _nearest_height_m(line_m: Float64Array, area: shapely.Geometry) -> float:
    """Height of a line of (N, 3) points where it is nearest to the center of an area."""
    path_m = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line_m[:, :2], axis=0), axis=1)))
    at = shapely.line_locate_point(shapely.LineString(line_m[:, :2]), shapely.centroid(area))
    return float(np.interp(at, path_m, line_m[:, 2]))


def _merged(meshes: list[tuple[str, Float64Array, Int64Array]]) -> dict[str, tuple[Float64Array, Int64Array]]:
    """Merge meshes into one per class."""
    merged: dict[str, tuple[Float64Array, Int64Array]] = {}
    for name in BEV_CLASSES:
        of_class = [
            (vertices_m, triangles) for each, vertices_m, triangles in meshes if each == name and len(triangles)
        ]
        if of_class:
            starts = np.cumsum([0, *(len(vertices_m) for vertices_m, _ in of_class)])
            triangles = [faces + start for (_, faces), start in zip(of_class, starts, strict=False)]
            merged[name] = np.concatenate([vertices_m for vertices_m, _ in of_class]), np.concatenate(triangles)
    return merged
