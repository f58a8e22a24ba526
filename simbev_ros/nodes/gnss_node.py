"""The GNSS node: publishes the fixes of the rig's receivers."""

from sensor_msgs.msg import NavSatFix

from simbev_ros.config.positioning import Gnss
from simbev_ros.maps.build import load_datum
from simbev_ros.msgs.motion import fix_message
from simbev_ros.msgs.topics import Topic
from simbev_ros.nodes.participant import Participant
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.gnss import GnssModel


class GnssNode(Participant):
    """Serves all GNSS receivers of the rig."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._models: dict[str, GnssModel] = {}

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Find out where the map lies on Earth, and advertise the topics."""
        datum = load_datum(spec.map)
        self._models = {}
        names = []
        for gnss in spec.rig.of_type(Gnss):
            frame, period = f"{spec.rig.agent}/{gnss.name}", spec.period_ticks(gnss.rate_hz)
            self._models[frame] = GnssModel(gnss, datum, spec.seed, spec.tick_ns, period)
            names.append(f"/{frame}/fix")
            self.advertise(Topic(names[-1], "sensor_msgs/msg/NavSatFix", period, sensor=True), NavSatFix)
        return names

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Publish what is due."""
        for frame, model in self._models.items():
            if model.is_due(state.tick):
                self.publish(f"/{frame}/fix", fix_message(model.measure(state), state.stamp_ns, frame))
