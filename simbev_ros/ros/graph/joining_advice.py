"""Advice on why no report of an outside participant arrives, from what its publisher offers and what it has reported.

It is pure: the graph's monitor feeds it publishers and reports, and shows the advice while the graph waits.
"""

from collections.abc import Collection, Mapping
from typing import NamedTuple

from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.nodes.reports import Report, is_signed
from simbev_ros.schema.scene.spec import SceneSpec

READY_TYPE = "std_msgs/msg/Header"
_REPEAT = (
    ", and repeat it until inputs arrive, or latch the publisher (transient local):"
    " others lose what they send before both nodes have discovered each other"
)
_MAX_UNKNOWN = 3
"""Number of wrong frame ids that are kept and shown."""
_MAX_SHOWN_CHARACTERS = 60


class OutsidePublisher(NamedTuple):
    """A publisher on /sync/ready of a node that is not of the graph."""

    node: str
    type: str
    is_reliable: bool
    is_latched: bool


class JoiningAdvice:
    """Reports of nodes outside in a scene, and advice on what to change.

    Args:
        participants: Names of the participants from outside.
        domain: ROS domain of the graph.
        topic: Name of the topic of reports in ROS, with the graph's namespace.
    """

    def __init__(self, participants: Collection[str], domain: int, topic: str = topics.READY) -> None:
        self._participants, self._domain, self._topic = frozenset(participants), domain, topic
        self._spec: SceneSpec | None = None
        self._earlier_scenes: set[str] = set()
        self._last_stamps_ns: dict[str, int] = {}
        self._unknown: dict[str, None] = {}

    def start_scene(self, spec: SceneSpec) -> None:
        """Forget the reports of earlier scenes."""
        if self._spec is not None:
            self._earlier_scenes.add(self._spec.name)
        self._spec, self._last_stamps_ns, self._unknown = spec, {}, {}

    def note_report(self, report: Report, frame_id: str) -> None:
        """Note a report of a participant from outside; of a scene that there has not been, as a wrong frame id."""
        if self._spec is not None and report.scene in ("", self._spec.name):
            self._last_stamps_ns[report.node] = report.stamp_ns
        elif report.scene not in self._earlier_scenes:
            self.note_unknown(frame_id)

    def note_unknown(self, frame_id: str) -> None:
        """Note the frame id of a message that is not a report of a known node; signed ones are another graph's."""
        if len(self._unknown) < _MAX_UNKNOWN and not is_signed(frame_id):
            self._unknown[frame_id[:_MAX_SHOWN_CHARACTERS]] = None

    def advice(self, waiting: Mapping[str, int | None], publishers: Collection[OutsidePublisher]) -> list[str]:
        """Advice, as sentences, for the participants that hold up the graph.

        Args:
            waiting: For each of these the last finished tick, which is negative when it has loaded the scene; None:
                it has not reported anything. Nodes of the graph are skipped.
            publishers: The publishers on /sync/ready of nodes that are not of the graph.
        """
        if self._spec is None:
            return []
        outside = {name: tick for name, tick in waiting.items() if name in self._participants}
        unheard = [name for name, tick in outside.items() if tick is None]
        found = self._about_unheard(self._spec, unheard, publishers) if unheard else []
        return found + [
            self._about_stamps(self._spec, name) for name, tick in outside.items() if tick is not None and tick < 0
        ]

    def _about_unheard(
        self, spec: SceneSpec, unheard: list[str], publishers: Collection[OutsidePublisher]
    ) -> list[str]:
        faults = [words for each in publishers if (words := self._fault(each)) is not None]
        right = " or ".join(f"{name}:{spec.name}" for name in unheard)
        faults += [f"a report has the frame_id {frame_id!r} instead of {right}" for frame_id in self._unknown]
        if faults:
            return faults
        names = " and ".join(unheard)
        if not publishers:
            return [
                f"no node outside the graph publishes on {self._topic}: start {names} with"
                f" ROS_DOMAIN_ID={self._domain} and the profile that simbev run shows for subscribers"
            ]
        nodes = " and ".join(sorted({each.node for each in publishers}))
        repeat = "" if all(each.is_latched for each in publishers) else _REPEAT
        return [
            f"{nodes} publishes on {self._topic}, but no report of {names} has arrived: publish a std_msgs/Header with"
            f" frame_id {right} when the scene is loaded{repeat}"
        ]

    def _fault(self, publisher: OutsidePublisher) -> str | None:
        """Why nothing from a publisher arrives, and what to change; None: everything does."""
        if publisher.type != READY_TYPE:
            return f"{publisher.node} publishes {publisher.type} on {self._topic}; it must be {READY_TYPE}"
        if not publisher.is_reliable:
            return (
                f"{publisher.node} publishes best effort on {self._topic}, which is not heard: make the publisher"
                f' reliable, as create_publisher(Header, "{self._topic}", 10) does'
            )
        return None

    def _about_stamps(self, spec: SceneSpec, name: str) -> str:
        first_s, last_s = spec.start_ns / NS_PER_S, spec.stamp_ns(spec.ticks - 1) / NS_PER_S
        return (
            f"{name} has loaded the scene but not finished a tick; its last report has the stamp"
            f" {self._last_stamps_ns.get(name, 0) / NS_PER_S:.2f} s, and those of the scene's ticks are {first_s:.2f} s"
            f" to {last_s:.2f} s: report the header.stamp of each input when it is finished"
        )
