"""Notices from the nodes' diagnostics that a graph falls behind the wall clock, and names the node that binds."""

from collections import Counter
from collections.abc import Mapping

from simbev_ros.ros.conventions.diagnostics import TOLERANCE
from simbev_ros.ros.nodes.load_meter import BUSY

_WINDOWS, _STARTING = 2, 2
"""Number of readings in a row, one a second, that show a node as slow; and number of the world's first ones in a scene,
while others still load, which count for nothing."""
_WORLD = "world"


class PaceWatch:
    """Watches one graph.

    Args:
        real_time_factor: Simulated time per wall time at which the graph is meant to run; 0: as fast as it can.
        live: Whether nodes skip ticks that they are too late for, instead of slowing the clock.
    """

    def __init__(self, real_time_factor: float = 0.0, *, live: bool = False) -> None:
        self._factor, self._live = real_time_factor, live
        self.start_scene(1.0)

    def start_scene(self, tick_rate_hz: float) -> None:
        """Forget all readings: a scene starts."""
        self._due_hz = self._factor * tick_rate_hz
        self._slow: Counter[str] = Counter()
        self._latest: dict[str, dict[str, float]] = {}
        self._world_readings, self._said = 0, False

    def add(self, name: str, values: Mapping[str, str]) -> None:
        """Add a node's reading of its ``LoadMeter``; raises KeyError or ValueError if it is none."""
        reading = {key: float(values[key]) for key in ("ticks", "late", "window_s", BUSY)}
        if not reading["ticks"] + reading["late"] or not self._factor:
            return
        self._latest[name] = reading
        if name == _WORLD:
            self._world_readings += 1
            is_slow = reading["ticks"] / reading["window_s"] < (1.0 - TOLERANCE) * self._due_hz
        else:
            is_slow = self._late_share(name) > TOLERANCE
        self._slow[name] = self._slow[name] + 1 if is_slow and self._world_readings > _STARTING else 0

    def news(self) -> str | None:
        """A sentence, once a scene, if the graph is too slow."""
        slow = [name for name, windows in self._slow.items() if windows >= _WINDOWS]
        if self._said or not slow:
            return None
        self._said = True
        name = max(self._latest, key=self._load) if slow == [_WORLD] else max(slow, key=self._late_share)
        reading = self._latest[name]
        words = f"{name} is the slowest node, with {reading[BUSY]:.0f} ms a tick"
        if name != _WORLD and self._live:
            lost = f"{words}: {self._late_share(name):.0%} of its ticks are late and lost"
            return f"{lost}; with --pace auto, the clock slows down instead"
        world = self._latest[_WORLD]
        factor = world["ticks"] / world["window_s"] / self._due_hz * self._factor
        return f"the clock runs at {factor:.2f} times real time: {words}"

    def _load(self, name: str) -> float:
        """Fraction of the time that a node works."""
        reading = self._latest[name]
        return reading["ticks"] * reading[BUSY] / reading["window_s"]

    def _late_share(self, name: str) -> float:
        reading = self._latest[name]
        return reading["late"] / (reading["ticks"] + reading["late"])
