"""The GNSS node: publishes a fix of each receiver at its rate, from the true motion of its agent."""

from typing import NamedTuple

from simbev_ros.config.positioning import Gnss
from simbev_ros.maps.build import load_datum, load_tunnels
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.gps_fix import serialize_gps_fix
from simbev_ros.ros.msgs.message_types import require_installed
from simbev_ros.ros.msgs.motion import fix_message, velocity_messages
from simbev_ros.ros.msgs.sensor_topics import GnssTopics, gnss_topics
from simbev_ros.ros.nodes.participant import Participant
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.sensors.gnss import GnssModel


class _Mounted(NamedTuple):
    view: AgentView
    frame: str
    model: GnssModel
    topics: GnssTopics
    map_from_east_rad: float


class GnssNode(Participant):
    """Serves all GNSS receivers of its agents."""

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._mounted: list[_Mounted] = []

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the map's geodetic datum and tunnels, and advertise the receivers' topics."""
        datum, tunnels = load_datum(spec.map), load_tunnels(spec.map)
        self._mounted = []
        for view, gnss in self.served_sensors(spec, Gnss):
            topics = gnss_topics(view, gnss)
            if topics.extended_fix is not None:
                require_installed(topics.extended_fix.type, f"{gnss.name}: extended_fix")
            for topic in topics:
                if topic is not None:
                    self.advertise(topic)
            model = GnssModel(gnss, datum, view.noise_seed, spec.tick_ns, topics.fix.period_ticks, tunnels)
            frame = f"{view.agent}/{gnss.name}"
            self._mounted.append(_Mounted(view, frame, model, topics, datum.map_from_east_rad))
        return [topic.name for mounted in self._mounted for topic in mounted.topics if topic is not None]

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Publish the fixes that are due, and velocities with them."""
        for view, frame, model, topics, map_from_east_rad in self._mounted:
            if model.is_due(state.tick):
                seen = view.ego_state(state)
                fix = model.measure(seen)
                self.publish(topics.fix.name, fix_message(fix, state.stamp_ns, frame))
                velocity = None
                if topics.velocity is not None and topics.fix_velocity is not None:
                    velocity = model.measure_velocity(seen, fix)
                    plain, with_covariance = velocity_messages(velocity, state.stamp_ns)
                    self.publish(topics.velocity.name, plain)
                    self.publish(topics.fix_velocity.name, with_covariance)
                if topics.extended_fix is not None:
                    message = serialize_gps_fix(fix, velocity, state.stamp_ns, frame, map_from_east_rad)
                    self.publish(topics.extended_fix.name, message)
