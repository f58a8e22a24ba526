"""The lidar node: casts the rays of the rig's lidars at each due tick and publishes their point clouds.

In lockstep, the clouds of a tick are published while threads cast the rays of the next one.
"""

import math
from collections.abc import Iterable
from concurrent.futures import wait
from functools import partial
from itertools import groupby
from typing import NamedTuple

from simbev_ros.assets.actors.catalogue import load_models
from simbev_ros.config.lidar import Lidar
from simbev_ros.msgs.sensor_topics import LidarTopics, lidar_topics
from simbev_ros.msgs.tables import message_from_table
from simbev_ros.nodes.participant import Participant
from simbev_ros.nodes.ros.names import NodeName
from simbev_ros.nodes.surroundings import Surroundings, predicted_position_m, ray_view_radius_m
from simbev_ros.raycast.scene import RayScene
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.lidar import LidarModel, LidarScanInProgress
from simbev_ros.sensors.mount import vector
from simbev_ros.sensors.shelter import with_local_weather
from simbev_ros.threads import usable_cores
from simbev_ros.units import NS_PER_S


class _RaySettings(NamedTuple):
    """How lidars see the world; lidars with equal settings share the ray casting scene that is built for a tick."""

    hits_own_vehicle: bool
    turn_ticks: int  # number of earlier ticks that a turn covers; 0: all rays are cast at the tick


class _Mounted(NamedTuple):
    lidar: Lidar
    model: LidarModel
    period_ticks: int
    topics: LidarTopics

    @property
    def settings(self) -> _RaySettings:
        return _RaySettings(self.lidar.hits_own_vehicle, self.period_ticks if self.lidar.rolling else 0)


class _Scanning(NamedTuple):
    """A lidar whose turn threads scan."""

    mounted: _Mounted
    scan: LidarScanInProgress


class LidarNode(Participant):
    """Serves all lidars of the rig, which share one ray casting scene."""

    reuses_large_buffers = True

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._surroundings = Surroundings(lambda static: RayScene(static, load_models()))
        self._mounted: list[_Mounted] = []
        self._reach_m = 0.0
        self._states: list[WorldState] = []
        self._scanning: list[_Scanning] = []
        self._threads = self.meter.pool("cast")

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the meshes around the ego (kept while scenes stay there) and advertise the lidars' topics."""
        self._wait_for_threads()  # the scene before may have been reset
        lidars = spec.rig.of_type(Lidar)
        self._reach_m = max((_reach_m(lidar) for lidar in lidars), default=0.0)
        self._surroundings.load(spec, ray_view_radius_m(lidar.range_m for lidar in lidars))
        self._mounted, self._states, self._scanning = [], [], []
        recorded = []
        for lidar in lidars:
            period = spec.period_ticks(lidar.rate_hz)
            turn_s = period * spec.tick_ns / NS_PER_S
            model = LidarModel(lidar, spec.noise_seed, turn_s, max_blocks=usable_cores())
            topics = lidar_topics(spec, lidar)
            self._mounted.append(_Mounted(lidar, model, period, topics))
            for topic in topics:
                if topic is not None:
                    self.advertise(topic)
                    recorded.append(topic.name)
        return recorded

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether any lidar completes a turn at the tick."""
        return tick >= 0 and any(tick % mounted.period_ticks == 0 for mounted in self._mounted)

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Start to cast the clouds that are due; clouds of the lead-in only warm up the ray caster."""
        self._wait_for_threads()
        state = with_local_weather(state, self._surroundings.tunnels)
        self._scanning = []
        due = [mounted for mounted in self._mounted if state.tick % mounted.period_ticks == 0]
        for settings, alike in groupby(
            sorted(due, key=lambda mounted: mounted.settings), key=lambda mounted: mounted.settings
        ):
            self._scan(state, settings, alike)
        expired_tick = state.tick - max((mounted.settings.turn_ticks for mounted in self._mounted), default=0)
        self._states = [each for each in (*self._states, state) if each.tick > expired_tick]
        with self.meter.part("place"):
            self._surroundings.built.build_ahead(predicted_position_m(state), self._reach_m)

    def finish(self, spec: SceneSpec, state: WorldState) -> None:
        """Let the clouds be published as soon as they are complete, which finishes the tick."""
        work = [block for scanning in self._scanning for block in scanning.scan.blocks]
        self.finish_after(spec, state.tick, work, partial(self._publish, spec, state, self._scanning))

    def _wait_for_threads(self) -> None:
        """Wait until no thread uses the ray casting scene."""
        wait(block for scanning in self._scanning for block in scanning.scan.blocks)

    def _scan(self, state: WorldState, settings: _RaySettings, alike: Iterable[_Mounted]) -> None:
        """Start to scan with the lidars of equal ray settings."""
        self._wait_for_threads()
        rays = self._surroundings.built
        earlier = [each for each in self._states if each.tick >= state.tick - settings.turn_ticks]
        hidden_ids = frozenset() if settings.hits_own_vehicle else state.ego_ids
        with self.meter.part("place"):
            rays.update(state, vector(state.ego, "x y z"), self._reach_m, hidden_ids, earlier)
        for mounted in alike:
            scan = mounted.model.start_scan(rays, state, earlier, self._threads)
            self._scanning.append(_Scanning(mounted, scan))

    def _publish(self, spec: SceneSpec, state: WorldState, scanning: list[_Scanning]) -> None:
        for (lidar, _, _, topics), in_progress in scanning:
            scan, frame = in_progress.result(), f"{spec.rig.agent}/{lidar.name}"
            for topic, table in ((topics.points, scan.points), (topics.semantic_points, scan.semantic_points)):
                if topic is not None and table is not None and state.tick >= 0:
                    self.publish(topic.name, message_from_table(table, state.stamp_ns, frame))

    def close(self) -> None:
        """Stop the threads."""
        self._threads.shutdown()


def _reach_m(lidar: Lidar) -> float:
    """Maximum distance of a hit from the ego's origin."""
    return lidar.range_m + math.hypot(lidar.pose.x_m, lidar.pose.y_m)
