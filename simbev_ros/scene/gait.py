"""Walking and running gaits of pedestrians, read from gait.yaml.

The world simulation advances the ``gait`` phase by the stride length; the actor meshes are posed from all parameters.
"""

from functools import lru_cache

import numpy as np

from simbev_ros.config.base import Model
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import GRAVITY_MPS2

_HIP_HEIGHT = 0.53
"""Hip height divided by body height: Drillis and Contini, "Body Segment Parameters", 1966."""
_TRANSITION_FROUDE = 0.5
"""Froude number speed²/(g leg) above which people run: Kram, Domingo and Ferris, J. Exp. Biol. 200, 1997."""


class Gait(Model):
    """Gait parameters at one speed; gait.yaml explains the fields."""

    speed: float
    stride: float
    stance: float
    strike: float
    toe_off: float
    rise: float
    bob: float
    reach: float
    lift: float
    lift_at: float
    tuck: float
    lean: float
    shoulder: float
    shoulder_swing: float
    elbow: float
    elbow_swing: float


@lru_cache(maxsize=1)
def load_gaits() -> tuple[Gait, ...]:
    """Load the rows of gait.yaml, ascending by speed."""
    return tuple(Gait.model_validate(row) for row in load_table("simbev_ros.scene", "gait.yaml"))


def interpolate_gaits(steps_per_row: int) -> tuple[Gait, ...]:
    """Gait rows resampled with ``steps_per_row`` intervals between each two rows of the file."""
    names = list(Gait.model_fields)
    rows = np.array([[getattr(gait, name) for name in names] for gait in load_gaits()])
    row_positions = np.arange((len(rows) - 1) * steps_per_row + 1) / steps_per_row
    columns = [np.interp(row_positions, np.arange(len(rows)), column) for column in rows.T]
    return tuple(Gait(**dict(zip(names, row, strict=True))) for row in np.transpose(columns).tolist())


def transition_mps(height_m: float) -> float:
    """Speed above which a person of this height runs."""
    return float(np.sqrt(_TRANSITION_FROUDE * GRAVITY_MPS2 * _HIP_HEIGHT * height_m))


def unit_mps(height_m: float) -> float:
    """Speed that counts as 1 in gait.yaml for a person of this height."""
    return float(np.sqrt(GRAVITY_MPS2 * height_m))


def stride_lengths_m(height_m: Float64Array, speed_mps: Float64Array) -> Float64Array:
    """(N,) stride lengths (two steps) of people of (N,) heights at (N,) speeds."""
    gaits = load_gaits()
    relative = np.interp(
        speed_mps / np.sqrt(GRAVITY_MPS2 * height_m), [gait.speed for gait in gaits], [gait.stride for gait in gaits]
    )
    return height_m * relative
