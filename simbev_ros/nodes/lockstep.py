"""The lockstep window: which participant has finished which tick, and whether the next tick may start.

It is pure: the world node and the graph's monitor feed it the reports on /sync/ready.
"""

from collections.abc import Iterable

from simbev_ros.nodes.reports import Report
from simbev_ros.scene.spec import SceneSpec


class Lockstep:
    """Tracks the last finished tick of every participant.

    Args:
        participants: Names of the nodes that must report.
        window_ticks: Tick t may start when every participant has finished tick t - window_ticks.

    Attributes:
        participants: Names of the nodes that must report.
    """

    def __init__(self, participants: Iterable[str], window_ticks: int) -> None:
        self.participants = tuple(participants)
        self._window_ticks = window_ticks
        self._spec: SceneSpec | None = None
        self._finished: dict[str, int] = {}
        self._early_stamps_ns: dict[str, int] = {}

    def start_scene(self, spec: SceneSpec) -> None:
        """Expect the reports of a new scene, of which no participant has finished anything."""
        self._spec = spec
        self._finished, self._early_stamps_ns = {}, {}

    def record_report(self, report: Report) -> bool:
        """Record a report; return whether it counts.

        Reports of other scenes and from unknown nodes are ignored. So are those of ticks that the scene does not have:
        early ones do not mean that the participant has loaded the scene (see ``describe_early_reports``), and after the
        last tick there is one more, for the files that are written then.
        """
        name, stamp_ns = report.node, report.stamp_ns
        if self._spec is None or report.scene != self._spec.name or name not in self.participants:
            return False
        tick = self._spec.tick_of(stamp_ns)
        if tick > self._spec.ticks:
            return False
        if tick < -self._spec.lead_in_ticks - self._window_ticks:
            self._early_stamps_ns[name] = stamp_ns
            return False
        self._finished[name] = max(tick, self._finished.get(name, tick))
        return True

    def describe_early_reports(self) -> list[str]:
        """A phrase for each participant whose reports all precede the scene, with the stamp of the latest one."""
        if self._spec is None:
            return []
        first_ns = self._spec.stamp_ns(self._spec.loaded_tick)
        return [
            f"{name} has reported stamp {stamp_ns} ns, which precedes the scene; its first should be {first_ns} ns"
            for name, stamp_ns in self._early_stamps_ns.items()
            if name not in self._finished
        ]

    @property
    def all_loaded(self) -> bool:
        """Whether every participant has reported at least once, which means that it has loaded the scene."""
        return len(self._finished) == len(self.participants)

    def may_start(self, tick: int) -> bool:
        """Whether all participants have loaded the scene and are at most the window behind."""
        return self.all_loaded and all(done >= tick - self._window_ticks for done in self._finished.values())

    def laggards(self) -> list[str]:
        """The participants with the lowest finished tick, which hold up the others."""
        last = {name: self._finished.get(name, -(2**62)) for name in self.participants}
        return [name for name, tick in last.items() if tick == min(last.values())]

    def finished_by_all(self) -> int | None:
        """The last tick that all participants have finished; None before all have loaded the scene."""
        return min(self._finished.values(), default=None) if self.all_loaded else None
