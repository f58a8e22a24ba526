"""The lidar node: casts the rays of lidars at each due tick and publishes their point clouds.

In lockstep, the clouds of a tick are published while threads cast the rays of the next one.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import wait
from functools import partial
from itertools import groupby
from typing import NamedTuple

from simbev_ros.config.lidar import Lidar
from simbev_ros.foundation.threads import usable_cores
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.message_types import require_installed
from simbev_ros.ros.msgs.sensor_topics import LidarTopics, compressed_cloud_topic, lidar_topics
from simbev_ros.ros.msgs.tables import compressed_message, message_from_table
from simbev_ros.ros.nodes.participant import Participant
from simbev_ros.ros.nodes.ray_scenes import RayScenes
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.lidar import LidarModel, LidarScanInProgress
from simbev_ros.simulation.sensors.mount import vector
from simbev_ros.simulation.sensors.shelter import with_local_weather


class _RaySettings(NamedTuple):
    """How lidars see the world; lidars of an agent with equal settings share a ray casting scene."""

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

    def is_due(self, tick: int) -> bool:
        return tick % self.period_ticks == 0


class _Group(NamedTuple):
    """The lidars of an agent that share a ray casting scene."""

    view: AgentView
    settings: _RaySettings
    lidars: tuple[_Mounted, ...]


class _Scanning(NamedTuple):
    """A lidar that threads scan with, and the frame of its clouds."""

    mounted: _Mounted
    frame: str
    scan: LidarScanInProgress


class LidarNode(Participant):
    """Serves all lidars of its agents."""

    reuses_large_buffers = True

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._scenes = RayScenes(Lidar)
        self._groups: list[_Group] = []
        self._states: list[WorldState] = []
        self._scanning: list[_Scanning] = []
        self._threads = self.meter.pool("cast")

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the meshes around the agents (kept while scenes stay there) and advertise the lidars' topics."""
        self._wait_for_threads()  # the scene before may have been reset
        views = self.served_views(spec, Lidar)
        if views:
            self._scenes.load(spec)
        self._groups, self._states, self._scanning = [], [], []
        recorded = []
        for view in views:
            mounted = [self._mount(view, lidar) for lidar in view.rig.of_type(Lidar)]
            recorded += [topic.name for each in mounted for topic in each.topics.recorded(each.lidar)]
            self._groups += _groups(view, mounted)
        return recorded

    def _mount(self, view: AgentView, lidar: Lidar) -> _Mounted:
        period = view.scene.period_ticks(lidar.rate_hz)
        turn_s = period * view.scene.tick_ns / NS_PER_S
        model = LidarModel(lidar, view.noise_seed, turn_s, max_blocks=usable_cores())
        topics = lidar_topics(view, lidar)
        if lidar.compression is not None:
            require_installed(topics.recorded(lidar)[0].type, f"{lidar.name}: compression")
        for topic in {*topics.raw, *topics.recorded(lidar)}:
            self.advertise(topic)
        return _Mounted(lidar, model, period, topics)

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether any lidar completes a turn at the tick."""
        return tick >= 0 and any(mounted.is_due(tick) for group in self._groups for mounted in group.lidars)

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Start to cast the clouds that are due; live, clouds of the lead-in only warm up the ray caster."""
        self._wait_for_threads()
        self._scanning = []
        groups = self._groups if self.is_sensed(state.tick) else []
        scenes = self._scenes.take(len(groups))
        for group, rays in zip(groups, scenes, strict=True):
            if due := [each for each in group.lidars if self._is_wanted(each, state.tick)]:
                self._scan(rays, group, due, group.view.ego_state(state))
        expired_tick = state.tick - max((group.settings.turn_ticks for group in self._groups), default=0)
        self._states = [each for each in (*self._states, state) if each.tick > expired_tick]
        with self.meter.part("place"):
            for group, rays in zip(groups, scenes, strict=True):
                self._scenes.build_ahead(rays, group.view.ego_state(state))

    def finish(self, spec: SceneSpec, state: WorldState) -> None:
        """Let the clouds be published as soon as they are complete, which finishes the tick."""
        work = [block for scanning in self._scanning for block in scanning.scan.blocks]
        self.finish_after(spec, state.tick, work, partial(self._publish, state, self._scanning))

    def _is_wanted(self, mounted: _Mounted, tick: int) -> bool:
        names = {topic.name for topic in (*mounted.topics.raw, *mounted.topics.recorded(mounted.lidar))}
        return mounted.is_due(tick) and not self.is_superfluous(names, tick)

    def _wait_for_threads(self) -> None:
        """Wait until no thread uses the ray casting scenes."""
        wait(block for scanning in self._scanning for block in scanning.scan.blocks)

    def _scan(self, rays: RayScene, group: _Group, due: Sequence[_Mounted], state: WorldState) -> None:
        """Start to scan with some lidars of a group; its agent is the state's ego."""
        state = with_local_weather(state, self._scenes.tunnels)
        earlier = [each for each in self._states if each.tick >= state.tick - group.settings.turn_ticks]
        hidden_ids = frozenset() if group.settings.hits_own_vehicle else state.ego_ids
        with self.meter.part("place"):
            rays.update(state, vector(state.ego, "x y z"), self._scenes.reach_m, hidden_ids, earlier)
        for mounted in due:
            scan = mounted.model.start_scan(rays, state, earlier, self._threads)
            self._scanning.append(_Scanning(mounted, f"{group.view.agent}/{mounted.lidar.name}", scan))

    def _publish(self, state: WorldState, scanning: list[_Scanning]) -> None:
        for mounted, frame, in_progress in scanning:
            scan, topics = in_progress.result(), mounted.topics
            for topic, table in ((topics.points, scan.points), (topics.semantic_points, scan.semantic_points)):
                if topic is None or table is None or state.tick < 0:
                    continue
                if mounted.lidar.compression is None or self.reader_count(topic.name):
                    self.publish(topic.name, message_from_table(table, state.stamp_ns, frame))
                if mounted.lidar.compression is not None and self.reader_count(compressed_cloud_topic(topic).name):
                    message = compressed_message(table, state.stamp_ns, frame)
                    self.publish(compressed_cloud_topic(topic).name, message)

    def close(self) -> None:
        """Stop the threads."""
        self._threads.shutdown()


def _groups(view: AgentView, lidars: Sequence[_Mounted]) -> Iterator[_Group]:
    """Group the lidars of an agent by their ray settings."""
    ordered = sorted(lidars, key=lambda mounted: mounted.settings)
    for settings, alike in groupby(ordered, key=lambda mounted: mounted.settings):
        yield _Group(view, settings, tuple(alike))
