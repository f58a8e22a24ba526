"""What counts where roads pass above each other: surfaces and actors on roads of the ego's level."""

from collections.abc import Callable
from weakref import WeakKeyDictionary

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.annotation.bev.footprint import Footprint, merged
from simbev_ros.assets.mesh.primitives import triangulate
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.level_members import LevelGraph, LevelMembers
from simbev_ros.scene.state import WorldState
from simbev_ros.types import AnyArray, BoolArray, Int64Array

_FLAT_M2 = 1e-6  # triangles that cover less are walls seen from above


class Levels:
    """The roads of a map around its structures."""

    def __init__(self, layout: Layout) -> None:
        self._graph = LevelGraph(layout)
        self._grounds = _Grounds(self._graph)
        self._latest: EgoLevel | None = None

    def of_ego(self, state: WorldState) -> "EgoLevel | None":
        """The level that the ego is on now, the same object until that changes; None: everything around it counts."""
        ego = state.ego
        members = self._graph.members(np.array([ego["x"], ego["y"], ego["z"]], np.float64))
        if members is None or (members.belongs.all() and not len(members.hidden)):
            return None
        if self._latest is None or self._latest.members is not members:
            self._latest = EgoLevel(members, self._graph, self._grounds)
        return self._latest


class EgoLevel:
    """The roads that belong to the ego's level and those that do not."""

    def __init__(self, members: LevelMembers, graph: LevelGraph, grounds: "_Grounds") -> None:
        self.members = members
        self._graph, self._grounds = graph, grounds
        self._own, self._away, self._hidden = np.zeros((3, len(graph.polygons)), bool)
        self._own[members.piece] = members.belongs
        self._away[members.piece] = ~members.belongs
        self._hidden[members.piece[members.hidden]] = True
        self._counting: WeakKeyDictionary[Footprint, Footprint] = WeakKeyDictionary()

    def counting(self, ground: Footprint, level: int) -> Footprint:
        """What counts of surfaces that lie on roads of some level, or beside them.

        It counts if the road of that level on which it lies, or beside which, at most 5 m away, belongs to the ego's.
        """
        if ground not in self._counting:
            self._counting[ground] = self._counted(ground, level)
        return self._counting[ground]

    def _counted(self, ground: Footprint, level: int) -> Footprint:
        """As ``counting``, kept while nothing changes for the roads below."""
        pieces = self._grounds.pieces(ground, level)
        gone = self._away[pieces] | self._hidden[pieces]
        if not gone.any():
            return ground
        hidden = np.isin(self.members.piece[self.members.hidden], pieces)
        pairs = self.members.piece[np.stack([self.members.hidden[hidden], self.members.hiding[hidden]])]
        key = self._own[pieces].tobytes() + gone.tobytes() + pairs.tobytes()
        return self._grounds.kept(ground, key, lambda: self._cut(ground, level, self.members.areas[hidden]))

    def _cut(self, ground: Footprint, level: int, hidden_areas: AnyArray) -> Footprint:
        """What counts: triangles that borders of what belongs go through are cut there."""
        triangle, piece = self._grounds.below(ground, level)
        gone, stays = np.zeros((2, len(ground.triangles)), bool)
        gone[triangle[(self._away | self._hidden)[piece]]] = True
        stays[triangle[self._own[piece]]] = True
        cut = gone & stays
        away = self._away_area(np.unique(piece[cut[triangle]]), hidden_areas)
        return merged([ground.only(~gone), _without(ground.only(cut), away)])

    def _away_area(self, pieces: Int64Array, hidden_areas: AnyArray) -> BaseGeometry:
        """What does not count in plan, of pieces and what lies beside them."""
        own, away = pieces[self._own[pieces]], pieces[self._away[pieces]]
        on, beside = (
            shapely.difference(shapely.union_all(areas[away]), shapely.union_all(areas[own]))
            for areas in (self._graph.polygons, self._graph.reaches)
        )
        return shapely.union_all([on, beside, *hidden_areas])


class _Grounds:
    """What is known of footprints, besides what they are: the roads below."""

    def __init__(self, graph: LevelGraph) -> None:
        self._rows = {level: np.flatnonzero(graph.level == level) for level in np.unique(graph.level).tolist()}
        self._trees = {level: shapely.STRtree(graph.reaches[rows]) for level, rows in self._rows.items()}
        self._pieces: WeakKeyDictionary[Footprint, Int64Array] = WeakKeyDictionary()
        self._below: WeakKeyDictionary[Footprint, tuple[Int64Array, Int64Array]] = WeakKeyDictionary()
        self._kept: WeakKeyDictionary[Footprint, tuple[bytes, Footprint]] = WeakKeyDictionary()

    def pieces(self, ground: Footprint, level: int) -> Int64Array:
        """(K,) pieces of that level that may be near."""
        if ground not in self._pieces:
            around = shapely.box(*ground.points_m.min(axis=0), *ground.points_m.max(axis=0))
            self._pieces[ground] = self._near(around, level)[0]
        return self._pieces[ground]

    def below(self, ground: Footprint, level: int) -> tuple[Int64Array, Int64Array]:
        """(K,) triangles and (K,) pieces of that level that they lie on or beside."""
        if ground not in self._below:
            some = np.flatnonzero(shapely.area(ground.polygons) > _FLAT_M2)
            piece, triangle = self._near(ground.polygons[some], level)
            self._below[ground] = some[triangle], piece
        return self._below[ground]

    def kept(self, ground: Footprint, key: bytes, make: Callable[[], Footprint]) -> Footprint:
        """What was made of a footprint, made anew if ``key`` is not that of the last time."""
        if ground not in self._kept or self._kept[ground][0] != key:
            self._kept[ground] = key, make()
        return self._kept[ground][1]

    def _near(self, areas: AnyArray | BaseGeometry, level: int) -> tuple[Int64Array, Int64Array]:
        """(K,) pieces of a level that reach to areas, and (K,) which area; for a single area an empty array."""
        if level not in self._rows:
            return np.empty(0, np.int64), np.empty(0, np.int64)
        area, piece = self._trees[level].query(np.atleast_1d(np.asarray(areas, object)), predicate="intersects")
        return self._rows[level][piece], area


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


def _without(ground: Footprint, area: BaseGeometry) -> Footprint:
    """A footprint without what lies in an area."""
    left, of_triangle = shapely.get_parts(shapely.difference(ground.polygons, area), return_index=True)
    left, of_part = shapely.get_parts(left, return_index=True)  # differences may be collections of several kinds
    planes = ground.planes[of_triangle][of_part]
    kept = (shapely.get_type_id(left) == shapely.GeometryType.POLYGON) & (shapely.area(left) > _FLAT_M2)
    parts = [(*triangulate(polygon), plane) for polygon, plane in zip(left[kept], planes[kept].tolist(), strict=True)]
    return merged(
        [Footprint(points_m, faces, np.full(len(faces), plane, np.uint8)) for points_m, faces, plane in parts]
    )
