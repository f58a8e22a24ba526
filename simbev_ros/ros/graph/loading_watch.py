"""Finds nodes that are still computing while a scene loads: a node that builds or reads a map cannot report."""

from collections.abc import Mapping

_WINDOW_S = 2.0
"""Time over which processor time is compared; shorter ones say little on a machine with many other processes."""
_COMPUTING_SHARE = 0.05
"""Share of a core from which a process counts as computing. One that waits for messages takes about a hundredth."""
_PATIENCE = 10.0
"""Multiple of the timeout for silence after which computing no longer counts, so that an endless loop ends."""


class LoadingWatch:
    """The processor time that the processes of nodes spend from the moment at which a scene was requested.

    Args:
        start_s: When the scene was requested, on the caller's clock.
        timeout_s: After this time of silence a node is considered to be stuck.
    """

    def __init__(self, start_s: float, timeout_s: float) -> None:
        self._end_s = start_s + _PATIENCE * timeout_s
        self._since_s = start_s
        self._spent_s: dict[str, float] = {}

    def computing(self, now_s: float, spent_s: Mapping[str, float]) -> list[str]:
        """Names of the nodes whose processes have been computing; empty until some time has passed since the last call.

        Args:
            now_s: The time, on the same clock as ``start_s``.
            spent_s: Processor time of each process so far; the key holds the names of its nodes, joined with ``+``.
        """
        elapsed_s = now_s - self._since_s
        if elapsed_s < _WINDOW_S:
            return []
        found = [
            name
            for label, own_s in spent_s.items()
            if own_s - self._spent_s.get(label, own_s) > _COMPUTING_SHARE * elapsed_s
            for name in label.split("+")
        ]
        self._since_s, self._spent_s = now_s, dict(spent_s)
        return found if now_s < self._end_s else []
