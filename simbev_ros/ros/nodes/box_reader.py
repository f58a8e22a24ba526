"""The base class of nodes that read the boxes of all agents of a scene, tick by tick."""

from collections.abc import Mapping

from simbev_ros.foundation.types import Table
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.joint_topics import joint_inputs
from simbev_ros.ros.msgs.tables import table_from_cdr
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.nodes.joined_inputs import JoinedInputs
from simbev_ros.ros.nodes.participant import Participant
from simbev_ros.schema.boxes import BOX_DTYPE
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState

_LIVE_PATIENCE_TICKS = 16
"""Live: ticks after which boxes still missing are no longer awaited; longer than annotators wait for their sensors."""
_BOX_COLUMNS = list(BOX_DTYPE.names or ())


class BoxReader(Participant):
    """Base of the nodes that need the boxes of all agents of a tick. In a scene with one agent they do nothing.

    A subclass advertises its topics in ``start_scene``, which must call this one, and publishes in ``process_boxes``.
    """

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._topics: dict[str, Topic] = {}
        self._joined: JoinedInputs[WorldState, Table] = JoinedInputs(
            self, _LIVE_PATIENCE_TICKS, self._read_boxes, self._process_ready
        )

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Subscribe to the boxes."""
        self._topics = joint_inputs(spec)
        self._joined.start_scene(self._topics)
        return []

    def process_boxes(self, spec: SceneSpec, state: WorldState, boxes: Mapping[str, Table]) -> None:
        """Do the work of one recorded tick.

        Args:
            spec: The scene.
            state: The state as the first agent sees it.
            boxes: ``BOX_DTYPE`` rows around each agent with received boxes, by the agent's name.
        """
        raise NotImplementedError

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether there are several agents at the tick."""
        return tick >= 0 and bool(self._topics)

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Let a tick wait for its boxes."""
        if not self.is_due(spec, state.tick):
            return
        self._joined.expect(state.tick, state)

    def finish(self, spec: SceneSpec, state: WorldState) -> None:
        """Report ticks without boxes; others are finished when their boxes have been processed."""
        if self.is_due(spec, state.tick):
            self._process_ready(spec)
        else:
            super().finish(spec, state)

    def _process_ready(self, spec: SceneSpec) -> None:
        """Process all ticks that do not wait for boxes any longer."""
        for _, state, boxes in self._joined.release():
            with self.meter.busy(ticks=0):
                self.process_boxes(spec, state, boxes)
            self.report_finished(spec, state.tick)

    def _read_boxes(self, agent: str, payload: bytes) -> Table | None:
        return self.read(self._topics[agent].name, _boxes_from_cdr, payload)


def _boxes_from_cdr(payload: bytes) -> Table:
    """(N,) ``BOX_DTYPE`` rows of a serialized message; raises ValueError if it has not all of the columns."""
    boxes: Table = table_from_cdr(payload, _BOX_COLUMNS)[_BOX_COLUMNS].astype(BOX_DTYPE)
    return boxes
