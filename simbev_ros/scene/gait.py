"""How people walk and run: gait.yaml.

The world advances the ``gait`` phase by its strides; the meshes are posed by all of it.
"""

from functools import lru_cache
from importlib.resources import files

import numpy as np
import yaml

from simbev_ros.config.base import Model
from simbev_ros.types import Float64Array

_G_MPS2 = 9.81
_LEG = 0.53
"""Height of the hips over that of the body: Drillis and Contini, "Body Segment Parameters", 1966."""
_TRANSITION_FROUDE = 0.5
"""speed²/(g leg) from which people run: Kram, Domingo and Ferris, J. Exp. Biol. 200, 1997."""


class Gait(Model):
    """How people move at one speed; the fields are explained in gait.yaml."""

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
    """The rows, by ascending speed."""
    text = files("simbev_ros.scene").joinpath("gait.yaml").read_text()
    return tuple(Gait.model_validate(row) for row in yaml.safe_load(text))


def interpolate_gaits(parts: int) -> tuple[Gait, ...]:
    """The rows, and so many less one between each two of them."""
    names = list(Gait.model_fields)
    rows = np.array([[getattr(gait, name) for name in names] for gait in load_gaits()])
    places = np.arange((len(rows) - 1) * parts + 1) / parts
    columns = [np.interp(places, np.arange(len(rows)), column) for column in rows.T]
    return tuple(Gait(**dict(zip(names, row, strict=True))) for row in np.transpose(columns).tolist())


def transition_mps(height_m: float) -> float:
    """The speed above which a person of this height runs."""
    return float(np.sqrt(_TRANSITION_FROUDE * _G_MPS2 * _LEG * height_m))


def unit_mps(height_m: float) -> float:
    """The speed that counts as 1 for a person of this height."""
    return float(np.sqrt(_G_MPS2 * height_m))


def stride_lengths_m(height_m: Float64Array, speed_mps: Float64Array) -> Float64Array:
    """(N,) ways of two steps of people of (N,) heights at (N,) speeds."""
    gaits = load_gaits()
    relative = np.interp(
        speed_mps / np.sqrt(_G_MPS2 * height_m), [gait.speed for gait in gaits], [gait.stride for gait in gaits]
    )
    return height_m * relative
