"""The driving scores of CARLA's leaderboards 2.0 and 2.1: route completion times an infraction penalty.

Sources: leaderboard.carla.org, "Evaluation criteria for the Leaderboard 2.0" and "2.1"; how percentages enter is
described in carla-simulator/carla, Skills/leaderboard/read-leaderboard-results/references/scoring.md. In both versions
the share of the way outside of the lanes is one more factor. Collisions do not count while the vehicle stands.
"""

import math
from collections.abc import Iterator, Mapping

from simbev_ros.evaluation.driving.drive_record import DriveRecord
from simbev_ros.evaluation.driving.infractions import COLLISIONS, Infraction, InfractionKind
from simbev_ros.evaluation.driving.motion import coefficients
from simbev_ros.schema.scene.route_progress import STANDING_MPS


def leaderboard_2_0(drive: DriveRecord) -> dict[str, float]:
    """Score of leaderboard 2.0, in percent: each infraction is a factor."""
    table = coefficients("leaderboard_2_0")
    penalty = 1.0 - drive.outside_share
    for infraction in counted(drive, table):
        factor = table[infraction.kind]
        if infraction.kind is InfractionKind.MIN_SPEED:
            factor = 1.0 - (1.0 - factor) * (1.0 - infraction.value)
        penalty *= factor
    return _score(drive, penalty)


def leaderboard_2_1(drive: DriveRecord) -> dict[str, float]:
    """Score of leaderboard 2.1, in percent: infractions add up in the denominator."""
    table = coefficients("leaderboard_2_1")
    total = math.fsum(
        table[each.kind] * (1.0 - each.value if each.kind is InfractionKind.MIN_SPEED else 1.0)
        for each in counted(drive, table)
    )
    return _score(drive, (1.0 - drive.outside_share) / (1.0 + total))


def counted(drive: DriveRecord, table: Mapping[str, float]) -> Iterator[Infraction]:
    """Yield the infractions that a table of coefficients counts."""
    for infraction in drive.infractions:
        stands = infraction.kind in COLLISIONS and infraction.speed_mps < STANDING_MPS
        if infraction.kind in table and not stands:
            yield infraction


def _score(drive: DriveRecord, penalty: float) -> dict[str, float]:
    completion = 100.0 * drive.completed
    return {"driving_score": completion * penalty, "route_completion": completion, "infraction_penalty": penalty}
