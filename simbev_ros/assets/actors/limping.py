"""Strides of both legs; people who limp stand on the sore leg for a shorter time, flat-footed, and on a stick with it.

The middles of both stances stay half a stride apart, so both legs agree on how the hips rise and fall.
"""

from collections.abc import Mapping

import numpy as np

from simbev_ros.assets.actors.gait import PHASES, Stride, stride
from simbev_ros.assets.actors.limbs import SHOULDER_ABOVE_HIP, bend
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.gait import Gait

Limbs = Mapping[str, Float64Array]

_STEPS = 5  # of a stride's PHASES, by which the stance of the sore leg is shorter, and that of the other one longer
_STROLL = 0.28  # of the slowest stride in gait.yaml: share of the time for which a leg is in the air
_STICK_AHEAD, _STICK_LIFT = 0.10, 0.02  # of the hips in the middle of the stance; over the ground in between


def both_strides(gait: Gait, length: float, sole: tuple[float, float], *, limps: bool) -> tuple[Stride, Limbs]:
    """Stride of the left leg, the sore one, and the right limbs' turns at the same phases; arguments as ``stride``."""
    if not limps:
        own = stride(gait, length, sole)
        return own, {limb: np.roll(turn, PHASES // 2) for limb, turn in own.turn_rad.items()}
    steps = _steps(gait)
    flat = {"toe_off": 0.55 * gait.toe_off, "strike": 0.3 * gait.strike, "tuck": 0.6 * gait.tuck}
    sore = gait.model_copy(update=flat | {"stance": gait.stance - steps / PHASES})
    sound = gait.model_copy(update={"stance": gait.stance + steps / PHASES})
    height = min(float(stride(each, length, sole).hip.mean()) for each in (sore, sound))
    own, other = (stride(each, length, sole, height) for each in (sore, sound))
    return own, {limb: np.roll(turn, PHASES // 2 - steps) for limb, turn in other.turn_rad.items()}


def stick_turns(gait: Gait, length: float, own: Stride, elbow: Float64Array, tip: Float64Array) -> Limbs:
    """Turns of an arm that sets a stick on the ground as long as the sore leg, whose stride is ``own``, stands there.

    ``gait`` and ``length`` are those of ``both_strides``; ``elbow`` and ``tip`` are (3,) from the shoulder as modeled.
    """
    stance, phase, lean = gait.stance - _steps(gait) / PHASES, np.arange(PHASES) / PHASES, own.lean_rad
    swing = np.clip((phase - stance) / max(1.0 - stance, 1e-9), 0.0, 1.0)
    ahead = np.where(phase <= stance, 0.5 - phase / stance, -0.5 * np.cos(np.pi * swing)) * length * stance
    x = _STICK_AHEAD + ahead * (stance < 1.0) - np.sin(lean) * SHOULDER_ABOVE_HIP
    z = _STICK_LIFT * np.sin(np.pi * swing) - own.hip - np.cos(lean) * SHOULDER_ABOVE_HIP
    below = tip - elbow
    upper, lower = (float(np.hypot(each[0], each[2])) for each in (elbow, below))
    upper_rad, lower_rad = bend(np.column_stack([x, np.zeros(PHASES), z]), upper, lower, forward=False)
    turn_rad = upper_rad - np.arctan2(-elbow[0], -elbow[2]) - lean
    return {"upper arm": turn_rad, "forearm": lower_rad - np.arctan2(-below[0], -below[2]) - lean - turn_rad}


def _steps(gait: Gait) -> int:
    """Steps by which the stances differ from the usual one: fewer when walking starts from standing."""
    return round(_STEPS * min(1.0, (1.0 - gait.stance) / _STROLL))
