"""A plain bird's-eye-view grid for comparison: every triangle queries a tree for the cell centers in it."""

from collections.abc import Sequence

import numpy as np
import shapely

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.geometry.transforms import apply, inverse
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.foundation.types import Float64Array, UInt16Array
from simbev_ros.schema.scene.state import WorldState, map_from_actors


class PlainGrid:
    """Computes the labels of a map and its actors, regardless of levels."""

    def __init__(self, static: StaticScene, models: Sequence[ActorModel], grid: BevGrid) -> None:
        self._models, self._grid = models, grid
        self._reach_m = float(np.hypot(grid.rows, grid.columns)) * grid.cell_m / 2.0
        self._centers = shapely.STRtree(np.asarray(shapely.points(grid.centers_ego.reshape(-1, 2)), object))
        self._static: list[tuple[str, Float64Array]] = []
        for tile in static.tiles:
            for tag in (Tag.ROAD, Tag.ROAD_LINE, Tag.SIDEWALK):
                corners_m = tile.mesh.vertices[tile.mesh.triangles[tile.mesh.triangle_tag == tag]]
                self._static.append((tag.name.lower(), corners_m + tile.origin_m))
            for name, mesh in tile.surfaces.items():
                self._static.append((name, mesh.vertices[mesh.triangles] + tile.origin_m))

    def labels(self, state: WorldState) -> UInt16Array:
        """(rows, columns) bits of the classes, like those of ``BevAnnotator.labels``."""
        level = state.ego.copy()
        level["roll"], level["pitch"] = 0.0, 0.0
        ego_from_map = inverse(map_from_actors(level[None])[0])
        labels = np.zeros(self._grid.rows * self._grid.columns, np.uint16)
        for name, corners_m in (*self._static, *self._actors(state)):
            corners_ego = apply(ego_from_map, corners_m.reshape(-1, 3)).reshape(-1, 3, 3)[:, :, :2]
            near = (np.abs(corners_ego).min(axis=1) <= self._reach_m).all(axis=1)
            triangles = np.asarray(shapely.polygons(corners_ego[near]))
            triangles = triangles[shapely.area(triangles) > 0.0]
            _, cell = self._centers.query(triangles, predicate="intersects")
            labels[cell] |= np.uint16(1 << BEV_CLASSES.index(name))
        return labels.reshape(self._grid.rows, self._grid.columns)

    def _actors(self, state: WorldState) -> list[tuple[str, Float64Array]]:
        """(T, 3, 3) corners of the triangles of each class, map frame."""
        actors = state.actors
        names = np.array([model.box_class or model.tag.name.lower() for model in self._models])[actors["blueprint"]]
        far_m = state.distance_to_ego_m - actors["length"]
        origin_m = np.array([state.ego["x"], state.ego["y"], state.ego["z"]])
        found = []
        for name in BEV_CLASSES:
            posed = pose_actors(self._models, actors[(names == name) & (far_m < self._reach_m)], origin_m)
            found.append((name, posed.vertices[posed.triangles] + origin_m))
        return found
