"""The referee node: judges the drive of the first agent from the true state, and publishes infractions and scores."""

from std_msgs.msg import String

from simbev_ros.evaluation.driving.figures import drive_figures
from simbev_ros.evaluation.driving.referee import Referee
from simbev_ros.evaluation.driving.static_world import load_static_world
from simbev_ros.maps.build import load_network
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.qos import STEERING, rclpy_qos
from simbev_ros.ros.msgs.world import record_message
from simbev_ros.ros.nodes.participant import Participant
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState

_SCORE_HZ = 2.0
"""Rate of the scores, in addition to those after infractions and at the end: each is computed from the whole drive."""


class RefereeNode(Participant):
    """Reads nothing but the world's state, so that a score is there whatever the driver does. Idle without a drive."""

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._referee: Referee | None = None
        self.create_subscription(String, topics.END, self._on_end, rclpy_qos(STEERING))

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the roads and what stands beside the route, and advertise infractions and scores."""
        self._referee = None
        self._judged_ns = self._scored_ns = self._end_ns = -1
        if spec.drive is not None:
            network = load_network(spec.map)
            self._referee = Referee(spec, network, load_static_world(spec, network))
        own = topics.referee_topics(spec)
        for topic in own:
            self.advertise(topic)
        return [topic.name for topic in own]

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether there is a drive to judge at the tick."""
        return tick >= 0 and self._referee is not None

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Publish the infractions that begin, and from time to time the scores up to now."""
        if state.tick < 0 or self._referee is None:
            return
        infractions, self._judged_ns = self._referee.judge(state), state.stamp_ns
        for infraction in infractions:
            self.publish(topics.DRIVE_EVENTS, record_message(infraction.record(), state.stamp_ns))
        if infractions or (state.tick + 1) % spec.period_ticks(_SCORE_HZ) == 0:
            self._publish_score(self._referee)
        self._publish_last_score()

    def _on_end(self, message: String) -> None:
        end = self.read_end(message)
        if end is not None and self.spec is not None and end.scene == self.spec.name:
            self._end_ns = self.spec.stamp_ns(end.tick)
            self._publish_last_score()

    def _publish_last_score(self) -> None:
        """Publish the score at the last tick of the scene, whatever ends it, once both tick and end are known."""
        if self._referee is not None and self._judged_ns == self._end_ns != self._scored_ns:
            self._publish_score(self._referee)

    def _publish_score(self, referee: Referee) -> None:
        self._scored_ns = self._judged_ns
        self.publish(topics.DRIVE_SCORE, record_message(drive_figures(referee.record), self._scored_ns))
