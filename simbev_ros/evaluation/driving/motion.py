"""Variables of comfort: accelerations, jerk and turning of the ego over a drive, with nuPlan's bounds.

Accelerations and yaw rates are those of the actors table, smoothed and derived with Savitzky-Golay filters over
windows as long as nuPlan's.
"""

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np

from simbev_ros.evaluation.driving.infractions import Infraction, InfractionKind
from simbev_ros.evaluation.driving.moment import Moment
from simbev_ros.foundation.geometry.plan_view import left_of
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import BoolArray, Float64Array

_MIN_SAMPLES = 5


@cache
def coefficients(name: str) -> Mapping[str, Any]:
    """Part of ``coefficients.yaml``."""
    found: Mapping[str, Any] = load_table("simbev_ros.evaluation.driving.scores", "coefficients.yaml")[name]
    return found


@cache
def bounds() -> Mapping[str, tuple[float, float]]:
    """Minimum and maximum of each variable of comfort."""
    return {name: (float(low), float(high)) for name, (low, high) in coefficients("comfort")["bounds"].items()}


class ComfortRule:
    """Keeps the motion of the ego, and yields when an acceleration or the yaw rate begins to exceed its bounds."""

    def __init__(self, tick_s: float) -> None:
        self._tick_s, self._rows, self._was_rough = tick_s, list[tuple[float, ...]](), False

    def judge(self, moment: Moment) -> Iterator[Infraction]:
        """Yield the moment at which bounds begin to be exceeded."""
        ego = moment.ego
        acceleration = np.array([float(ego["ax"]), float(ego["ay"])])
        along, aside = float(acceleration @ moment.ahead), float(acceleration @ left_of(moment.ahead))
        self._rows.append((along, aside, float(ego["wz"]), *acceleration.tolist()))
        limits = bounds()
        names = ("longitudinal_acceleration", "lateral_acceleration", "yaw_rate")
        ratio = max(
            max(value / limits[name][1], value / limits[name][0])
            for name, value in zip(names, self._rows[-1], strict=False)
        )
        was_rough, self._was_rough = self._was_rough, ratio > 1.0
        if self._was_rough and not was_rough:
            yield moment.infraction(InfractionKind.DISCOMFORT, ratio)

    def variables(self) -> dict[str, Float64Array]:
        """(T,) values of each variable of comfort at each tick."""
        return comfort_variables(np.array(self._rows, np.float64).reshape(-1, 5), self._tick_s)


def comfort_variables(motion: Float64Array, tick_s: float) -> dict[str, Float64Array]:
    """(T,) values of the variables of comfort.

    Args:
        motion: (T, 5) longitudinal and lateral acceleration, m/s², yaw rate, rad/s, and acceleration along x and y.
        tick_s: Time between two rows.
    """
    short_s, long_s = coefficients("comfort")["windows_s"]
    along, aside = (_filtered(motion[:, column], tick_s, short_s) for column in (0, 1))
    jerk = [_filtered(motion[:, column], tick_s, long_s, derivative=1) for column in (0, 3, 4)]
    return {
        "longitudinal_acceleration": along,
        "lateral_acceleration": aside,
        "yaw_rate": _filtered(motion[:, 2], tick_s, long_s),
        "yaw_acceleration": _filtered(motion[:, 2], tick_s, long_s, derivative=1),
        "longitudinal_jerk": jerk[0],
        "jerk": np.hypot(jerk[1], jerk[2]),
    }


def is_comfortable(variables: Mapping[str, Float64Array]) -> BoolArray:
    """(T,) whether all variables are within their bounds at each tick."""
    within = [(variables[name] >= low) & (variables[name] <= high) for name, (low, high) in bounds().items()]
    return np.logical_and.reduce(within)


def _filtered(values: Float64Array, tick_s: float, window_s: float, derivative: int = 0) -> Float64Array:
    """(T,) values or their derivative, from parabolas through windows; short series are taken as they are."""
    samples = max(2 * round(window_s / tick_s / 2.0) + 1, _MIN_SAMPLES)
    if len(values) < samples:
        return np.gradient(values, tick_s) if derivative and len(values) > 1 else values * (1.0 - derivative)
    from scipy.signal import savgol_filter

    return np.asarray(savgol_filter(values, samples, 2, deriv=derivative, delta=tick_s), np.float64)
