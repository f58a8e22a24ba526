"""All labels of a scene that follow from the state of the world alone."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import shapely

from simbev_ros.annotation.bev.bev_annotator import BevAnnotator
from simbev_ros.annotation.bev.hazards import hazard_areas
from simbev_ros.annotation.bev.levels import Levels
from simbev_ros.annotation.boxes.boxes import boxes
from simbev_ros.annotation.boxes.extents import Extents
from simbev_ros.annotation.boxes.standing import standing_of
from simbev_ros.annotation.occupancy.occupancy import OccupancyAnnotator, occupied
from simbev_ros.annotation.vector_map.vector_map import VectorMap
from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.annotation import Annotation, Occupancy, VectorMapPatch
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.scene.reach import VIEW_M, reach_of
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.types import Table, UInt16Array

_ROADS_MARGIN_M = 20.0  # lines that leave the vector map's patch are needed so far beyond it


@dataclass(frozen=True, slots=True)
class Labels:
    """Labels of a tick.

    Attributes:
        grid: (rows, columns), as ``BevAnnotator.labels`` gives it.
        boxes: (N,) ``BOX_DTYPE``; what sensors see of them is not yet known.
        voxels: (M,) ``VOXEL_DTYPE``; None where none are due.
        roads: As ``VectorMap.record`` gives it; None where none is due.
    """

    grid: UInt16Array
    boxes: Table
    voxels: Table | None
    roads: dict[str, Any] | None


class MeshAnnotators:
    """What reads the meshes around the ego; scenes that stay there share it."""

    def __init__(self, static: StaticScene, models: Sequence[ActorModel]) -> None:
        """Takes the immobile scene and the catalogue's models, indexed by blueprint."""
        self.bev = BevAnnotator(static, models)
        self.occupancy = OccupancyAnnotator(static, models)
        self.extents = Extents(models)


class SceneAnnotator:
    """Knows the roads and the settings of one scene."""

    def __init__(self, spec: SceneSpec, network: RoadNetwork, meshes: MeshAnnotators) -> None:
        self._spec, self._annotation, self._meshes = spec, spec.annotation, meshes
        layout = _layout_near(spec, network, VIEW_M)
        self._levels, self._hazards = Levels(layout), hazard_areas(spec.hazards, layout)
        self._standing = standing_of(network)
        patch = spec.annotation.vector_map
        self._roads = None if patch is None else _vector_map(spec, network, patch)

    def labels(self, state: WorldState) -> Labels:
        """Those of a recorded tick."""
        ego_level = self._levels.of_ego(state)
        grid = self._meshes.bev.labels(state, self._annotation.bev.grid, ego_level, self._hazards)
        radius_m = self._annotation.box_radius_m
        table = boxes(state, radius_m, ego_level, self._meshes.extents, self._standing)
        occupancy, patch = self._annotation.occupancy, self._annotation.vector_map
        return Labels(
            grid,
            table,
            self._voxels(occupancy, state) if occupancy and self._is_due(occupancy, state) else None,
            self._roads.record(state, ego_level) if self._roads and patch and self._is_due(patch, state) else None,
        )

    def _is_due(self, wanted: Occupancy | VectorMapPatch, state: WorldState) -> bool:
        return state.tick % self._spec.period_ticks(wanted.rate_hz) == 0

    def _voxels(self, wanted: Occupancy, state: WorldState) -> Table:
        hidden_ids = frozenset() if wanted.ego else state.ego_ids
        return occupied(self._meshes.occupancy.tags(state, wanted.grid, hidden_ids), wanted.grid)


def meshes_radius_m(annotation: Annotation) -> float:
    """How far from the ego labels are made of meshes."""
    grid = annotation.bev.grid
    radius_m = math.hypot(grid.rows, grid.columns) * grid.cell_m / 2.0
    if annotation.occupancy is not None:
        radius_m = max(radius_m, math.sqrt(2.0) * annotation.occupancy.half_side_m)
    return radius_m


def _vector_map(spec: SceneSpec, network: RoadNetwork, patch: VectorMapPatch) -> VectorMap:
    view_m = math.hypot(patch.length_m, patch.width_m) / 2.0 + _ROADS_MARGIN_M
    return VectorMap(network, _layout_near(spec, network, view_m), patch.length_m, patch.width_m)


def _layout_near(spec: SceneSpec, network: RoadNetwork, view_m: float) -> Layout:
    """Of the map's roads those that come so near to where the ego can get."""
    reach = reach_of(spec, network, view_m)
    return network.layout.near(shapely.Point(reach.center_m).buffer(reach.radius_m), margin_m=0.0)
