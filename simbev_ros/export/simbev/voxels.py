"""Voxel grids of frames for which none were recorded: labeled again from the recorded actors and the map.

A scene and a frame enter; rows of occupied voxels leave. SimBEV's layout has a voxel grid in every frame, whereas
``annotation.occupancy.rate_hz`` says how many are recorded. Labeling needs the simulator and the map of the scene.
"""

from functools import lru_cache

import numpy as np

from simbev_ros.dataset import Frame, Scene
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.foundation.object_store.object_path import require_local
from simbev_ros.foundation.types import Table
from simbev_ros.recording.layout import MAP_ATTACHMENT
from simbev_ros.recording.reader import SceneBag
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.schema.voxels import VOXEL_DTYPE

KEY = "occupancy/points"
"""Key of recorded voxels."""

_STATE_KEYS = ("world/actors", "world/signals", "odom")


class VoxelLabeler:
    """Labels the voxels of any frame of a scene like the annotator that has recorded some of them."""

    def __init__(self, scene: Scene) -> None:
        """Load the surroundings of a scene.

        Raises:
            BagError: The roads of the map are not those of the bag, or the recorded voxels cannot be repeated, because
                another version has recorded them.
            InputError: The map's roads cannot be built.
        """
        from simbev_ros.assets.actors.catalog import load_models
        from simbev_ros.assets.regions.static_cache import load_static_scene
        from simbev_ros.maps.build import load_network
        from simbev_ros.scene.reach import loaded_reach
        from simbev_ros.simulation.annotation.occupancy.occupancy import OccupancyAnnotator
        from simbev_ros.simulation.annotation.scene_annotator import meshes_radius_m
        from simbev_ros.simulation.replay.replay import build_recorded_roads

        with SceneBag(require_local(scene.path)) as bag:
            recorded_roads = bag.attachments.get(MAP_ATTACHMENT)
            chosen = scene.spec.map if recorded_roads is None else build_recorded_roads(bag)
        if recorded_roads is None or not (network := load_network(chosen)).has_opendrive(recorded_roads):
            raise BagError(f"{scene.path}: was recorded on other roads than map {chosen.name} has now")
        reach = loaded_reach(scene.spec, network, meshes_radius_m(scene.spec))
        self._annotator = OccupancyAnnotator(load_static_scene(chosen, network, reach=reach), load_models(), threads=1)
        first = scene[int(np.flatnonzero(scene.has([KEY, *_STATE_KEYS]))[0])]
        if not np.array_equal(first[KEY], self.rows(first)):
            raise BagError(f"{scene.path}: its voxels were recorded by another version")

    def rows(self, frame: Frame) -> Table:
        """(M,) ``VOXEL_DTYPE`` occupied voxels around the agent at a frame."""
        from simbev_ros.simulation.annotation.occupancy.occupancy import occupied_voxels

        view, wanted = frame.scene.view, frame.scene.view.annotation.occupancy
        if wanted is None:
            return np.zeros(0, VOXEL_DTYPE)
        weather = frame.scene.spec.weather_at(frame.tick)
        tables = frame["world/actors"], frame["world/signals"]
        state = view.ego_state(WorldState(frame.stamp_ns, frame.tick, view.ego_id, *tables, weather))
        hidden_ids = frozenset() if wanted.ego else state.ego_ids
        return occupied_voxels(self._annotator.tags(state, wanted.grid, hidden_ids), wanted.grid)


def voxel_rows(frame: Frame) -> Table | None:
    """(M,) ``VOXEL_DTYPE`` occupied voxels at a frame, recorded or labeled again; None: neither is possible."""
    if KEY in frame:
        rows: Table = frame[KEY]
        return rows
    labeler = _labeler(frame.scene) if all(key in frame for key in _STATE_KEYS) else None
    return None if labeler is None else labeler.rows(frame)


@lru_cache(maxsize=1)
def _labeler(scene: Scene) -> VoxelLabeler | None:
    """The labeler of a scene; None: the simulator is missing, or it is not the one that has recorded the scene."""
    if KEY not in scene.sources or load_extras()["sim"].missing:
        return None
    try:
        return VoxelLabeler(scene)
    except (BagError, InputError):
        return None
