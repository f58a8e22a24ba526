"""The odometry node: publishes pose and velocity as wheel odometries measure them."""

from typing import NamedTuple

from simbev_ros.config.odometry import Odometry
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.odometry import wheel_odometry_message
from simbev_ros.ros.msgs.sensor_topics import wheel_odometry_topic
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.nodes.participant import Participant
from simbev_ros.scene.frames import base_link_frame, odom_frame, rear_axle_m
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.sensors.odometry import OdometryModel


class _Mounted(NamedTuple):
    view: AgentView
    model: OdometryModel
    topic: Topic


class OdometryNode(Participant):
    """Serves all wheel odometries of its agents."""

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._mounted: list[_Mounted] = []

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Advertise the topics."""
        self._mounted = []
        for view, odometry in self.served_sensors(spec, Odometry):
            topic = wheel_odometry_topic(view, odometry)
            self.advertise(topic)
            model = OdometryModel(
                odometry,
                view.noise_seed,
                spec.tick_ns,
                topic.period_ticks,
                axle_m=rear_axle_m(view),
                base_link_x_m=view.base_link_x_m,
            )
            self._mounted.append(_Mounted(view, model, topic))
        return [mounted.topic.name for mounted in self._mounted]

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Integrate the motion, and publish what is due."""
        for view, model, topic in self._mounted:
            agent, seen = view.agent, view.ego_state(state)
            model.advance(seen)
            if model.is_due(state.tick):
                message = wheel_odometry_message(
                    model.pose, model.twist(seen), state.stamp_ns, odom_frame(agent), base_link_frame(agent)
                )
                self.publish(topic.name, message)
