"""The radar node: casts the rays of the rig's radars at each due tick and publishes their detections."""

import math
from typing import NamedTuple

from simbev_ros.assets.actors.catalogue import load_models
from simbev_ros.config.radar import Radar
from simbev_ros.msgs.sensor_topics import radar_topic
from simbev_ros.msgs.tables import message_from_table
from simbev_ros.msgs.topic import Topic
from simbev_ros.nodes.participant import Participant
from simbev_ros.nodes.ros.names import NodeName
from simbev_ros.nodes.surroundings import Surroundings, predicted_position_m, ray_view_radius_m
from simbev_ros.raycast.scene import RayScene
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.mount import vector
from simbev_ros.sensors.radar import RadarModel, scan_radars
from simbev_ros.sensors.shelter import with_local_weather
from simbev_ros.units import NS_PER_S


class _Mounted(NamedTuple):
    model: RadarModel
    topic: Topic

    def is_due(self, tick: int) -> bool:
        return tick % self.topic.period_ticks == 0


class RadarNode(Participant):
    """Serves all radars of the rig; the rays of all radars that are due are cast together."""

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._surroundings = Surroundings(lambda static: RayScene(static, load_models()))
        self._reach_m = 0.0  # maximum over all radars, from the ego's origin
        self._mounted: list[_Mounted] = []
        self._previous: WorldState | None = None

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the meshes around the ego (kept while scenes stay there) and advertise the radars' topics."""
        radars = spec.rig.of_type(Radar)
        self._reach_m = max(
            (radar.range_m + math.hypot(radar.pose.x_m, radar.pose.y_m) for radar in radars), default=0.0
        )
        self._surroundings.load(spec, ray_view_radius_m(radar.range_m for radar in radars))
        self._previous = None
        self._mounted = []
        for radar in radars:
            topic = radar_topic(spec, radar)
            self.advertise(topic)
            scan_s = topic.period_ticks * spec.tick_ns / NS_PER_S
            self._mounted.append(_Mounted(RadarModel(radar, spec.noise_seed, scan_s), topic))
        return [mounted.topic.name for mounted in self._mounted]

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether any radar scans at the tick."""
        return tick >= 0 and any(mounted.is_due(tick) for mounted in self._mounted)

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Cast and publish the scans that are due; rays pass through the ego and its rider."""
        due = [mounted for mounted in self._mounted if mounted.is_due(state.tick)]
        state = with_local_weather(state, self._surroundings.tunnels)
        if due:
            rays = self._surroundings.built
            with self.meter.part("place"):
                rays.update(state, vector(state.ego, "x y z"), self._reach_m, state.ego_ids)
            with self.meter.part("cast"):
                clouds = scan_radars([model for model, _ in due], rays, state, self._previous)
            if state.tick >= 0:  # scans of the lead-in only warm up the ray caster
                for (model, topic), cloud in zip(due, clouds, strict=True):
                    frame = f"{spec.rig.agent}/{model.radar.name}"
                    self.publish(topic.name, message_from_table(cloud, state.stamp_ns, frame))
            with self.meter.part("place"):
                rays.build_ahead(predicted_position_m(state), self._reach_m)
        self._previous = state
