"""Where the states of a scene come from: a simulation, or a bag that is replayed."""

from typing import Protocol

from simbev_ros.scene.state import WorldState


class StateSource(Protocol):
    """One scene, tick by tick."""

    @property
    def available(self) -> tuple[int, str]:
        """How many ticks from tick 0 on there are, and why no more."""

    def drive_ego(self, speed_mps: float, yaw_rate_radps: float) -> None:
        """How the ego shall move from the next tick on; only an ego that is driven from outside heeds it."""

    def step(self) -> WorldState:
        """The state one tick on; at the first call that of the warm-up's first tick.

        Raises:
            SimbevError: the source failed.
        """

    def close(self) -> None:
        """Release what it holds; a second call does nothing."""
