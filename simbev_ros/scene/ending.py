"""When and why a scene ends: after its duration, or earlier when the ego has stood still for too long."""

import math

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.scene.state import WorldState

DURATION = "duration"
_STANDING_MPS = 0.1


class SceneEnd(Model):
    """The end of a scene, as /world/end tells it before the last tick is published."""

    scene: str
    tick: int = Field(ge=0, description="the last one")
    reason: str = Field(description="duration, or in words why the scene ended earlier")
    events: int = Field(0, ge=0, description="messages on /world/events from tick 0 to the last one")


class SceneEndDetector:
    """Watches one scene.

    Args:
        spec: The scene.
        available: Ticks that its source has, and why there are no more.
    """

    def __init__(self, spec: SceneSpec, available: tuple[int, str]) -> None:
        self._spec = spec
        self._last_tick, self._reason = available[0] - 1, available[1]
        self._standing_ticks = 0
        self._events = 0

    def at(self, state: WorldState) -> SceneEnd | None:
        """The end of the scene, if this tick, the next one after that of the call before, is its last."""
        if state.tick < 0:
            return None
        self._events += len(state.events)
        ego, most = state.ego, self._spec.end_after_standing_ticks
        stands = math.hypot(ego["vx"], ego["vy"]) < _STANDING_MPS
        self._standing_ticks = self._standing_ticks + 1 if stands else 0
        if most is not None and self._standing_ticks >= most:
            standing_s = most * self._spec.tick_ns / NS_PER_S
            return self._end(state.tick, f"ego stood still for {standing_s:g} s at tick {state.tick}")
        return self._end(state.tick, self._reason) if state.tick >= self._last_tick else None

    def _end(self, tick: int, reason: str) -> SceneEnd:
        return SceneEnd(scene=self._spec.name, tick=tick, reason=reason, events=self._events)
