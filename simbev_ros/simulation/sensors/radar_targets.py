"""Targets of a radar as it is sold: scatterers in cells of range, speed and azimuth, spread, and detected over clutter.

The rays sample all surfaces evenly over solid angle. Each is a scatterer with the cross-section of the surface that it
stands for, and a phase of its own, so that the scatterers of a cell add up to speckle. A cell also hears its neighbors:
the spectrum's window (Hann's) spreads each scatterer over four cells in each dimension. A target is a cell that is the
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
    power, elevation = _spectrum(seen, place - low[:, None], shape, rng)
    noise = from_db(np.array(detector.noise_dbsm))
    power = power + noise * rng.standard_exponential(power.shape)
    row = _detected(power, float(noise), detector)
    if (min_dbsm := detector.min_rcs_dbsm) is not None:
        range_m = (low[0] + np.unravel_index(row, power.shape)[0]) * radar.range_resolution_m
        row = row[
            power.ravel()[row] * np.square(np.square(range_m / radar.reference_range_m)) >= from_db(np.array(min_dbsm))
        ]
    row = row[np.argsort(-power.ravel()[row], kind="stable")[: detector.max_targets]]
    at = np.stack(np.unravel_index(row, power.shape))
    place, peak = _interpolated(power, at)
    found = (low[:, None] + place) * cell
    order = np.argsort(found[0], kind="stable")
    found[0] = np.maximum(found[0], 0.0)
    range_m, speed_mps, azimuth_rad = found[:, order]
    return Scatterers(peak[order], range_m, speed_mps, azimuth_rad, elevation.ravel()[row][order])


def _spectrum(
    seen: Scatterers, place: Float64Array, shape: Int64Array, rng: np.random.Generator
) -> tuple[Float64Array, Float64Array]:
    """Power of the cells, and the mean elevation of the scatterers in each."""
    amplitude = np.sqrt(seen.power) * np.exp(2j * np.pi * rng.random(len(seen.power)))
    index = np.floor(place).astype(np.int64)[:, None] + np.arange(-1, 3)[:, None]  # (3, 4, N): the main lobe
    window = np.cos(np.pi / 4.0 * (place[:, None] - index)) ** 2
    index = np.clip(index, 0, shape[:, None, None] - 1)
    cell = (index[0][:, None, None] * shape[1] + index[1][:, None]) * shape[2] + index[2]
    weight = (window[0][:, None, None] * window[1][:, None] * window[2]).ravel()
    cell = cell.ravel()
    count = int(np.prod(shape))

    def gathered(values: Float64Array) -> Float64Array:
        spread = np.broadcast_to(values, (4, 4, 4, len(values))).ravel() * weight
        return np.asarray(np.bincount(cell, spread, count), np.float64)

    power = np.square(gathered(amplitude.real)) + np.square(gathered(amplitude.imag))
    heard = gathered(seen.power)
    elevation = gathered(seen.power * seen.elevation_rad) / np.maximum(heard, _TINY)
    return power.reshape(shape), elevation.reshape(shape)


def _detected(power: Float64Array, noise: float, detector: RadarDetector) -> Int64Array:
    """Indices of the cells that are targets."""
    width = detector.clutter_cells
    mean = ndimage.uniform_filter1d(power, width, axis=0, mode="nearest")
    reach = _GUARD_CELLS + 1 + width // 2
    before, behind = (np.roll(mean, shift, axis=0) for shift in (reach, -reach))
    clutter = np.minimum(before, behind)
    is_peak = power == ndimage.maximum_filter(power, 3, mode="nearest")
    return np.flatnonzero(is_peak & (power > from_db(np.array(detector.threshold_db)) * (noise + clutter)))


def _interpolated(power: Float64Array, at: Int64Array) -> tuple[Float64Array, Float64Array]:
    """(3, M) places of peaks between cells and (M,) powers there, of parabolas through the logarithms of cells."""
    place, middle = at.astype(np.float64), np.log(power[tuple(at)] + _TINY)
    peak = middle.copy()
    for axis in range(3):
        sides = []
        for step in (-1, 1):
            index = at.copy()
            index[axis] = np.clip(index[axis] + step, 0, power.shape[axis] - 1)
            sides.append(np.log(power[tuple(index)] + _TINY))
        slope, bend = (sides[1] - sides[0]) / 2.0, np.minimum(sides[0] - 2.0 * middle + sides[1], -_TINY)
        shift = np.clip(-slope / bend, -0.5, 0.5)
        place[axis] += shift
        peak += slope * shift + bend * shift**2 / 2.0
    return place, np.exp(peak)
