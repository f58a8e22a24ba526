"""Targets of a radar as it is sold: scatterers in cells of range, speed and azimuth, spread, and detected over clutter.

The rays sample all surfaces evenly over solid angle. Each is a scatterer with the cross-section of the surface that it
stands for, and a phase of its own, so that the scatterers of a cell add up to speckle. A cell also hears its neighbors:
the spectrum's window (Hann's) spreads each scatterer over three cells in each dimension. A target is a cell that is the
greatest of its neighborhood and exceeds noise and clutter, the mean of the quieter side of the cells before and behind
it in range (smallest-of cell-averaging CFAR; Trunk 1978). Range, speed and azimuth are interpolated between cells, the
elevation is the scatterers' mean by power.
"""

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from simbev_ros.config.radar import Radar, RadarDetector
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.simulation.sensors.radar_amplitude import from_db

_GUARD_CELLS = 2
_TINY = 1e-30
MAX_CELLS = 1 << 23
"""Maximum number of cells of a spectrum; bounds the memory."""


class Scatterers(NamedTuple):
    """N scatterers.

    Attributes:
        power: (N,) received powers relative to 1 m² at the radar's reference range.
        range_m: (N,) ranges.
        speed_mps: (N,) radial speeds.
        azimuth_rad: (N,) azimuths.
        elevation_rad: (N,) elevations.
    """

    power: Float64Array
    range_m: Float64Array
    speed_mps: Float64Array
    azimuth_rad: Float64Array
    elevation_rad: Float64Array


def find_targets(radar: Radar, detector: RadarDetector, seen: Scatterers, rng: np.random.Generator) -> Scatterers:
    """The targets that the radar reports, nearest first; ``power`` is that of their cells."""
    assert radar.range_resolution_m is not None
    assert radar.doppler_resolution_mps is not None
    assert radar.azimuth_resolution_deg is not None
    cell = np.array([radar.range_resolution_m, radar.doppler_resolution_mps, np.radians(radar.azimuth_resolution_deg)])[
        :, None
    ]
    speed_mps = seen.speed_mps
    if (limit_mps := radar.max_doppler_mps) is not None:
        speed_mps = (speed_mps + limit_mps) % (2.0 * limit_mps) - limit_mps
    place = np.stack([seen.range_m, speed_mps, seen.azimuth_rad]) / cell
    low = np.floor(place.min(axis=1, initial=0.0)).astype(np.int64) - 2
    shape = np.ceil(place.max(axis=1, initial=0.0)).astype(np.int64) + 3 - low
    shape[1:] = np.minimum(shape[1:], max(1, int(MAX_CELLS // shape[0] // shape[2])), dtype=np.int64)
    power, elevation = _spectrum(seen, place - low[:, None], shape, rng)
    noise = from_db(np.array(detector.noise_dbsm))
    power = power + noise * rng.standard_exponential(power.shape)
    row = _detected(power, float(noise), detector)
    row = row[np.argsort(-power.ravel()[row], kind="stable")[: detector.max_targets]]
    at = np.stack(np.unravel_index(row, power.shape))
    found = (low[:, None] + _interpolated(power, at)) * cell
    order = np.argsort(found[0], kind="stable")
    return Scatterers(
        power.ravel()[row][order],
        np.maximum(found[0], 0.0)[order],
        found[1][order],
        found[2][order],
        elevation.ravel()[row][order],
    )


def _spectrum(
    seen: Scatterers, place: Float64Array, shape: Int64Array, rng: np.random.Generator
) -> tuple[Float64Array, Float64Array]:
    """Power of the cells, and the mean elevation of the scatterers in each."""
    amplitude = np.sqrt(seen.power) * np.exp(2j * np.pi * rng.random(len(seen.power)))
    nearest = np.rint(place).astype(np.int64)
    total = np.zeros(int(np.prod(shape)), complex)
    weight, tilt = np.zeros((2, total.size))
    for offsets in np.ndindex(3, 3, 3):
        index = nearest + np.array(offsets)[:, None] - 1
        window = np.prod(np.cos(np.pi / 4.0 * (place - index)) ** 2, axis=0)
        cell = np.ravel_multi_index(tuple(index), tuple(shape), mode="clip")
        part = amplitude * window
        total += np.bincount(cell, part.real, total.size) + 1j * np.bincount(cell, part.imag, total.size)
        weight += np.bincount(cell, seen.power * window**2, total.size)
        tilt += np.bincount(cell, seen.power * window**2 * seen.elevation_rad, total.size)
    power = np.square(np.abs(total)).reshape(shape)
    return power, (tilt / np.maximum(weight, _TINY)).reshape(shape)


def _detected(power: Float64Array, noise: float, detector: RadarDetector) -> Int64Array:
    """Indices of the cells that are targets."""
    width = detector.clutter_cells
    mean = ndimage.uniform_filter1d(power, width, axis=0, mode="nearest")
    reach = _GUARD_CELLS + 1 + width // 2
    before, behind = (np.roll(mean, shift, axis=0) for shift in (reach, -reach))
    clutter = np.minimum(before, behind)
    is_peak = power == ndimage.maximum_filter(power, 3, mode="nearest")
    return np.flatnonzero(is_peak & (power > from_db(np.array(detector.threshold_db)) * (noise + clutter)))


def _interpolated(power: Float64Array, at: Int64Array) -> Float64Array:
    """(3, M) places of peaks between cells: of the parabola through the logarithms of three cells."""
    place = at.astype(np.float64)
    for axis in range(3):
        sides = []
        for step in (-1, 1):
            index = at.copy()
            index[axis] = np.clip(index[axis] + step, 0, power.shape[axis] - 1)
            sides.append(np.log(power[tuple(index)] + _TINY))
        middle = np.log(power[tuple(at)] + _TINY)
        bend = sides[0] - 2.0 * middle + sides[1]
        shift = np.where(bend < 0.0, (sides[0] - sides[1]) / (2.0 * np.minimum(bend, -_TINY)), 0.0)
        place[axis] += np.clip(shift, -0.5, 0.5)
    return place
