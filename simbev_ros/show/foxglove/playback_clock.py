"""Position of a playback on the time line of a bag: playing or paused, at any speed. Pure; time is passed in."""

from dataclasses import dataclass

from simbev_ros.foundation.units import NS_PER_S


@dataclass(slots=True)
class PlaybackClock:
    """Clock of a playback.

    Attributes:
        start_ns: Stamp of the first message.
        end_ns: Stamp of the last message.
        position_ns: Position on the time line, from ``start_ns`` to ``end_ns``.
        speed: Simulated seconds per second.
        playing: Whether the position advances.
    """

    start_ns: int
    end_ns: int
    position_ns: int
    speed: float = 1.0
    playing: bool = True

    def advance(self, elapsed_s: float) -> int:
        """Let time pass and return the new position; the position stays at the end."""
        if self.playing:
            self.seek(self.position_ns + round(elapsed_s * self.speed * NS_PER_S))
        return self.position_ns

    def seek(self, stamp_ns: int) -> None:
        """Jump to a stamp, or to the nearest end of the time line."""
        self.position_ns = min(max(stamp_ns, self.start_ns), self.end_ns)

    @property
    def at_end(self) -> bool:
        """Whether everything has been played."""
        return self.position_ns >= self.end_ns
