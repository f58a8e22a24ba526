"""Road levels around the ego: decides which surfaces and actors are labeled where roads cross above each other.

``Levels.ego_level`` takes a ``WorldState`` and returns the ``EgoLevel``, which cuts BEV footprints; ``on_ego_level``
selects actors.
"""

from collections.abc import Callable
from weakref import WeakKeyDictionary

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.mesh.primitives import triangulate
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.geometry.plan_view import indexed_polygon_parts
from simbev_ros.foundation.types import AnyArray, BoolArray, Int64Array
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.level_members import LevelGraph, LevelMembers
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.annotation.bev.footprint import Footprint, merge_footprints

_FLAT_M2 = 1e-6  # triangles that cover less area are walls seen from above


class Levels:
    """The road levels of a map, for finding the level that the ego is on."""

    def __init__(self, layout: Layout) -> None:
        self._graph = LevelGraph(layout)
        self._grounds = _Grounds(self._graph)
        self._latest: EgoLevel | None = None

    def ego_level(self, state: WorldState) -> "EgoLevel | None":
        """The level that the ego is on, the same object until it changes; None: everything around it counts."""
        ego = state.ego
        members = self._graph.members(np.array([ego["x"], ego["y"], ego["z"]], np.float64))
        if members is None or (members.belongs.all() and not len(members.hidden)):
            return None
        if self._latest is None or self._latest.members is not members:
            self._latest = EgoLevel(members, self._graph, self._grounds)
        return self._latest


class EgoLevel:
    """The road pieces that belong to the ego's level and those that do not."""

    def __init__(self, members: LevelMembers, graph: LevelGraph, grounds: "_Grounds") -> None:
        self.members = members
        self._graph, self._grounds = graph, grounds
        self._included, self._excluded, self._hidden = np.zeros((3, len(graph.polygons)), bool)
        self._included[members.piece] = members.belongs
        self._excluded[members.piece] = ~members.belongs
        self._hidden[members.piece[members.hidden]] = True
        self._part_on_level: WeakKeyDictionary[Footprint, Footprint] = WeakKeyDictionary()

    def part_on_level(self, ground: Footprint, level: int) -> Footprint:
        """The part of a footprint on roads of level ``level``, or beside them, that belongs to the ego's level.

        A surface belongs to it if the road piece that it lies on, or lies within 5 m of, belongs to it.
        """
        if ground not in self._part_on_level:
            self._part_on_level[ground] = self._cached_part(ground, level)
        return self._part_on_level[ground]

    def _cached_part(self, ground: Footprint, level: int) -> Footprint:
        """Compute ``part_on_level``; reuse the last result while nothing changes for the roads below."""
        pieces = self._grounds.pieces(ground, level)
        excluded = self._excluded[pieces] | self._hidden[pieces]
        if not excluded.any():
            return ground
        hidden = np.isin(self.members.piece[self.members.hidden], pieces)
        pairs = self.members.piece[np.stack([self.members.hidden[hidden], self.members.hiding[hidden]])]
        key = self._included[pieces].tobytes() + excluded.tobytes() + pairs.tobytes()
        return self._grounds.reuse_or_make(ground, key, lambda: self._cut(ground, level, self.members.areas[hidden]))

    def _cut(self, ground: Footprint, level: int, hidden_areas: AnyArray) -> Footprint:
        """The remaining part of a footprint; triangles that cross the border of the ego's level are cut there."""
        triangle, piece = self._grounds.below(ground, level)
        dropped, kept = np.zeros((2, len(ground.triangles)), bool)
        dropped[triangle[(self._excluded | self._hidden)[piece]]] = True
        kept[triangle[self._included[piece]]] = True
        cut = dropped & kept
        excluded_area = self._excluded_area(np.unique(piece[cut[triangle]]), hidden_areas)
        return merge_footprints([ground.subset(~dropped), _subtract_area(ground.subset(cut), excluded_area)])

    def _excluded_area(self, pieces: Int64Array, hidden_areas: AnyArray) -> BaseGeometry:
        """Plan-view area that does not count, given road pieces and the surfaces beside them."""
        included, excluded = pieces[self._included[pieces]], pieces[self._excluded[pieces]]
        on, beside = (
            overlay.difference(overlay.union_all(areas[excluded]), overlay.union_all(areas[included]))
            for areas in (self._graph.polygons, self._graph.reaches)
        )
        return overlay.union_all([on, beside, *hidden_areas])


