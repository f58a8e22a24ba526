"""The IMU node: publishes the samples of the rig's inertial measurement units."""

from sensor_msgs.msg import Imu as ImuMessage

from simbev_ros.config.positioning import Imu
from simbev_ros.msgs.motion import imu_message
from simbev_ros.msgs.topics import Topic
from simbev_ros.nodes.participant import Participant
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.imu import measure_imu


class ImuNode(Participant):
    """Serves all IMUs of the rig: ``data`` with the orientation, ``data_raw`` without (REP-145)."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._previous: WorldState | None = None

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Advertise the topics."""
        self._previous = None
        bases = [f"/{spec.rig.agent}/{imu.name}" for imu in spec.rig.of_type(Imu)]
        names = [f"{base}/{kind}" for base in bases for kind in ("data_raw", "data")]
        for name in names:
            self.advertise(Topic(name, "sensor_msgs/msg/Imu", sensor=True), ImuMessage)
        return names

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Publish what is due."""
        for imu in spec.rig.of_type(Imu):
            if state.tick < 0 or state.tick % spec.period_ticks(imu.rate_hz):
                continue
            sample = measure_imu(imu, state, self._previous, spec.seed)
            frame = f"{spec.rig.agent}/{imu.name}"
            for kind, oriented in (("data_raw", False), ("data", True)):
                self.publish(f"/{frame}/{kind}", imu_message(sample, state.stamp_ns, frame, oriented=oriented))
        self._previous = state
