"""The IMU node: publishes the samples of the rig's inertial measurement units."""

from sensor_msgs.msg import Imu as ImuMessage

from simbev_ros.config.positioning import Imu
from simbev_ros.msgs.motion import imu_messages
from simbev_ros.msgs.topics import Topic
from simbev_ros.nodes.participant import Participant
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.imu import ImuModel


class ImuNode(Participant):
    """Serves all IMUs of the rig: ``data`` with the orientation, ``data_raw`` without (REP-145).

    Samples between two ticks are published at the latter, in order, each with its own stamp.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._previous: WorldState | None = None
        self._models: dict[str, ImuModel] = {}

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Advertise the topics."""
        self._previous = None
        self._models = {}
        names = []
        for imu in spec.rig.of_type(Imu):
            frame = f"{spec.rig.agent}/{imu.name}"
            period, per_tick = spec.period_ticks(imu.rate_hz), spec.messages_per_tick(imu.rate_hz)
            self._models[frame] = ImuModel(imu, spec.seed, spec.tick_ns, period, per_tick)
            for name in (f"/{frame}/data_raw", f"/{frame}/data"):
                self.advertise(
                    Topic(name, "sensor_msgs/msg/Imu", period, messages_per_tick=per_tick, sensor=True), ImuMessage
                )
                names.append(name)
        return names

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Publish what is due."""
        for frame, model in self._models.items():
            if model.is_due(state.tick):
                samples = model.measure(state, self._previous)
                for name, oriented in ((f"/{frame}/data_raw", False), (f"/{frame}/data", True)):
                    for message in imu_messages(samples, frame, oriented=oriented):
                        self.publish(name, message)
        self._previous = state