class _Grounds:
    """Caches per footprint: the road pieces below it, and the last part that was cut from it."""

    def __init__(self, graph: LevelGraph) -> None:
        self._rows = {level: np.flatnonzero(graph.level == level) for level in np.unique(graph.level).tolist()}
        self._trees = {level: shapely.STRtree(graph.reaches[rows]) for level, rows in self._rows.items()}
        self._pieces: WeakKeyDictionary[Footprint, Int64Array] = WeakKeyDictionary()
        self._below: WeakKeyDictionary[Footprint, tuple[Int64Array, Int64Array]] = WeakKeyDictionary()
        self._kept: WeakKeyDictionary[Footprint, tuple[bytes, Footprint]] = WeakKeyDictionary()

    def pieces(self, ground: Footprint, level: int) -> Int64Array:
        """(K,) pieces of the given level that may be near a footprint."""
        if ground not in self._pieces:
            around = shapely.box(*ground.points_m.min(axis=0), *ground.points_m.max(axis=0))
            self._pieces[ground] = self._near(around, level)[0]
        return self._pieces[ground]

    def below(self, ground: Footprint, level: int) -> tuple[Int64Array, Int64Array]:
        """(K,) triangles, and (K,) the pieces of the given level that they lie on or beside."""
        if ground not in self._below:
            not_flat = np.flatnonzero(shapely.area(ground.polygons) > _FLAT_M2)
            piece, triangle = self._near(ground.polygons[not_flat], level)
            self._below[ground] = not_flat[triangle], piece
        return self._below[ground]

    def reuse_or_make(self, ground: Footprint, key: bytes, make: Callable[[], Footprint]) -> Footprint:
        """The cached result for a footprint; computed again if ``key`` has changed."""
        if ground not in self._kept or self._kept[ground][0] != key:
            self._kept[ground] = key, make()
        return self._kept[ground][1]

    def _near(self, areas: AnyArray | BaseGeometry, level: int) -> tuple[Int64Array, Int64Array]:
        """(K,) pieces of a level that reach areas, and (K,) index of the area; for a single area an empty array."""
        if level not in self._rows:
            return np.empty(0, np.int64), np.empty(0, np.int64)
        area, piece = self._trees[level].query(np.atleast_1d(np.asarray(areas, object)), predicate="intersects")
        return self._rows[level][piece], area


def on_ego_level(state: WorldState, level: EgoLevel | None) -> BoolArray:
    """(N,) whether actors are on roads of the ego's level; riders follow their vehicle, and the ego always is."""
    actors = state.actors
    if level is None:
        return np.ones(len(actors), bool)
    carrier = np.where(actors["parent"] > 0, actors["parent"], actors["id"])
    row = np.searchsorted(actors["id"], carrier)
    stands = level.members.holds(np.stack([actors["x"], actors["y"], actors["z"]], axis=1))[row]
    return stands | np.isin(actors["id"], list(state.ego_ids))


def _subtract_area(ground: Footprint, area: BaseGeometry) -> Footprint:
    """A footprint minus an area."""
    rest, of_triangle = indexed_polygon_parts(overlay.difference(ground.polygons, area))
    kept = shapely.area(rest) > _FLAT_M2
    planes = ground.planes[of_triangle[kept]].tolist()
    parts = [(*triangulate(polygon), plane) for polygon, plane in zip(rest[kept], planes, strict=True)]
    return merge_footprints(
        [Footprint(points_m, faces, np.full(len(faces), plane, np.uint8)) for points_m, faces, plane in parts]
    )
