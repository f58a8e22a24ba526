"""Lateral offsets for narrow passing: drivers move aside for vehicles they would pass too closely, and later return."""

import numpy as np

from simbev_ros.types import Float64Array, Int64Array
from simbev_ros.world.driving.conflicts import MARGINS_M, Conflicts, PredictedTraffic
from simbev_ros.world.driving.trajectory_prediction import TIMES_S

_MIN_ALIGNMENT = 0.8  # cosine of the angle up to which vehicles pass each other and do not cross
_MAX_OFFSET_M, _MAX_LACKING_M = 0.6, 1.2
_STEP_M = 0.1  # correction of the offset at each look
_RETURN_MPS = 0.15


class PassingOffsets:
    """Lateral offsets of drivers from SUMO's positions.

    Attributes:
        offset_m: (V,) desired offset of each vehicle to the left.
    """

    def __init__(self, vehicles: int, look_period_s: float) -> None:
        """Start without offsets; drivers look every ``look_period_s``."""
        self.offset_m: Float64Array = np.zeros(vehicles)
        self._look_period_s = look_period_s
        self._undisturbed_s = np.zeros(vehicles)  # time since each driver last had to make room

    def update_offsets(self, drivers: Int64Array, conflicts: Conflicts, predicted: PredictedTraffic) -> None:
        """Move those of (D,) drivers aside who meet other vehicles too closely, and let the undisturbed ones return."""
        first_contacts = predicted.first_contacts(conflicts)
        gap_m = first_contacts.gap_m[:, 1]
        lacking_m = first_contacts.reach_m[:, 1] + MARGINS_M[0] - np.abs(gap_m)
        is_passing = predicted.as_seen.stays[conflicts.other] | (first_contacts.alignment > _MIN_ALIGNMENT)
        is_passing &= (lacking_m > 0.0) & (lacking_m < _MAX_LACKING_M)
        self._undisturbed_s[drivers] += self._look_period_s
        self._undisturbed_s[conflicts.driver[is_passing]] = 0.0
        undisturbed = drivers[self._undisturbed_s[drivers] > TIMES_S[-1]]
        return_m = np.minimum(np.abs(self.offset_m[undisturbed]), _RETURN_MPS * self._look_period_s)
        self.offset_m[undisturbed] -= np.sign(self.offset_m[undisturbed]) * return_m
        step_m = np.minimum(lacking_m[is_passing], _STEP_M)
        np.add.at(self.offset_m, conflicts.driver[is_passing], -np.sign(gap_m[is_passing]) * step_m)
        np.clip(self.offset_m, -_MAX_OFFSET_M, _MAX_OFFSET_M, out=self.offset_m)
