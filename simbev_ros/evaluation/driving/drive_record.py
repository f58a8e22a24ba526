"""What the scores of a drive are computed from: its infractions, and sums and extremes over its ticks."""

from collections.abc import Mapping
from dataclasses import dataclass

from simbev_ros.evaluation.driving.infractions import Infraction, InfractionKind
from simbev_ros.evaluation.driving.rules.pace import SpeedSums
from simbev_ros.foundation.types import Float64Array


@dataclass(frozen=True, slots=True, eq=False)
class DriveRecord:
    """A drive up to a tick.

    Attributes:
        infractions: All infractions in order.
        completed: Share of the route that is completed, 0 to 1.
        ended: Why the drive is over, such as "goal"; "" while it goes on.
        tick_s: Time between two ticks.
        ticks: Number of ticks.
        driven_m: Distance driven.
        outside_m: Part of it off the road or in lanes of the other direction.
        overspeed_m: Integral of the excess over the speed limit.
        max_off_road_m: Maximum distance of a corner of the vehicle from the road.
        max_oncoming_m: Maximum distance driven against a lane within a second.
        min_time_to_collision_s: Infinite if nothing came near.
        speed_checks: Sums at the start of the route and at every 5 % that is completed.
        comfort: (T,) variables of comfort at each tick, see ``motion.comfort_variables``.
    """

    infractions: tuple[Infraction, ...]
    completed: float
    ended: str
    tick_s: float
    ticks: int
    driven_m: float
    outside_m: float
    overspeed_m: float
    max_off_road_m: float
    max_oncoming_m: float
    min_time_to_collision_s: float
    speed_checks: tuple[SpeedSums, ...]
    comfort: Mapping[str, Float64Array]

    @property
    def duration_s(self) -> float:
        """Time driven."""
        return self.ticks * self.tick_s

    @property
    def outside_share(self) -> float:
        """Share of the driven distance off the road or in lanes of the other direction."""
        return self.outside_m / self.driven_m if self.driven_m > 0.0 else 0.0

    def of_kind(self, *kinds: InfractionKind) -> list[Infraction]:
        """The infractions of these kinds."""
        return [each for each in self.infractions if each.kind in kinds]
