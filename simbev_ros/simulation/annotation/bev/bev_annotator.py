"""Bird's-eye-view labels: a cell has class k if its center lies under the vertical projection of that class's mesh.

A ``WorldState`` enters, a (rows, columns) array of class bits leaves. The grid stays horizontal and turns with the
ego's heading; roll and pitch do not tilt it. The road mesh continues below lane markings, so these leave no holes in
the road. The ego is labeled like any other actor. Where roads cross above each other, only those on the ego's level and
the actors on them are labeled.
"""

from collections.abc import Sequence

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.foundation.geometry.grid import BevGrid
from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.foundation.types import Float64Array, Int64Array, Table, UInt8Array, UInt16Array
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.annotation.bev.actor_plans import ActorPlans
from simbev_ros.simulation.annotation.bev.footprint import Footprint, merge_footprints
from simbev_ros.simulation.annotation.bev.hazards import LabeledArea
from simbev_ros.simulation.annotation.bev.levels import EgoLevel, on_ego_level
from simbev_ros.simulation.annotation.bev.raster import corners_near_centers, covered_cells

_NO_PLANE = 255


def _plane(name: str) -> int:
    """Bit of a BEV class; ``_NO_PLANE`` for tags and detection classes without one."""
    return BEV_CLASSES.index(name) if name in BEV_CLASSES else _NO_PLANE


_PLANE_OF_TAG = np.full(256, _NO_PLANE, np.uint8)
"""Visible classes are named like their tags; crosswalks come from the tiles' surfaces, hazards from the scene."""
for _tag in Tag:
    _PLANE_OF_TAG[_tag] = _plane(_tag.name.lower())


class BevAnnotator:
    """Labels the BEV grid from the map and its actors; the static part is prepared once."""

    def __init__(self, static: StaticScene, models: Sequence[ActorModel]) -> None:
        """Prepare the static scene and the catalog's models, indexed by blueprint."""
        self._plans = ActorPlans(models)
        # Riders have no detection class but a tag of their own; cones and barriers share their tag with other objects.
        names = [model.box_class or model.tag.name.lower() for model in models]
        self._plane_of_blueprint = np.array([_plane(name) for name in names], np.uint8)
        footprints = [(_tile_footprint(tile), tile.level) for tile in static.tiles]
        self._tiles = [footprint for footprint, _ in footprints if len(footprint.triangles)]
        self._levels = np.array([level for footprint, level in footprints if len(footprint.triangles)], np.int64)
        self._bounds_m = (
            np.array([[[x.min(), x.max()] for x in each.points_m.T] for each in self._tiles])
            .reshape(-1, 2, 2)
            .swapaxes(1, 2)
        )

    def labels(
        self,
        state: WorldState,
        grid: BevGrid,
        ego_level: EgoLevel | None = None,
        areas: Sequence[LabeledArea] = (),
    ) -> UInt16Array:
        """BEV labels around the ego.

        Args:
            state: The world state to label.
            grid: The BEV grid around the ego.
            ego_level: The road level that the ego is on; None: everything counts.
            areas: Hazard areas of the scene.

        Returns:
            (rows, columns) uint16: bit k is ``BEV_CLASSES[k]``; row 0 is ahead of the ego, column 0 is to its left.
        """
        radius_m = float(np.hypot(grid.rows, grid.columns)) * grid.cell_m / 2.0
        ego_m = np.array([state.ego["x"], state.ego["y"]])
        tiles = [(self._tiles[tile], int(self._levels[tile])) for tile in self._tiles_within(ego_m, radius_m).tolist()]
        ground = merge_footprints(
            [each if ego_level is None else ego_level.part_on_level(each, level) for each, level in (*tiles, *areas)]
        )
        cells_from_map = grid.cells_from_map(ego_m, float(state.ego["yaw"]))
        points_cells = cells_from_map[:, :2] @ ground.points_m.T + cells_from_map[:, 2:]
        corners, triangle = corners_near_centers(points_cells, ground.triangles, grid.rows, grid.columns)
        actors = self._actors_within(state, radius_m, ego_level)
        actor_corners, row = self._plans.corners_near_centers(actors, cells_from_map, grid)
        planes = np.concatenate([ground.planes[triangle], self._plane_of_blueprint[actors["blueprint"][row]]])
        return _labels(np.concatenate([corners, actor_corners], axis=2), planes, grid)

    def _tiles_within(self, ego_m: Float64Array, radius_m: float) -> Int64Array:
        """Indices of tiles whose bounds touch the circle around the grid."""
        gap_m = np.maximum(self._bounds_m[:, 0] - ego_m, ego_m - self._bounds_m[:, 1]).clip(0.0)
        return np.flatnonzero(np.hypot(gap_m[:, 0], gap_m[:, 1]) <= radius_m)

    def _actors_within(self, state: WorldState, radius_m: float, ego_level: EgoLevel | None) -> Table:
        """Labeled actors that can touch the grid."""
        actors: Table = state.actors
        reach_m = radius_m + np.hypot(actors["length"], actors["width"])
        labeled = self._plane_of_blueprint[actors["blueprint"]] != _NO_PLANE
        return actors[labeled & (state.distance_to_ego_m < reach_m) & on_ego_level(state, ego_level)]


def _labels(corners_cells: Float64Array, planes: UInt8Array, grid: BevGrid) -> UInt16Array:
    """(rows, columns) bits of the planes that cover each cell, from (2, 3, T) triangles and their (T,) planes."""
    is_drawn = np.bincount(planes, minlength=len(BEV_CLASSES)) > 0  # every plane takes time, even an empty one
    drawn, number = np.flatnonzero(is_drawn), np.cumsum(is_drawn) - 1
    covered = covered_cells(corners_cells, number[planes].astype(np.uint8), (len(drawn), grid.rows, grid.columns))
    labels = np.zeros((grid.rows, grid.columns), np.uint16)
    for bit, plane in zip(drawn.tolist(), covered, strict=True):
        labels |= plane.astype(np.uint16) << np.uint16(bit)
    return labels


def _tile_footprint(tile: Tile) -> Footprint:
    """The labeled part of a tile in plan view, map frame."""
    visible = _mesh_footprint(tile.mesh, _PLANE_OF_TAG[tile.mesh.triangle_tag], tile.origin_m)
    surfaces = [
        _mesh_footprint(mesh, np.full(len(mesh.triangles), BEV_CLASSES.index(name), np.uint8), tile.origin_m)
        for name, mesh in sorted(tile.surfaces.items())
    ]
    return merge_footprints([visible, *surfaces])


def _mesh_footprint(mesh: Mesh, planes: UInt8Array, origin_m: Float64Array) -> Footprint:
    """Labeled triangles and the vertices that they use."""
    labeled = planes != _NO_PLANE
    used, triangles = np.unique(mesh.triangles[labeled], return_inverse=True)
    points_m = mesh.vertices[used, :2] + origin_m[:2]
    return Footprint(points_m, triangles.reshape(-1, 3).astype(np.int32), planes[labeled])
