"""Interface of everything that provides the states of a scene: the simulation and the replay of a bag."""

from typing import Protocol

from simbev_ros.schema.scene.state import WorldState


class StateSource(Protocol):
    """Provides the states of one scene, tick by tick."""

    @property
    def available(self) -> tuple[int, str]:
        """Number of ticks from tick 0 on, and the reason why there are no more."""

    def drive_vehicle(self, vehicle: int, speed_mps: float, yaw_rate_radps: float) -> None:
        """Set the desired motion of a vehicle from the next tick on; ignored unless it is driven from outside.

        Args:
            vehicle: Its index in ``SceneSpec.vehicles``.
            speed_mps: Desired speed; negative ones count as 0.
            yaw_rate_radps: Desired yaw rate, counterclockwise positive.
        """

    def step(self) -> WorldState:
        """Advance by one tick and return its state; the first call returns the first warm-up tick.

        Raises:
            SimbevError: The source failed.
        """

    def close(self) -> None:
        """Release all resources; further calls have no effect."""
