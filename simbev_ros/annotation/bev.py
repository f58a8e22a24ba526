"""Bird's-eye-view labels: a cell has class k when its centre lies under the vertical projection of that class's mesh.

The grid is level and turns with the ego's heading; roll and pitch do not tilt it. Markings are no holes in the road:
the road mesh goes on below them. The ego is labelled as any other actor.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from simbev_ros.annotation.raster import covered_cells
from simbev_ros.assets.actor_model import ActorModel
from simbev_ros.assets.mesh import Mesh
from simbev_ros.assets.posing import pose_actors
from simbev_ros.assets.static_scene import StaticScene, Tile
from simbev_ros.geometry.grid import BevGrid
from simbev_ros.scene.state import WorldState
from simbev_ros.semantics import BEV_CLASSES, Tag
from simbev_ros.types import Float64Array, Int32Array, Int64Array, Table, UInt8Array, UInt16Array

_CLASS_OF_TAG = {
    Tag.ROAD: "road",
    Tag.ROAD_LINE: "road_line",
    Tag.SIDEWALK: "sidewalk",
    Tag.CAR: "car",
    Tag.TRUCK: "truck",
    Tag.BUS: "bus",
    Tag.MOTORCYCLE: "motorcycle",
    Tag.BICYCLE: "bicycle",
    Tag.RIDER: "rider",
    Tag.PEDESTRIAN: "pedestrian",
}
"""Classes that are seen; hazard and crosswalk come from the tiles' surfaces."""

_NO_CLASS = 255
_PLANE_OF_TAG = np.full(256, _NO_CLASS, np.uint8)
for _tag, _name in _CLASS_OF_TAG.items():
    _PLANE_OF_TAG[_tag] = BEV_CLASSES.index(_name)


@dataclass(frozen=True, slots=True)
class _Footprint:
    """Labelled triangles seen from above: (V, 2) points in metres, (T, 3) indices, (T,) classes."""

    points_m: Float64Array
    triangles: Int32Array
    planes: UInt8Array


class BevAnnotator:
    """Labels of a map and its actors; the static half is prepared once."""

    def __init__(self, static: StaticScene, models: Sequence[ActorModel]) -> None:
        """Takes the immobile scene and the catalogue's models, indexed by blueprint."""
        self._models = models
        self._tiles = [
            footprint for footprint in (_tile_footprint(tile) for tile in static.tiles) if len(footprint.triangles)
        ]
        self._bounds_m = np.array(
            [[each.points_m.min(axis=0), each.points_m.max(axis=0)] for each in self._tiles]
        ).reshape(-1, 2, 2)

    def labels(self, state: WorldState, grid: BevGrid) -> UInt16Array:
        """(rows, columns) labels: bit k is ``BEV_CLASSES[k]``; row 0 ahead of the ego, column 0 left of it."""
        ego_m = np.array([state.ego["x"], state.ego["y"]])
        radius_m = float(np.hypot(grid.rows, grid.columns)) * grid.cell_m / 2.0
        footprint = _merged([*self._tiles_within(ego_m, radius_m), self._actors_within(state, radius_m)])
        points_ego = (footprint.points_m - ego_m) @ _map_from_heading(float(state.ego["yaw"]))
        shape = (len(BEV_CLASSES), grid.rows, grid.columns)
        planes = covered_cells(grid.cells_from_ego(points_ego), footprint.triangles, footprint.planes, shape)
        labels = np.zeros(shape[1:], np.uint16)
        for bit, plane in enumerate(planes):
            labels |= plane.astype(np.uint16) << np.uint16(bit)
        return labels

    def _tiles_within(self, ego_m: Float64Array, radius_m: float) -> list[_Footprint]:
        """Tiles whose bounds touch the circle around the grid."""
        gap_m = np.maximum(self._bounds_m[:, 0] - ego_m, ego_m - self._bounds_m[:, 1]).clip(0.0)
        near = np.flatnonzero(np.hypot(gap_m[:, 0], gap_m[:, 1]) <= radius_m)
        return [self._tiles[index] for index in near]

    def _actors_within(self, state: WorldState, radius_m: float) -> _Footprint:
        """Posed actors that can touch the grid."""
        actors: Table = state.actors
        reach_m = radius_m + np.hypot(actors["length"], actors["width"])
        distance_m = np.hypot(actors["x"] - state.ego["x"], actors["y"] - state.ego["y"])
        actors = actors[distance_m < reach_m]
        origin_m = np.array([state.ego["x"], state.ego["y"], state.ego["z"]])
        posed = pose_actors(self._models, actors, origin_m)
        planes = _PLANE_OF_TAG[actors["tag"]][posed.triangle_row]
        return _Footprint(posed.vertices[:, :2] + origin_m[:2], posed.triangles, planes)


def _map_from_heading(yaw_rad: float) -> Float64Array:
    """(2, 2) rotation; multiplied from the right it takes map to ego axes."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[cosine, -sine], [sine, cosine]])


def _tile_footprint(tile: Tile) -> _Footprint:
    """What counts of a tile, map frame."""
    seen = _mesh_footprint(tile.mesh, _PLANE_OF_TAG[tile.mesh.triangle_tag], tile.origin_m)
    surfaces = [
        _mesh_footprint(mesh, np.full(len(mesh.triangles), BEV_CLASSES.index(name), np.uint8), tile.origin_m)
        for name, mesh in sorted(tile.surfaces.items())
    ]
    return _merged([seen, *surfaces])


def _mesh_footprint(mesh: Mesh, planes: UInt8Array, origin_m: Float64Array) -> _Footprint:
    """Labelled triangles and the vertices that they use."""
    labelled = planes != _NO_CLASS
    used, triangles = np.unique(mesh.triangles[labelled], return_inverse=True)
    points_m = mesh.vertices[used, :2] + origin_m[:2]
    return _Footprint(points_m, triangles.reshape(-1, 3).astype(np.int32), planes[labelled])


def _merged(footprints: Sequence[_Footprint]) -> _Footprint:
    """All triangles, in order."""
    starts: Int64Array = np.cumsum([0, *(len(each.points_m) for each in footprints)])
    return _Footprint(
        np.concatenate([each.points_m for each in footprints]),
        np.concatenate([each.triangles + np.int32(start) for each, start in zip(footprints, starts, strict=False)]),
        np.concatenate([each.planes for each in footprints]),
    )
