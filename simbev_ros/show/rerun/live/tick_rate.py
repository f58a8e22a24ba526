"""Measures the speed of a running graph from its clock."""

from collections import deque

_SPAN_S = 3.0


class TickRate:
    """Ticks per second of wall time, over the last seconds."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque()

    def add(self, tick: int, now_s: float) -> None:
        """Note a tick that has begun."""
        if self._seen and tick <= self._seen[-1][1]:
            return
        self._seen.append((now_s, tick))
        while len(self._seen) > 2 and now_s - self._seen[1][0] > _SPAN_S:
            self._seen.popleft()

    @property
    def ticks_per_s(self) -> float | None:
        """The speed; None before the second tick."""
        if len(self._seen) < 2:
            return None
        (first_s, first), (last_s, last) = self._seen[0], self._seen[-1]
        return (last - first) / max(last_s - first_s, 1e-6)
