"""When the next tick is due: at once in lockstep, by the wall clock in live mode, on request while paused."""

import time


class Pacer:
    """Paces the world.

    Attributes:
        paused: No tick starts, unless stepped.
        steps: Ticks asked for while paused.
    """

    def __init__(self, *, live: bool) -> None:
        self._live = live
        self._next_s = 0.0
        self.paused = False
        self.steps = 0

    def pause(self, paused: bool) -> None:
        """Start no more ticks, or go on; steps that were asked for before are forgotten."""
        self.paused, self.steps = paused, 0

    def start(self) -> None:
        """A scene starts; live time counts from its first tick."""
        self._next_s, self.steps = 0.0, 0

    def due(self, tick_ns: int) -> bool:
        """Whether the next tick may start now; True consumes it."""
        if self.paused:
            if self.steps == 0:
                return False
            self.steps -= 1
            return True
        if not self._live:
            return True
        now_s = time.monotonic()
        if now_s < self._next_s:
            return False
        # After a stall the clock goes on from now: it does not rush to catch up.
        self._next_s = now_s + tick_ns / 1e9 if now_s - self._next_s > 0.5 else self._next_s + tick_ns / 1e9
        return True
