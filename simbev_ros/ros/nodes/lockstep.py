"""The lockstep window: which participant has finished which tick, and whether the next tick may start.

It is pure: the world node and the graph's monitor feed it the reports on /sync/ready.
"""

from collections.abc import Iterable

from simbev_ros.ros.nodes.reports import Report
from simbev_ros.schema.scene.spec import SceneSpec, scene_number_of

_LAST_LEAD_IN_TICK = -1
"""A participant from outside that has loaded a scene need not follow the lead-in."""


class LockstepWindow:
    """Tracks the last finished tick of every participant.

    Args:
        participants: Names of the nodes that must report.
        window_ticks: Tick t may start when every participant has finished tick t - window_ticks.
        outside: Participants that are not nodes of the graph; they follow a looser protocol (see ``record_report``).

    Attributes:
        participants: Names of the nodes that must report.
        window_ticks: As above.
    """

    def __init__(self, participants: Iterable[str], window_ticks: int, outside: Iterable[str] = ()) -> None:
        self.participants = tuple(participants)
        self._outside = frozenset(outside)
        self.window_ticks = window_ticks
        self._spec: SceneSpec | None = None
        self._finished: dict[str, int] = {}
        self._first_stamps_ns: dict[str, int] = {}

    def start_scene(self, spec: SceneSpec) -> None:
        """Expect the reports of a new scene, of which no participant has finished anything."""
        self._spec = spec
        self._finished, self._first_stamps_ns = {}, {}

    def record_report(self, report: Report, published_tick: int | None = None) -> bool:
        """Record a report; return whether it counts.

        Reports of other scenes and from unknown nodes are ignored. So are those of ticks that the scene does not have;
        after the last tick there is one more, for the files that are written then.

        The first report of an outside participant means that it has loaded the scene, and no more, whatever its stamp:
        a latched report that is left over from an earlier graph with the same scene must not count as finished ticks.
        The same stamp again repeats this report. Any other stamp means a finished tick, and counts if it is news.

        Args:
            report: The report.
            published_tick: The last tick that is known to have been published. A first report of a tick up to this one
                is true, and earlier reports have been missed; None: nothing has been published.
        """
        spec = self._spec
        if spec is None or report.node not in self.participants or not _may_be_of(spec, report):
            return False
        if report.node in self._outside:
            tick = self._outside_tick(spec, report, published_tick)
        else:
            tick = self._own_tick(spec, report)
        if tick is None:
            return False
        self._finished[report.node] = max(tick, self._finished.get(report.node, tick))
        return True

    def release(self, participant: str) -> None:
        """Expect nothing more of a participant in this scene."""
        if self._spec is not None and participant in self.participants:
            self._finished[participant] = self._spec.ticks

    def _own_tick(self, spec: SceneSpec, report: Report) -> int | None:
        """Tick that a node of the graph reports; None if the scene does not have it."""
        tick = spec.tick_of(report.stamp_ns)
        return tick if -spec.lead_in_ticks - self.window_ticks <= tick <= spec.ticks else None

    def _outside_tick(self, spec: SceneSpec, report: Report, published_tick: int | None) -> int | None:
        """Tick up to which an outside participant has finished the scene; None if the report is not new."""
        tick, finished = spec.tick_of(report.stamp_ns), self._finished.get(report.node)
        if finished is None:
            self._first_stamps_ns[report.node] = report.stamp_ns
            published_tick = spec.loaded_tick if published_tick is None else published_tick
            return tick if spec.loaded_tick <= tick <= published_tick else _LAST_LEAD_IN_TICK
        if self._first_stamps_ns.get(report.node) == report.stamp_ns:
            return None
        self._first_stamps_ns.pop(report.node, None)
        if scene_number_of(report.stamp_ns) != spec.number:
            return None
        tick = min(tick, spec.ticks - 1)  # inputs slower than the ticks are reported in advance
        return tick if tick > finished else None

    @property
    def all_loaded(self) -> bool:
        """Whether every participant has reported at least once, which means that it has loaded the scene."""
        return len(self._finished) == len(self.participants)

    def may_start(self, tick: int) -> bool:
        """Whether all participants have loaded the scene and are at most the window behind."""
        return self.all_loaded and all(done >= tick - self.window_ticks for done in self._finished.values())

    def laggards(self) -> list[str]:
        """The participants with the lowest finished tick, which hold up the others."""
        last = {name: self._finished.get(name, -(2**62)) for name in self.participants}
        return [name for name, tick in last.items() if tick == min(last.values())]

    def finished_tick(self, name: str) -> int | None:
        """The last tick that a participant has finished; negative when it has loaded the scene, None before."""
        return self._finished.get(name)

    def finished_by_all(self) -> int | None:
        """The last tick that all participants have finished; None before all have loaded the scene."""
        return min(self._finished.values(), default=None) if self.all_loaded else None


def _may_be_of(spec: SceneSpec, report: Report) -> bool:
    """Whether a report names the scene; without a name, whether its stamp is zero or lies in the scene's hour."""
    if report.scene:
        return report.scene == spec.name
    return report.stamp_ns == 0 or scene_number_of(report.stamp_ns) == spec.number
