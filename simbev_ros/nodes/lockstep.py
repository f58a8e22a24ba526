"""The lockstep window: who has finished which tick. Pure; the world node feeds it from /sync/ready."""

from collections.abc import Iterable

from simbev_ros.scene.spec import SceneSpec


class Lockstep:
    """Tracks the last finished tick of every participant.

    Args:
        participants: Names that must report.
        window_ticks: Tick t may start when all have finished tick t - window.
    """

    def __init__(self, participants: Iterable[str], window_ticks: int) -> None:
        self._participants = tuple(participants)
        self._window_ticks = window_ticks
        self._spec: SceneSpec | None = None
        self._finished: dict[str, int] = {}

    def start_scene(self, spec: SceneSpec) -> None:
        """Forget the scene before."""
        self._spec = spec
        self._finished = {}

    def finished(self, frame_id: str, stamp_ns: int) -> None:
        """Take a report ``name:scene``; reports for other scenes and from other nodes are ignored."""
        name, _, scene = frame_id.partition(":")
        if self._spec is not None and scene == self._spec.name and name in self._participants:
            tick = self._spec.tick_of(stamp_ns)
            self._finished[name] = max(tick, self._finished.get(name, tick))

    @property
    def all_loaded(self) -> bool:
        """Every participant has reported at least once."""
        return len(self._finished) == len(self._participants)

    def may_start(self, tick: int) -> bool:
        """Everybody has loaded the scene and is at most the window behind."""
        return self.all_loaded and all(done >= tick - self._window_ticks for done in self._finished.values())

    def laggards(self) -> list[str]:
        """Those who have finished least, and hold the others up."""
        last = {name: self._finished.get(name, -(2**62)) for name in self._participants}
        return [name for name, tick in last.items() if tick == min(last.values())]

    def finished_by_all(self) -> int | None:
        """The last tick that everybody has finished; None before all have loaded the scene."""
        return min(self._finished.values(), default=None) if self.all_loaded else None
