"""The receiver of a lidar as it is sold: which echoes it detects, which of them it returns, and what it writes.

The power of an echo is its strength over the square of its range, less what the receiver does not see of the beam near
by, and varies from pulse to pulse and from channel to channel. An echo is detected if its power exceeds the threshold,
that of a matte surface of 10 % reflectance at ``range_at_10_percent_m``. Echoes that are closer together than a pulse
are one, at their mean range: points that hang between two surfaces.
"""

import numpy as np

from simbev_ros.config.lidar import Lidar, Receiver
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import BoolArray, Float32Array, Int64Array
from simbev_ros.simulation.sensors.lidar_beam import Echoes

_REFERENCE_REFLECTANCE = 0.1
_MAX_RETROREFLECTION = 785.0  # strength of the best sheeting, at which intensity is 1
_MIN_RANGE_M = 0.1
_NEGLIGIBLE = 0.05  # share of the threshold below which an echo does not even add to others
_MIN_POWER = 1e-12
_PER_DB = np.float32(np.log(10.0) / 10.0)


class LidarReceiver:
    """The receiver of a lidar."""

    def __init__(self, lidar: Lidar, receiver: Receiver) -> None:
        """Create it as configured."""
        self._receiver, self._returns = receiver, lidar.returns
        self._range_sigma_m = lidar.range_noise_sigma_m
        self._min_range_m, self._max_range_m = max(lidar.min_range_m, _MIN_RANGE_M), lidar.range_m
        self._channels = lidar.channels
        draws = stream(0, f"lidar.{lidar.preset or lidar.name}.channels").standard_exponential(lidar.channels)
        self._gain_db = (receiver.channel_spread_db * (1.0 - draws)).astype(np.float32)  # a few are much weaker
        self._threshold = _REFERENCE_REFLECTANCE / receiver.range_at_10_percent_m**2

    def detect(self, first: Echoes, others: Echoes, normal: Float32Array) -> tuple[Echoes, Float32Array]:
        """Those echoes that the lidar returns.

        Args:
            first: One echo of each of N beams, column by column; its strength is 0 for none.
            others: More echoes of these beams, in any order.
            normal: (N,) standard normal numbers, by which the beams' power varies.

        Returns:
            M echoes by ray, nearer ones first, and (M,) their power divided by the threshold.
        """
        gain = np.exp(_PER_DB * (self._receiver.spread_db * normal + np.resize(self._gain_db, len(normal))))
        first, others = first.times(gain), others.times(gain.take(others.ray))
        ratio = self._power_over_threshold(first)
        others = others.of(self._power_over_threshold(others) > _NEGLIGIBLE)
        is_one_of_many = np.zeros(len(normal), bool)
        is_one_of_many[others.ray] = True
        alone = np.flatnonzero(self._are_detected(first.range_m, ratio) & ~is_one_of_many)
        many = self._merged(Echoes.joined([first.of(is_one_of_many & (ratio > _NEGLIGIBLE)), others]))
        many_ratio = self._power_over_threshold(many)
        rows = np.flatnonzero(self._are_detected(many.range_m, many_ratio))
        rows = rows[self._returned(many.ray.take(rows), many_ratio.take(rows))]
        both = Echoes.joined([first.of(alone), many.of(rows)])
        order = np.argsort(both.ray, kind="stable")
        return both.of(order), np.concatenate([ratio.take(alone), many_ratio.take(rows)]).take(order)

    def _are_detected(self, range_m: Float32Array, ratio: Float32Array) -> BoolArray:
        """(M,) whether echoes at these ranges are detected, by their power divided by the threshold."""
        return (ratio > 1.0) & (range_m >= self._min_range_m) & (range_m <= self._max_range_m)

    def keeps(self, echoes: Echoes, ratio: Float32Array, uniform: Float32Array) -> BoolArray:
        """(M,) whether the gain has followed the power of detected echoes since the pulse before, of the same channel.

        The probability of loss is a logistic function of the rise in decibels.

        Args:
            echoes: Detected echoes of N beams, column by column.
            ratio: (M,) their power divided by the threshold.
            uniform: (N,) uniform random numbers.
        """
        step_db = self._receiver.gain_step_db
        if step_db is None:
            return np.ones(len(ratio), bool)
        level_db = np.full(len(uniform), np.nan, np.float32)
        level_db[echoes.ray] = 10.0 * np.log10(ratio)
        rise_db = np.full(len(uniform), np.nan, np.float32)
        rise_db[self._channels :] = level_db[self._channels :] - level_db[: -self._channels]
        lost_share = 1.0 / (1.0 + np.exp((step_db - rise_db) / self._receiver.gain_spread_db))
        kept: BoolArray = ~(uniform < lost_share)[echoes.ray]  # after a beam without an echo, gain is high enough
        return kept

    def measured_m(self, echoes: Echoes, ratio: Float32Array, normal: Float32Array) -> Float32Array:
        """(M,) ranges that the lidar measures; weak echoes are noisier. ``normal``: (M,) standard normal numbers."""
        weak_m = self._receiver.noise_at_threshold_m / np.sqrt(np.maximum(ratio, 1.0))
        measured_m = echoes.range_m + np.hypot(self._range_sigma_m, weak_m) * normal
        return np.maximum(measured_m, 0.0).astype(np.float32)

    def intensity(self, echoes: Echoes) -> Float32Array:
        """(M,) intensities 0..1 in the product's steps."""
        receiver = self._receiver
        if receiver.scale == "decibel":
            relative = self._power(echoes) * receiver.reference_m**2
            value = receiver.white + 10.0 * receiver.per_db * np.log10(np.maximum(relative, _MIN_POWER))
        else:
            strength = echoes.strength * self._seen_share(echoes.range_m)
            value = receiver.white * np.minimum(strength, 1.0)
            bright = np.flatnonzero(strength > 1.0)
            value[bright] += (1.0 - receiver.white) * np.log(strength[bright]) / np.log(_MAX_RETROREFLECTION)
        value = np.where(value < receiver.floor, 0.0, value)
        steps = np.round(np.clip(value, 0.0, 1.0) * receiver.steps)
        return (steps / receiver.steps).astype(np.float32)

    def _power_over_threshold(self, echoes: Echoes) -> Float32Array:
        return self._power(echoes) / np.float32(self._threshold)

    def _power(self, echoes: Echoes) -> Float32Array:
        range_m = np.maximum(echoes.range_m, np.float32(_MIN_RANGE_M))
        return (echoes.strength * self._seen_share(echoes.range_m) / np.square(range_m)).astype(np.float32)

    def _seen_share(self, range_m: Float32Array) -> Float32Array:
        """(M,) shares of the beam that the receiver sees."""
        if self._receiver.near_field_m == 0.0:
            return np.ones(len(range_m), np.float32)
        share: Float32Array = -np.expm1(-np.square(range_m / np.float32(self._receiver.near_field_m)))
        return share

    def _merged(self, echoes: Echoes) -> Echoes:
        """Echoes by ray and range, those of one pulse joined."""
        order = np.argsort(_sort_key(echoes.ray, echoes.range_m), kind="stable")
        echoes = echoes.of(order)
        starts = np.ones(len(order), bool)
        starts[1:] = (np.diff(echoes.ray) != 0) | (np.diff(echoes.range_m) > self._receiver.pulse_m)
        first = np.flatnonzero(starts)
        if len(first) == len(order):
            return echoes
        strength = np.add.reduceat(echoes.strength, first)
        range_m = np.add.reduceat(echoes.range_m * echoes.strength, first) / np.maximum(strength, _MIN_POWER)
        alone = np.diff(np.append(first, len(order))) == 1
        range_m[alone] = echoes.range_m[first[alone]]
        return Echoes(echoes.ray[first], range_m.astype(np.float32), strength)

    def _returned(self, ray: Int64Array, ratio: Float32Array) -> BoolArray:
        """(M,) which of the detected echoes, by ray and range, the lidar returns.

        Where the strongest echo is the last one, too, dual returns have the second strongest beside it.
        """
        if not len(ray):
            return np.zeros(0, bool)
        is_first, is_last = np.append(True, ray[1:] != ray[:-1]), np.append(ray[1:] != ray[:-1], True)
        if self._returns == "last":
            return is_last
        by_power = np.argsort(_sort_key(ray, 1.0 / ratio), kind="stable")  # is_first holds in this order, too
        returned = np.zeros(len(ray), bool)
        returned[by_power[is_first]] = True
        if self._returns == "dual":
            second = by_power[np.append(False, is_first[:-1]) & ~is_first]
            strongest_is_last = ray[returned & is_last]
            returned |= is_last
            returned[second[np.isin(ray[second], strongest_is_last)]] = True
        return returned


def _sort_key(ray: Int64Array, value: Float32Array) -> Int64Array:
    """(M,) numbers that are in order of rays, then of positive values, whose bits are in the same order."""
    return (ray << 32) | np.maximum(value, np.float32(0.0)).astype(np.float32).view(np.int32)
