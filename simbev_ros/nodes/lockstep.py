"""The lockstep window: which participant has finished which tick, and whether the next tick may start.

It is pure: the world node and the graph's monitor feed it the reports on /sync/ready.
"""

from collections.abc import Iterable

from simbev_ros.scene.spec import SceneSpec


class Lockstep:
    """Tracks the last finished tick of every participant.

    Args:
        participants: Names of the nodes that must report.
        window_ticks: Tick t may start when every participant has finished tick t - window_ticks.
    """

    def __init__(self, participants: Iterable[str], window_ticks: int) -> None:
        self._participants = tuple(participants)
        self._window_ticks = window_ticks
        self._spec: SceneSpec | None = None
        self._finished: dict[str, int] = {}

    def start_scene(self, spec: SceneSpec) -> None:
        """Expect the reports of a new scene, of which no participant has finished anything."""
        self._spec = spec
        self._finished = {}

    def record_report(self, frame_id: str, stamp_ns: int) -> None:
        """Record a report ``name:scene`` of the tick at a stamp; other scenes and unknown names are ignored."""
        name, _, scene = frame_id.partition(":")
        if self._spec is not None and scene == self._spec.name and name in self._participants:
            tick = self._spec.tick_of(stamp_ns)
            self._finished[name] = max(tick, self._finished.get(name, tick))

    @property
    def all_loaded(self) -> bool:
        """Whether every participant has reported at least once, which means that it has loaded the scene."""
        return len(self._finished) == len(self._participants)

    def may_start(self, tick: int) -> bool:
        """Whether all participants have loaded the scene and are at most the window behind."""
        return self.all_loaded and all(done >= tick - self._window_ticks for done in self._finished.values())

    def laggards(self) -> list[str]:
        """The participants with the lowest finished tick, which hold up the others."""
        last = {name: self._finished.get(name, -(2**62)) for name in self._participants}
        return [name for name, tick in last.items() if tick == min(last.values())]

    def finished_by_all(self) -> int | None:
        """The last tick that all participants have finished; None before all have loaded the scene."""
        return min(self._finished.values(), default=None) if self.all_loaded else None
