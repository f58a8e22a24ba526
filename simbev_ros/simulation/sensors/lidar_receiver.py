"""The receiver of a lidar as it is sold: which echoes it detects, which of them it returns, and what it writes.

The power of an echo is its strength over the square of its range, less what the receiver does not see of the beam near
by. An echo is detected if its power exceeds the threshold, that of a matte surface of 10 % reflectance at
``range_at_10_percent_m``, which varies a little from pulse to pulse. Echoes that are closer together than a pulse
are one, at their mean range: points that hang between two surfaces.
"""

import numpy as np

from simbev_ros.config.lidar import Lidar, Receiver
from simbev_ros.foundation.types import BoolArray, Float32Array, Int64Array
from simbev_ros.simulation.sensors.lidar_beam import Echoes

_REFERENCE_REFLECTANCE = 0.1
_MAX_RETROREFLECTION = 785.0  # strength of the best sheeting, at which intensity is 1
_MIN_RANGE_M = 0.1
_MIN_POWER = 1e-12


class LidarReceiver:
    """The receiver of a lidar."""

    def __init__(self, lidar: Lidar, receiver: Receiver) -> None:
        """Create it as configured."""
        self._receiver, self._returns = receiver, lidar.returns
        self._range_sigma_m = lidar.range_noise_sigma_m
        self._min_range_m, self._max_range_m = max(lidar.min_range_m, _MIN_RANGE_M), lidar.range_m
        self._threshold = _REFERENCE_REFLECTANCE / receiver.range_at_10_percent_m**2

    def detect(self, echoes: Echoes, normal: Float32Array) -> tuple[Echoes, Float32Array]:
        """Those echoes that the lidar returns.

        Args:
            echoes: All echoes of N beams.
            normal: (N,) standard normal numbers, by which the threshold varies.

        Returns:
            M echoes by ray, nearer ones first, and (M,) their power divided by the threshold.
        """
        echoes = self._merged(echoes)
        ratio = self._power(echoes) / np.float32(self._threshold)
        excess_db = 10.0 * np.log10(np.maximum(ratio, _MIN_POWER)) + self._receiver.spread_db * normal[echoes.ray]
        is_detected = excess_db > 0.0
        is_detected &= (echoes.range_m >= self._min_range_m) & (echoes.range_m <= self._max_range_m)
        echoes, ratio = echoes.of(is_detected), ratio[is_detected]
        returned = self._returned(echoes.ray, ratio)
        return echoes.of(returned), ratio[returned]

    def measured_m(self, echoes: Echoes, ratio: Float32Array, normal: Float32Array) -> Float32Array:
        """(M,) ranges that the lidar measures; weak echoes are noisier. ``normal``: (M,) standard normal numbers."""
        weak_m = self._receiver.noise_at_threshold_m / np.sqrt(np.maximum(ratio, 1.0))
        measured_m = echoes.range_m + np.hypot(self._range_sigma_m, weak_m) * normal
        return np.maximum(measured_m, 0.0).astype(np.float32)

    def intensity(self, echoes: Echoes) -> Float32Array:
        """(M,) intensities 0..1 in the product's steps."""
        receiver = self._receiver
        if receiver.scale == "decibel":
            relative = self._power(echoes) * np.float32(receiver.reference_m**2)
            value: Float32Array = receiver.white + 10.0 * receiver.per_db * np.log10(np.maximum(relative, _MIN_POWER))
        else:
            strength = echoes.strength * self._seen_share(echoes.range_m)
            bright = np.log(np.maximum(strength, 1.0)) / np.log(_MAX_RETROREFLECTION)
            value = receiver.white * np.minimum(strength, 1.0) + (1.0 - receiver.white) * bright
        return (np.round(np.clip(value, 0.0, 1.0) * receiver.steps) / receiver.steps).astype(np.float32)

    def _power(self, echoes: Echoes) -> Float32Array:
        power: Float32Array = (
            echoes.strength * self._seen_share(echoes.range_m) / np.square(np.maximum(echoes.range_m, _MIN_RANGE_M))
        )
        return power

    def _seen_share(self, range_m: Float32Array) -> Float32Array:
        """(M,) shares of the beam that the receiver sees."""
        if self._receiver.near_field_m == 0.0:
            return np.ones(len(range_m), np.float32)
        share: Float32Array = -np.expm1(-np.square(range_m / np.float32(self._receiver.near_field_m)))
        return share

    def _merged(self, echoes: Echoes) -> Echoes:
        """Echoes by ray and range, those of one pulse joined."""
        order = np.lexsort((echoes.range_m, echoes.ray))
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
        """(M,) which of the detected echoes, by ray and range, the lidar returns."""
        is_last = np.append(ray[1:] != ray[:-1], True) if len(ray) else np.zeros(0, bool)
        if self._returns == "last":
            return is_last
        by_power = np.lexsort((-ratio, ray))
        starts = np.append(True, ray[1:] != ray[:-1]) if len(ray) else np.zeros(0, bool)
        returned = np.zeros(len(ray), bool)
        returned[by_power[starts]] = True
        if self._returns == "strongest":
            return returned
        # Where the strongest echo is the last one too, the second strongest comes beside it.
        second = np.append(False, starts[:-1]) & ~starts if len(ray) else starts
        strongest_is_last = returned & is_last
        twice = by_power[second]
        both = np.isin(ray[twice], ray[strongest_is_last])
        returned |= is_last
        returned[twice[both]] = True
        return returned
