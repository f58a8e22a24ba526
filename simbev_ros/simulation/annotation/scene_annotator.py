"""All labels of a scene that can be computed from the world state alone, without sensor data.

The annotation node calls an agent's ``SceneAnnotator`` for each tick with labels: a ``WorldState`` enters; 3D boxes and
``SurroundingsLabels`` leave (BEV grid, occupancy voxels, vector map). Point counts and visibility of boxes need sensor
data and are added later, by ``schema.box_points`` and ``visibility``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import shapely

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.config.annotation import Annotation, Occupancy, VectorMapPatch
from simbev_ros.foundation.types import Table, UInt16Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.scene.reach import VIEW_M, reach_of
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.annotation.bev.bev_annotator import BevAnnotator
from simbev_ros.simulation.annotation.bev.hazards import hazard_areas
from simbev_ros.simulation.annotation.bev.levels import Levels
from simbev_ros.simulation.annotation.bev.paper_roads import close_roads, lane_areas
from simbev_ros.simulation.annotation.boxes.boxes import boxes_around_ego
from simbev_ros.simulation.annotation.boxes.extents import Extents
from simbev_ros.simulation.annotation.boxes.standing import find_static_objects
from simbev_ros.simulation.annotation.occupancy.occupancy import OccupancyAnnotator, occupied_voxels
from simbev_ros.simulation.annotation.vector_map.vector_map import VectorMap

_ROADS_MARGIN_M = 20.0  # lines that leave the vector map's patch are needed this far beyond its border


@dataclass(frozen=True, slots=True)
class SurroundingsLabels:
    """Labels of what surrounds the ego at one tick.

    Attributes:
        grid: (rows, columns) uint16 BEV labels, see ``BevAnnotator.labels``.
        voxels: (M,) ``VOXEL_DTYPE`` occupied voxels; None if no occupancy labels are due at this tick.
        roads: Vector map, see ``VectorMap.record``; None if none is due at this tick.
    """

    grid: UInt16Array
    voxels: Table | None
    roads: dict[str, Any] | None


class MeshAnnotators:
    """The annotators that need meshes.

    Agents, and scenes in the same area, share one instance because preparing it is expensive.
    """

    def __init__(self, static: StaticScene, models: Sequence[ActorModel]) -> None:
        """Prepare the annotators from the static scene and the catalog's models, indexed by blueprint."""
        self.bev = BevAnnotator(static, models)
        self.occupancy = OccupancyAnnotator(static, models)
        self.extents = Extents(models)


class SceneAnnotator:
    """Produces all labels of one agent in one scene, from the roads and the shared ``MeshAnnotators``.

    The agent is the ego of the states that enter.
    """

    def __init__(self, view: AgentView, network: RoadNetwork, meshes: MeshAnnotators) -> None:
        """Prepare the annotator with the agent's view of the scene, which has its annotation settings."""
        self._view, self._annotation, self._meshes = view, view.annotation, meshes
        layout = _nearby_layout(view, network, VIEW_M)
        self._levels, self._areas = Levels(layout), hazard_areas(view.scene.hazards, layout)
        if view.annotation.bev.road == "paper":
            self._areas += lane_areas(layout)
        self._standing = find_static_objects(network)
        patch = view.annotation.vector_map
        self._roads = None if patch is None else _vector_map(view, network, patch)

    def boxes(self, state: WorldState) -> Table:
        """(N,) ``BOX_DTYPE`` around the ego; the columns that depend on sensor data are not filled yet."""
        radius_m, ego_level = self._annotation.box_radius_m, self._levels.ego_level(state)
        return boxes_around_ego(state, radius_m, ego_level, self._meshes.extents, self._standing)

    def surroundings(self, state: WorldState) -> SurroundingsLabels:
        """Labels of the ego's surroundings at a tick with labels."""
        ego_level = self._levels.ego_level(state)
        occupancy, patch = self._annotation.occupancy, self._annotation.vector_map
        grid = self._meshes.bev.labels(state, self._annotation.bev.grid, ego_level, self._areas)
        return SurroundingsLabels(
            close_roads(grid) if self._annotation.bev.road == "paper" else grid,
            self._voxels(occupancy, state) if occupancy and self._is_due(occupancy, state) else None,
            self._roads.record(state, ego_level) if self._roads and patch and self._is_due(patch, state) else None,
        )

    def _is_due(self, wanted: Occupancy | VectorMapPatch, state: WorldState) -> bool:
        return state.tick % self._view.label_period_ticks(wanted.rate_hz) == 0

    def _voxels(self, wanted: Occupancy, state: WorldState) -> Table:
        hidden_ids = frozenset() if wanted.ego else state.ego_ids
        return occupied_voxels(self._meshes.occupancy.tags(state, wanted.grid, hidden_ids), wanted.grid)


def meshes_radius_m(spec: SceneSpec) -> float:
    """Distance from an agent up to which the labels of a scene need meshes, m: the maximum over all its agents.

    Whichever agents a node labels, it thus loads the same meshes.
    """
    return max(_labels_radius_m(agent.annotation) for agent in spec.agents)


def _labels_radius_m(annotation: Annotation) -> float:
    """Distance from the ego up to which labels of these settings need meshes, m."""
    grid = annotation.bev.grid
    radius_m = math.hypot(grid.rows, grid.columns) * grid.cell_m / 2.0
    if annotation.occupancy is not None:
        radius_m = max(radius_m, math.sqrt(2.0) * annotation.occupancy.half_side_m)
    return radius_m


def _vector_map(view: AgentView, network: RoadNetwork, patch: VectorMapPatch) -> VectorMap:
    radius_m = math.hypot(patch.length_m, patch.width_m) / 2.0 + _ROADS_MARGIN_M
    return VectorMap(network, _nearby_layout(view, network, radius_m), patch.length_m, patch.width_m)


def _nearby_layout(view: AgentView, network: RoadNetwork, radius_m: float) -> Layout:
    """The part of the road layout within ``radius_m`` of any position that the ego can reach."""
    reach = reach_of(view, network, radius_m)
    return network.layout.near(shapely.Point(reach.center_m).buffer(reach.radius_m), margin_m=0.0)
