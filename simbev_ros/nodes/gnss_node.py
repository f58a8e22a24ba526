"""The GNSS node: publishes a fix of each of the rig's receivers at its rate, from the ego's true motion."""

from typing import NamedTuple

from simbev_ros.config.positioning import Gnss
from simbev_ros.maps.build import load_datum, load_tunnels
from simbev_ros.msgs.motion import fix_message
from simbev_ros.msgs.sensor_topics import gnss_topic
from simbev_ros.msgs.topic import Topic
from simbev_ros.nodes.participant import Participant
from simbev_ros.nodes.ros.names import NodeName
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.gnss import GnssModel


class _Mounted(NamedTuple):
    frame: str
    model: GnssModel
    topic: Topic


class GnssNode(Participant):
    """Serves all GNSS receivers of the rig."""

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._mounted: list[_Mounted] = []

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the map's geodetic datum and tunnels, and advertise the receivers' topics."""
        datum, tunnels = load_datum(spec.map), load_tunnels(spec.map)
        self._mounted = []
        for gnss in spec.rig.of_type(Gnss):
            topic = gnss_topic(spec, gnss)
            self.advertise(topic)
            model = GnssModel(gnss, datum, spec.seed, spec.tick_ns, topic.period_ticks, tunnels)
            self._mounted.append(_Mounted(f"{spec.rig.agent}/{gnss.name}", model, topic))
        return [mounted.topic.name for mounted in self._mounted]

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Publish the fixes that are due."""
        for frame, model, topic in self._mounted:
            if model.is_due(state.tick):
                self.publish(topic.name, fix_message(model.measure(state), state.stamp_ns, frame))
