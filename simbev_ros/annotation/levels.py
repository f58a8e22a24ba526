"""What counts where roads pass above each other: surfaces and actors on roads of the ego's level."""

from dataclasses import dataclass

import cv2
import numpy as np
import shapely

from simbev_ros.annotation.footprint import Footprint, merged
from simbev_ros.assets.primitives import triangulate
from simbev_ros.geometry.grid import BevGrid
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.level_members import LevelGraph, LevelMembers
from simbev_ros.scene.state import WorldState
from simbev_ros.types import BoolArray, Int64Array

_BESIDE_M = 5.0  # surfaces that belong to a road, such as the corners of junctions, reach no further beyond its lanes
_ELSEWHERE = np.uint8(255)


class Levels:
    """The roads of a map around its structures."""

    def __init__(self, layout: Layout) -> None:
        self._graph = LevelGraph(layout)
        parts = [_footprint(polygon) for polygon in self._graph.polygons]
        self._areas = merged(parts)
        self._piece = np.repeat(np.arange(len(parts)), [len(part.triangles) for part in parts])

    def of_ego(self, state: WorldState) -> "EgoLevel | None":
        """The level that the ego is on now; None: everything around it counts."""
        ego = state.ego
        members = self._graph.members(np.array([ego["x"], ego["y"], ego["z"]], np.float64))
        if members is None or members.belongs.all():
            return None
        return EgoLevel(members, self._areas, self._piece)


@dataclass(frozen=True, slots=True)
class EgoLevel:
    """The roads that belong to the ego's level and those that do not; the areas of all pieces of the graph.

    Attributes:
        members: Which is which.
        areas: Triangles of all pieces.
        piece: (T,) the piece that each triangle is of.
    """

    members: LevelMembers
    areas: Footprint
    piece: Int64Array

    def excluded(self, level: int, state: WorldState, grid: BevGrid) -> BoolArray | None:
        """(rows, columns) whether a cell's surface on some level does not count; None: all do.

        It counts if the nearest road of that level belongs to the ego's, or if there is none near.
        """
        members = self.members
        on_level = members.level == level
        if members.belongs[on_level].all():
            return None
        plane = np.full(int(self.piece.max()) + 1, _ELSEWHERE)
        plane[members.piece[on_level]] = members.belongs[on_level]
        plane_of_triangle = plane[self.piece]
        chosen = np.flatnonzero(plane_of_triangle != _ELSEWHERE)
        areas = Footprint(self.areas.points_m, self.areas.triangles[chosen], plane_of_triangle[chosen])
        away, own = areas.covers(state, grid, 2)
        away &= ~own
        if not away.any():
            return None
        covered = own | away
        distance_cells, nearest = cv2.distanceTransformWithLabels(
            (~covered).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
        )
        excluded: BoolArray = away[covered][nearest - 1] & (distance_cells * grid.cell_m <= _BESIDE_M)
        return excluded


def on_ego_level(state: WorldState, level: EgoLevel | None) -> BoolArray:
    """(N,) whether actors stand on roads of the ego's level, riders with what they ride; the ego itself always does."""
    actors = state.actors
    if level is None:
        return np.ones(len(actors), bool)
    carrier = np.where(actors["parent"] > 0, actors["parent"], actors["id"])
    row = np.searchsorted(actors["id"], carrier)
    stands = level.members.holds(np.stack([actors["x"], actors["y"], actors["z"]], axis=1))[row]
    counts: BoolArray = stands | np.isin(actors["id"], list(state.ego_ids))
    return counts


def _footprint(area: shapely.Geometry) -> Footprint:
    """The triangles of a polygon or multipolygon."""
    parts = [triangulate(polygon) for polygon in shapely.get_parts(area) if polygon.area > 0.0]
    return merged([Footprint(points_m, faces, np.zeros(len(faces), np.uint8)) for points_m, faces in parts])
