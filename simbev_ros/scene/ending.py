"""Detection of the end of a scene: after its duration, or earlier when the ego has stood still for too long.

A drive ends at its goal, in standstill, off its route, or after its time; a scenario by its stop trigger. A scene also
ends when the supervisor asks.
"""

import numpy as np
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.route_progress import STANDING_MPS, DriveRule
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import STORYBOARD_STOP, WorldState

DURATION = "duration"


class SceneEnd(Model):
    """The end of a scene, published on /world/end before the last tick."""

    scene: str
    tick: int = Field(ge=0, description="last tick of the scene")
    reason: str = Field(description="duration, or the reason in words if the scene ended early")
    events: int = Field(0, ge=0, description="number of messages on /world/events from tick 0 to the last tick")


class SceneEndDetector:
    """Detects the last tick of one scene.

    Args:
        spec: The scene.
        available: Number of ticks that its source provides, and why it provides no more.
    """

    def __init__(self, spec: SceneSpec, available: tuple[int, str]) -> None:
        self._spec = spec
        self._last_tick, self._reason = available[0] - 1, available[1]
        self._standing_ticks = 0
        self._events = 0
        self._requested: str | None = None
        self._drive = None if spec.drive is None else DriveRule(spec.drive, spec.tick_ns)

    def end_soon(self, reason: str) -> None:
        """Let the scene end with its next tick, for a reason in words."""
        self._requested = reason

    def end_at(self, state: WorldState) -> SceneEnd | None:
        """The end of the scene if this tick is its last one, otherwise None. Call it for every tick in order."""
        if state.tick < 0:
            return None
        self._events += len(state.events)
        ego, max_ticks = state.ego, self._spec.end_after_standing_ticks
        speed_mps = float(np.hypot(ego["vx"], ego["vy"]))  # rounded as in the referee, which must see the same end
        self._standing_ticks = self._standing_ticks + 1 if speed_mps < STANDING_MPS else 0
        if max_ticks is not None and self._standing_ticks >= max_ticks:
            standing_s = max_ticks * self._spec.tick_ns / NS_PER_S
            return self._end(state.tick, f"ego stood still for {standing_s:g} s at tick {state.tick}")
        if self._drive is not None:
            done = self._drive.end_at(state.tick, np.array([ego["x"], ego["y"]], np.float64), speed_mps)
            if done is not None:
                return self._end(state.tick, done[1])
        if any(event.type == STORYBOARD_STOP for event in state.events):
            return self._end(state.tick, "the scenario's stop trigger")
        if self._requested is not None:
            return self._end(state.tick, self._requested)
        return self._end(state.tick, self._reason) if state.tick >= self._last_tick else None

    def _end(self, tick: int, reason: str) -> SceneEnd:
        return SceneEnd(scene=self._spec.name, tick=tick, reason=reason, events=self._events)
