"""Interface of everything that provides the states of a scene: the simulation and the replay of a bag."""

from typing import Protocol

from simbev_ros.foundation.types import Table
from simbev_ros.scene.weather_course import WeatherCourse
from simbev_ros.schema.scene.state import SignalState, WorldState
from simbev_ros.simulation.world.driving.commands import DriverCommand
from simbev_ros.simulation.world.entities import Entities


class StateSource(Protocol):
    """Provides the states of one scene, tick by tick.

    Attributes:
        weather: Weather at each tick, which commands may change.
    """

    weather: WeatherCourse

    @property
    def entities(self) -> Entities | None:
        """Actors that commands have put into the scene or moved; None: all actors are as they were recorded."""

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

    def follow_command(self, vehicle: int, command: DriverCommand) -> None:
        """Let a vehicle follow a command from the next tick on; ignored unless its driver sends stamped commands."""

    def hold_signal(self, head: int, state: SignalState | None) -> int:
        """Let the program of a traffic light go on to a phase in which one of its heads has a state, and stay there.

        Args:
            head: Id of the head; without a state, 0 means all.
            state: Red or green; None: the program goes on in its cycle.

        Returns:
            The first tick that can show it.

        Raises:
            InputError: There is no such head, it never has this state, or the scene is a replay.
        """

    def adopt_entity(self, actor: int, actors: Table) -> None:
        """Take an actor out of the traffic and make an entity of it, unless it is one.

        Args:
            actor: Its id.
            actors: (N,) ``ACTOR_DTYPE``, the latest table.

        Raises:
            InputError: There are too many entities, or the scene is a replay.
        """

    def step(self) -> WorldState:
        """Advance by one tick and return its state; the first call returns the first warm-up tick.

        Raises:
            SimbevError: The source failed.
        """

    def close(self) -> None:
        """Release all resources; further calls have no effect."""
