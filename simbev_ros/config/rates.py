"""Check of the rates of sensors and labels, each of which must divide the tick rate."""

import math

from simbev_ros.config.annotation import Annotation
from simbev_ros.config.base import FieldError, Keys
from simbev_ros.config.positioning import Imu
from simbev_ros.config.rig import Rig

MAX_UNEVEN_HZ = 60
"""Highest tick rate whose ticks need not be whole milliseconds."""


def require_fitting_rates(keys: Keys, rig: Rig, annotation: Annotation | None, tick_hz: float) -> None:
    """Check the rates of an agent's sensors and labels.

    Args:
        keys: Path of the agent in the configuration.
        rig: Its sensors.
        annotation: Its labels, unless they are another agent's.
        tick_hz: The tick rate.

    Raises:
        FieldError: A rate does not divide the tick rate and, for an IMU, is not a multiple of it.
    """
    allowed = _dividing_rates(tick_hz)
    for index, sensor in enumerate(rig.sensors):
        rate_hz = sensor.rate_hz
        if rate_hz is None or _is_whole(tick_hz / rate_hz):
            continue
        field = (*keys, "rig", "sensors", index)
        if not isinstance(sensor, Imu):
            raise FieldError(
                field,
                f"sensor {sensor.name}: rate_hz {rate_hz:g} does not divide the tick rate {tick_hz:g} Hz; "
                f"allowed are {allowed} (only an imu can be faster than the ticks){_remedy(rate_hz, tick_hz)}",
            )
        if not _is_whole(rate_hz / tick_hz):
            raise FieldError(
                field,
                f"sensor {sensor.name}: rate_hz {rate_hz:g} neither divides the tick rate {tick_hz:g} Hz nor "
                f"is a multiple of it; allowed are {allowed} and {2 * tick_hz:g}, {3 * tick_hz:g}, …",
            )
    if annotation is not None:
        _require_fitting_labels((*keys, "annotation"), annotation, tick_hz)


def _require_fitting_labels(keys: Keys, annotation: Annotation, tick_hz: float) -> None:
    """Check the rates of an agent's labels."""
    if annotation.rate_hz is not None:
        require_fitting_rate((*keys, "rate_hz"), annotation.rate_hz, tick_hz)
    for name in ("occupancy", "vector_map"):
        rate_hz = getattr(getattr(annotation, name), "rate_hz", None)
        if rate_hz is None:
            continue
        for base_hz, base in ((tick_hz, "the tick rate"), (annotation.rate_hz or tick_hz, "annotation.rate_hz")):
            is_faster = base_hz < tick_hz and _is_whole(rate_hz / base_hz)  # it is then made with all other labels
            if not _is_whole(base_hz / rate_hz) and not is_faster:
                raise FieldError(
                    (*keys, name),
                    f"rate_hz {rate_hz:g} does not divide {base} {base_hz:g} Hz; "
                    f"allowed are {_dividing_rates(base_hz)}",
                )


def require_fitting_rate(keys: Keys, rate_hz: float, base_hz: float, base: str = "the tick rate") -> None:
    """Check the rate of something that is made at some ticks.

    Args:
        keys: Path of the rate in the configuration.
        rate_hz: The rate.
        base_hz: The rate of what it is made of.
        base: Words for that rate.

    Raises:
        FieldError: It does not divide the other one.
    """
    if not _is_whole(base_hz / rate_hz):
        words = f"{rate_hz:g} does not divide {base} {base_hz:g} Hz; allowed are {_dividing_rates(base_hz)}"
        raise FieldError(keys, words)


def _is_whole(ratio: float) -> bool:
    return round(ratio) >= 1 and abs(ratio - round(ratio)) < 1e-6


def _remedy(rate_hz: float, tick_hz: float) -> str:
    """Text that names the tick with which both a sensor's rate and the tick rate divide, if there is one."""
    if not (_is_whole(rate_hz) and _is_whole(tick_hz)):
        return ""
    both_hz = math.lcm(round(rate_hz), round(tick_hz))
    is_tick = both_hz <= MAX_UNEVEN_HZ or 1000 % both_hz == 0
    return f"; with time.tick_s {1 / both_hz:.6g} both rates fit" if is_tick else ""


def _dividing_rates(tick_hz: float) -> str:
    """Text that lists the rates which divide the tick rate."""
    return f"{tick_hz:g}, {tick_hz / 2:g}, {tick_hz / 3:g}, …"
