"""The referee node: judges the drive of the first agent from the true state, and publishes infractions and scores."""

from simbev_ros.evaluation.driving.figures import drive_figures
from simbev_ros.evaluation.driving.referee import Referee
from simbev_ros.evaluation.driving.static_world import load_static_world
from simbev_ros.maps.build import load_network
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs import topics
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

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the roads and what stands beside the route, and advertise infractions and scores."""
        self._referee = None
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
        infractions, ticks = self._referee.judge(state), state.tick + 1
        for infraction in infractions:
            self.publish(topics.DRIVE_EVENTS, record_message(infraction.record(), state.stamp_ns))
        is_due = ticks % spec.period_ticks(_SCORE_HZ) == 0 or ticks == spec.ticks
        if is_due or infractions or self._referee.ended:
            self.publish(topics.DRIVE_SCORE, record_message(drive_figures(self._referee.record), state.stamp_ns))
