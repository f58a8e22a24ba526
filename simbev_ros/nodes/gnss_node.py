"""The GNSS node: publishes the fixes of the rig's receivers."""

from sensor_msgs.msg import NavSatFix

from simbev_ros.config.positioning import Gnss
from simbev_ros.geometry.geodesy import MapDatum
from simbev_ros.maps.build import load_datum
from simbev_ros.msgs.motion import fix_message
from simbev_ros.msgs.topics import Topic
from simbev_ros.nodes.participant import Participant
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.gnss import measure_gnss


class GnssNode(Participant):
    """Serves all GNSS receivers of the rig."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._datum: MapDatum | None = None

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Find out where the map lies on Earth."""
        self._datum = load_datum(spec.map)
        names = [f"/{spec.rig.agent}/{gnss.name}/fix" for gnss in spec.rig.of_type(Gnss)]
        for name in names:
            self.advertise(Topic(name, "sensor_msgs/msg/NavSatFix", sensor=True), NavSatFix)
        return names

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Publish what is due."""
        for gnss in spec.rig.of_type(Gnss):
            if state.tick < 0 or state.tick % spec.period_ticks(gnss.rate_hz):
                continue
            assert self._datum is not None
            fix = measure_gnss(gnss, state, self._datum, spec.seed)
            frame = f"{spec.rig.agent}/{gnss.name}"
            self.publish(f"/{frame}/fix", fix_message(fix, state.stamp_ns, frame))
