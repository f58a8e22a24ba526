"""The radar node: casts the rays of radars at each due tick and publishes their detections."""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

from simbev_ros.config.radar import Radar
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.sensor_topics import radar_topic
from simbev_ros.ros.msgs.tables import message_from_table
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.nodes.participant import Participant
from simbev_ros.ros.nodes.ray_scenes import RayScenes
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.mount import vector
from simbev_ros.simulation.sensors.radar import RadarModel, scan_radars
from simbev_ros.simulation.sensors.shelter import with_local_weather


class _Mounted(NamedTuple):
    model: RadarModel
    topic: Topic

    def is_due(self, tick: int) -> bool:
        return tick % self.topic.period_ticks == 0


class _Carrier(NamedTuple):
    """An agent with its radars."""

    view: AgentView
    radars: tuple[_Mounted, ...]


class RadarNode(Participant):
    """Serves all radars of its agents; the rays of all radars of an agent that are due are cast together."""

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._scenes = RayScenes(Radar)
        self._carriers: list[_Carrier] = []
        self._previous: WorldState | None = None

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the meshes around the agents (kept while scenes stay there) and advertise the radars' topics."""
        views = self.served_views(spec, Radar)
        if views:
            self._scenes.load(spec)
        self._previous = None
        self._carriers = [
            _Carrier(view, tuple(map(partial(self._mount, view), view.rig.of_type(Radar)))) for view in views
        ]
        self.advertise_derived(spec)
        return [mounted.topic.name for carrier in self._carriers for mounted in carrier.radars]

    def _mount(self, view: AgentView, radar: Radar) -> _Mounted:
        topic = radar_topic(view, radar)
        self.advertise(topic)
        scan_s = topic.period_ticks * view.scene.tick_ns / NS_PER_S
        return _Mounted(RadarModel(radar, view.noise_seed, scan_s), topic)

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether any radar scans at the tick."""
        return tick >= 0 and any(mounted.is_due(tick) for carrier in self._carriers for mounted in carrier.radars)

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Cast and publish the scans that are due."""
        carriers = self._carriers if self.is_sensed(state.tick) else []
        for carrier, rays in zip(carriers, self._scenes.take(len(carriers)), strict=True):
            if due := [each for each in carrier.radars if self._is_wanted(each, state.tick)]:
                self._scan(rays, due, carrier.view, carrier.view.ego_state(state))
        self._previous = state

    def _is_wanted(self, mounted: _Mounted, tick: int) -> bool:
        name = mounted.topic.name
        return mounted.is_due(tick) and (self.is_shown(name) or not self.is_superfluous([name], tick))

    def _scan(self, rays: RayScene, due: Sequence[_Mounted], view: AgentView, state: WorldState) -> None:
        """Scan with some radars of an agent; their rays pass through the agent and its rider."""
        state = with_local_weather(state, self._scenes.tunnels)
        with self.meter.part("place"):
            rays.update(state, vector(state.ego, "x y z"), self._scenes.reach_m, state.ego_ids)
        with self.meter.part("cast"):
            clouds = scan_radars([model for model, _ in due], rays, state, self._previous)
        if state.tick >= 0:  # live, scans of the lead-in only warm up the ray caster
            for (model, topic), cloud in zip(due, clouds, strict=True):
                frame = f"{view.agent}/{model.radar.name}"
                self.publish(topic.name, message_from_table(cloud, state.stamp_ns, frame))
                self.publish_derived(state.stamp_ns, {topic.name: cloud})
        with self.meter.part("place"):
            self._scenes.build_ahead(rays, state)
