"""The lidar node: casts the rays of the rig's lidars and publishes their clouds."""

import math
from collections.abc import Iterable
from itertools import groupby
from typing import NamedTuple

from simbev_ros.assets.actors.catalogue import load_models
from simbev_ros.config.lidar import Lidar
from simbev_ros.msgs.sensor_topics import LidarTopics, lidar_topics
from simbev_ros.msgs.tables import message_from_table
from simbev_ros.nodes.participant import Participant
from simbev_ros.nodes.surroundings import Surroundings, place_soon_m, view_of_rays_m
from simbev_ros.raycast.scene import RayScene
from simbev_ros.render.memory import keep_freed_memory
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.lidar import LidarModel
from simbev_ros.sensors.mount import vector
from simbev_ros.units import NS_PER_S


class _Way(NamedTuple):
    """How lidars look at the world; those with the same way share what is built for a tick."""

    hits_own_vehicle: bool
    turn_ticks: int  # how far back their rays go; 0: all are cast at the tick


class _Mounted(NamedTuple):
    lidar: Lidar
    model: LidarModel
    period_ticks: int
    topics: LidarTopics

    @property
    def way(self) -> _Way:
        return _Way(self.lidar.hits_own_vehicle, self.period_ticks if self.lidar.rolling else 0)


class LidarNode(Participant):
    """Serves all lidars of the rig, which share what their rays hit."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        keep_freed_memory()
        self._surroundings = Surroundings()
        self._rays: RayScene | None = None
        self._mounted: list[_Mounted] = []
        self._reach_m = 0.0
        self._states: list[WorldState] = []

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the meshes around the ego (kept while scenes stay there) and advertise the lidars' topics."""
        lidars = spec.rig.of_type(Lidar)
        self._reach_m = max((_reach_m(lidar) for lidar in lidars), default=0.0)
        static = self._surroundings.changed(spec, view_of_rays_m(lidar.range_m for lidar in lidars))
        if static is not None:
            self._rays = RayScene(static, load_models())
        self._mounted, self._states = [], []
        recorded = []
        for lidar in lidars:
            period = spec.period_ticks(lidar.rate_hz)
            model = LidarModel(lidar, spec.seed, turn_s=period * spec.tick_ns / NS_PER_S)
            topics = lidar_topics(spec, lidar)
            self._mounted.append(_Mounted(lidar, model, period, topics))
            for topic in topics:
                if topic is not None:
                    self.advertise(topic)
                    recorded.append(topic.name)
        return recorded

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether a lidar ends a turn."""
        return tick >= 0 and any(tick % mounted.period_ticks == 0 for mounted in self._mounted)

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Cast what is due, and publish it; clouds of the lead-in only warm the ray caster up."""
        due = [mounted for mounted in self._mounted if state.tick % mounted.period_ticks == 0]
        for way, alike in groupby(sorted(due, key=lambda mounted: mounted.way), key=lambda mounted: mounted.way):
            self._scan(spec, state, way, alike)
        farthest = state.tick - max((mounted.way.turn_ticks for mounted in self._mounted), default=0)
        self._states = [each for each in (*self._states, state) if each.tick > farthest]
        if self._rays is not None:
            self._rays.build_ahead(place_soon_m(state), self._reach_m)

    def _scan(self, spec: SceneSpec, state: WorldState, way: _Way, alike: Iterable[_Mounted]) -> None:
        """Turns of lidars that look at the world in the same way."""
        assert self._rays is not None
        earlier = [each for each in self._states if each.tick >= state.tick - way.turn_ticks]
        hidden_ids = frozenset() if way.hits_own_vehicle else state.ego_ids
        self._rays.update(state, vector(state.ego, "x y z"), self._reach_m, hidden_ids, earlier)
        for lidar, model, _, topics in alike:
            scan = model.scan(self._rays, state, earlier)
            frame = f"{spec.rig.agent}/{lidar.name}"
            for topic, table in ((topics.points, scan.points), (topics.semantic_points, scan.semantic_points)):
                if topic is not None and table is not None and state.tick >= 0:
                    self.publish(topic.name, message_from_table(table, state.stamp_ns, frame))


def _reach_m(lidar: Lidar) -> float:
    """How far from the ego's place its rays reach."""
    return lidar.range_m + math.hypot(lidar.pose.x_m, lidar.pose.y_m)
