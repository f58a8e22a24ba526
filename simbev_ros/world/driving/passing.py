"""Passing: drivers who would pass another vehicle too narrowly move aside, and drive back once it is quiet again."""

import numpy as np

from simbev_ros.types import Float64Array, Int64Array
from simbev_ros.world.driving.conflicts import MARGINS_M, Encounters, Outlook
from simbev_ros.world.driving.trajectory_prediction import TIMES_S

_PARALLEL = 0.8  # cosine of the angle at which vehicles still pass each other, and do not cross
_MOST_ASIDE_M, _MOST_LACKING_M = 0.6, 1.2
_STEP_M = 0.1  # by which a driver corrects how far aside it drives at each look
_RETURN_MPS = 0.15


class Passing:
    """How far aside drivers make room.

    Attributes:
        aside_m: (V,) how far to the left of SUMO's places vehicles shall drive.
    """

    def __init__(self, vehicles: int, look_s: float) -> None:
        """All on their ways; drivers look at intervals of ``look_s``."""
        self.aside_m: Float64Array = np.zeros(vehicles)
        self._look_s = look_s
        self._quiet_s = np.zeros(vehicles)  # since drivers had to make room

    def advance(self, drivers: Int64Array, met: Encounters, outlook: Outlook) -> None:
        """Let (D,) drivers who look now make room for the vehicles that they meet, and the rest of them drive back."""
        touches = outlook.touches(met)
        gap_m = touches.gap_m[:, 1]
        lacks_m = touches.reach_m[:, 1] + MARGINS_M[0] - np.abs(gap_m)
        passes = outlook.others.stays[met.other] | (touches.alignment > _PARALLEL)
        passes &= (lacks_m > 0.0) & (lacks_m < _MOST_LACKING_M)
        self._quiet_s[drivers] += self._look_s
        self._quiet_s[met.me[passes]] = 0.0
        quiet = drivers[self._quiet_s[drivers] > TIMES_S[-1]]
        back_m = np.minimum(np.abs(self.aside_m[quiet]), _RETURN_MPS * self._look_s)
        self.aside_m[quiet] -= np.sign(self.aside_m[quiet]) * back_m
        step_m = np.minimum(lacks_m[passes], _STEP_M)
        np.add.at(self.aside_m, met.me[passes], -np.sign(gap_m[passes]) * step_m)
        np.clip(self.aside_m, -_MOST_ASIDE_M, _MOST_ASIDE_M, out=self.aside_m)
