"""The IMU node: publishes the samples of each inertial measurement unit, from the true motion of its agent."""

from typing import NamedTuple

from simbev_ros.config.positioning import Imu
from simbev_ros.maps.build import load_datum
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.motion import imu_messages
from simbev_ros.ros.msgs.sensor_topics import ImuTopics, imu_topics
from simbev_ros.ros.nodes.participant import Participant
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.sensors.imu import ImuModel


class _Mounted(NamedTuple):
    view: AgentView
    frame: str
    model: ImuModel
    topics: ImuTopics


class ImuNode(Participant):
    """Serves all IMUs of its agents: ``data`` with the orientation, ``data_raw`` without (REP-145).

    Samples between two ticks are published at the later tick, in order, each with its own stamp.
    """

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._previous: WorldState | None = None
        self._mounted: list[_Mounted] = []

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Advertise the IMUs' topics."""
        self._previous = None
        self._mounted = []
        for view, imu in self.served_sensors(spec, Imu):
            topics = imu_topics(view, imu)
            for topic in topics:
                self.advertise(topic)
            period, per_tick = topics.raw.period_ticks, topics.raw.messages_per_tick
            model = ImuModel(
                imu, view.noise_seed, spec.tick_ns, period, per_tick, load_datum(spec.map).map_from_east_rad
            )
            self._mounted.append(_Mounted(view, f"{view.agent}/{imu.name}", model, topics))
        return [topic.name for mounted in self._mounted for topic in mounted.topics]

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Publish the samples that are due."""
        for view, frame, model, topics in self._mounted:
            if model.is_due(state.tick):
                previous = None if self._previous is None else view.ego_state(self._previous)
                samples = model.measure(view.ego_state(state), previous)
                for topic, oriented in ((topics.raw, False), (topics.oriented, True)):
                    for message in imu_messages(samples, frame, oriented=oriented):
                        self.publish(topic.name, message)
        self._previous = state
