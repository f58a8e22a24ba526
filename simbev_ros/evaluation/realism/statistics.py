"""Figures that tell real sensors from simulated ones: of lidar turns, images and radar scans."""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from simbev_ros.evaluation.realism.samples import LidarTurn, Photograph, RadarScan, Sample
from simbev_ros.foundation.types import AnyArray, Float32Array, Float64Array, UInt8Array

RANGES_M = (0, 10, 20, 40, 80)
INCIDENCES_DEG = (0, 30, 60, 75, 85)
_NEAR_GROUND_DEG, _NEAR_M = (-25.0, -5.0), 40.0
_MIN_IN_RING = 100
_MAX_RING_DEG = 4.0
_SATURATED = 0.99
_MAX_STEP_M = 0.1
_MAX_ALONG_M, _MAX_ACROSS_M = 0.5, 3.0
_CLIPPED, _BLACK = 252, 3
_LUMA = np.array([0.299, 0.587, 0.114])
_MIN_IN_BIN = 20
_SPECTRUM_WIDTH_PX, _MIN_LINES = 800, 16
_NYQUIST_SHARES = (0.5, 0.95)
_BLOCK_PX = 8
_FLAT_SHARE = 0.1
_TO_SIGMA = 1.4826

Figures = dict[str, float]


class Curve(NamedTuple):
    """A curve of one sensor: (N,) values over (N,) positions, the same for all sensors of its kind.

    Attributes:
        x: Positions.
        y: Values; NaN where nothing is known.
        x_label: Quantity of the positions, with its unit.
        y_label: Quantity of the values, with its unit.
        is_log: Whether values are read on a logarithmic axis.
    """

    x: Float64Array
    y: Float64Array
    x_label: str
    y_label: str
    is_log: bool = False


def figures_of(samples: Sequence[Sample]) -> Figures:
    """The figures of all samples of one sensor, by name with unit."""
    return _FIGURES[type(samples[0])](samples)


def curves_of(samples: Sequence[Sample]) -> dict[str, Curve]:
    """The curves of all samples of one sensor, by title."""
    return _CURVES[type(samples[0])](samples)


def _lidar_figures(turns: Sequence[LidarTurn]) -> Figures:
    intensity = np.concatenate([turn.intensity for turn in turns]).astype(np.float64)
    range_m = np.concatenate([np.linalg.norm(turn.xyz_m, axis=1) for turn in turns])
    incidence_deg = np.concatenate([_incidence_deg(turn) for turn in turns])
    lost, runs, noise_m = zip(*map(_ring_figures, turns), strict=True)
    figures = {
        "rays without return [%]": 100.0 * _mean([_share_without_return(turn) for turn in turns]),
        "returns lost near by [%]": 100.0 * _mean(lost),
        "lost returns in a row": _mean(runs),
        "steps of intensity": float(len(np.unique(intensity[:200_000]))),
        "intensity of 0 [%]": 100.0 * float(np.mean(intensity == 0.0)),
        "retroreflectors [%]": 100.0 * float(np.mean(intensity >= _SATURATED)),
        "noise of range on planes [mm]": 1000.0 * _mean(noise_m),
    }
    for share in (25, 50, 75):
        figures[f"intensity, {share}th percentile"] = float(np.percentile(intensity, share))
    for low_m, high_m in pairwise(RANGES_M):
        there = (range_m >= low_m) & (range_m < high_m)
        figures[f"intensity from {low_m} to {high_m} m"] = float(intensity[there].mean()) if there.any() else np.nan
    for low_deg, high_deg in pairwise(INCIDENCES_DEG):
        there = (incidence_deg >= low_deg) & (incidence_deg < high_deg)
        figures[f"intensity at incidences of {low_deg} to {high_deg} deg"] = (
            float(intensity[there].mean()) if np.count_nonzero(there) >= _MIN_IN_BIN else np.nan
        )
    return figures


def _share_without_return(turn: LidarTurn) -> float:
    """Share of rays that do not return, if all channels fire as often as the one with the most returns has."""
    counts = np.bincount(turn.ring)
    if not any(_is_ring(turn.xyz_m[turn.ring == ring]) for ring in np.flatnonzero(counts >= _MIN_IN_RING)):
        return np.nan
    return 1.0 - len(turn.ring) / (counts.max() * (turn.ring.max() + 1.0))


def _losses_by_elevation(turns: Sequence[LidarTurn], edges_deg: Float64Array) -> Float64Array:
    """Shares in % of the rays without return of channels between elevations; NaN where channels are lacking."""
    elevation_deg, lost = [], []
    for turn in turns:
        counts = np.bincount(turn.ring)
        for ring in np.flatnonzero(counts >= _MIN_IN_RING):
            xyz_m = turn.xyz_m[turn.ring == ring]
            if _is_ring(xyz_m):
                elevation = np.arctan2(xyz_m[:, 2], np.hypot(xyz_m[:, 0], xyz_m[:, 1]))
                elevation_deg.append(float(np.degrees(np.median(elevation))))
                lost.append(100.0 * (1.0 - counts[ring] / counts.max()))
    return _means(np.array(lost), np.array(elevation_deg), edges_deg, least=1)


def _is_ring(xyz_m: Float32Array | Float64Array) -> bool:
    """Whether the points of a channel have one elevation, unlike those of lidars whose channels swing."""
    elevation_deg = np.degrees(np.arctan2(xyz_m[:, 2], np.hypot(xyz_m[:, 0], xyz_m[:, 1])))
    return bool(np.ptp(np.percentile(elevation_deg, (10, 90))) < _MAX_RING_DEG)


def _incidence_deg(turn: LidarTurn) -> Float64Array:
    """(N,) angles between rays and the normals of surfaces; NaN where neighbors are far.

    A normal is that of the triangle of a point, the next one of its channel, and the next one of the channel above.
    """
    xyz_m = turn.xyz_m.astype(np.float64)
    range_m = np.linalg.norm(xyz_m, axis=1)
    azimuth = np.arctan2(xyz_m[:, 1], xyz_m[:, 0])
    channels = [np.flatnonzero(turn.ring == ring) for ring in np.unique(turn.ring)]
    channels = [
        rows[np.argsort(azimuth[rows])] for rows in channels if len(rows) >= _MIN_IN_RING and _is_ring(xyz_m[rows])
    ]
    channels.sort(key=lambda rows: float(np.median(xyz_m[rows, 2] / np.maximum(range_m[rows], 1e-6))))
    angle_deg = np.full(len(xyz_m), np.nan)
    for rows, above in pairwise(channels):
        along_m = xyz_m[np.roll(rows, -1)] - xyz_m[rows]
        across_m = xyz_m[above[np.searchsorted(azimuth[above], azimuth[rows]) % len(above)]] - xyz_m[rows]
        normal = np.cross(along_m, across_m)
        length = np.linalg.norm(normal, axis=1)
        near = (np.linalg.norm(along_m, axis=1) < _MAX_ALONG_M) & (np.linalg.norm(across_m, axis=1) < _MAX_ACROSS_M)
        near &= length > 0.0
        cosine = np.abs(np.einsum("ni,ni->n", normal, xyz_m[rows]))[near] / (length * range_m[rows])[near]
        angle_deg[rows[near]] = np.degrees(np.arccos(np.minimum(cosine, 1.0)))
    return angle_deg


def _ring_figures(turn: LidarTurn) -> tuple[float, float, float]:
    """Share of returns lost in the channels that look at near ground, their mean run, and the noise of ranges."""
    range_m = np.linalg.norm(turn.xyz_m, axis=1)
    elevation_deg = np.degrees(np.arcsin(turn.xyz_m[:, 2] / np.maximum(range_m, 1e-6)))
    azimuth = np.arctan2(turn.xyz_m[:, 1], turn.xyz_m[:, 0])
    lost, runs, noise_m = [], [], []
    for ring in np.unique(turn.ring):
        rows = np.flatnonzero(turn.ring == ring)
        middle_deg = np.median(elevation_deg[rows])
        if len(rows) < _MIN_IN_RING or not _NEAR_GROUND_DEG[0] <= middle_deg <= _NEAR_GROUND_DEG[1]:
            continue
        if not _is_ring(turn.xyz_m[rows]):
            continue
        rows = rows[np.argsort(azimuth[rows], kind="stable")]
        step = np.diff(azimuth[rows])
        spacing = np.median(step)
        if spacing <= 0.0 or np.median(range_m[rows]) > _NEAR_M:
            continue
        gaps = np.round(step / spacing) - 1.0
        gaps = gaps[(gaps > 0.0) & (step < np.radians(20.0))]  # wider ones are the vehicle's own body
        lost.append(gaps.sum() / (gaps.sum() + len(rows)))
        runs.append(gaps.mean() if len(gaps) else np.nan)
        along_m = range_m[rows]
        bend_m = (along_m[1:-1] - (along_m[:-2] + along_m[2:]) / 2.0)[
            (step[:-1] < 1.5 * spacing) & (step[1:] < 1.5 * spacing)
        ]
        bend_m = bend_m[np.abs(bend_m) < _MAX_STEP_M]
        noise_m.append(_TO_SIGMA * np.median(np.abs(bend_m)) / np.sqrt(1.5) if len(bend_m) else np.nan)
    return _mean(lost), _mean(runs), _mean(noise_m)


def _image_figures(images: Sequence[Photograph]) -> Figures:
    rows = [_figures_of_image(image.rgb) for image in images]
    return {name: _mean([row[name] for row in rows]) for name in rows[0]}


def _figures_of_image(rgb: UInt8Array) -> Figures:
    gray = rgb.astype(np.float64) @ _LUMA
    high, low = rgb.max(axis=2).astype(np.float64), rgb.min(axis=2)
    saturation = np.where(high > 0.0, 255.0 * (high - low) / np.maximum(high, 1.0), 0.0)
    noise = _flat_noise(gray)
    return {
        "pixels above 252 [%]": 100.0 * float(np.mean(gray > _CLIPPED)),
        "black pixels [%]": 100.0 * float(np.mean(gray <= _BLACK)),
        "mean brightness [0-255]": float(gray.mean()),
        "contrast [0-255]": float(gray.std()),
        "mean saturation [0-255]": float(saturation.mean()),
        "slope of the spectrum near Nyquist": _spectral_slope(gray),
        "noise in flat dark areas [0-255]": noise[0],
        "noise in flat bright areas [0-255]": noise[1],
    }


def _spectral_slope(gray: Float64Array) -> float:
    """Exponent of the power over the frequency from half of Nyquist's frequency on."""
    share, power = _spectrum(gray)
    there = (share > _NYQUIST_SHARES[0]) & (share < _NYQUIST_SHARES[1])
    return float(np.polyfit(np.log(share[there]), np.log(power[there] + 1e-9), 1)[0])


def _spectrum(gray: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Shares of Nyquist's frequency above 0, and the power of lines in both directions there, at about 800 pixels."""
    factor = max(1, min(round(gray.shape[1] / _SPECTRUM_WIDTH_PX), min(gray.shape) // _MIN_LINES))
    rows, columns = (length // factor * factor for length in gray.shape)
    small = gray[:rows, :columns].reshape(rows // factor, factor, columns // factor, factor).mean(axis=(1, 3))
    shares, level = np.linspace(0.01, 1.0, 200), np.zeros(200)
    for lines in (small, small.T):
        waves = np.fft.rfft((lines - lines.mean(axis=1, keepdims=True)) * np.hanning(lines.shape[1]), axis=1)
        power = np.square(np.abs(waves)).mean(axis=0) / lines.shape[1]
        level += np.log(np.interp(shares, np.linspace(0.0, 1.0, len(power)), power) + 1e-12) / 2.0
    return shares, np.exp(level)


def _flat_noise(gray: Float64Array) -> tuple[float, float]:
    """Standard deviation of single pixels in the flattest blocks of the darker and of the brighter half."""
    noise, mean = _blocks(gray)
    if len(mean) < 2.0 / _FLAT_SHARE:
        return np.nan, np.nan
    halves = (noise[mean <= np.median(mean)], noise[mean > np.median(mean)])
    dark, light = (float(np.quantile(half, _FLAT_SHARE)) if len(half) else np.nan for half in halves)
    return dark, light


def _noise_by_brightness(gray: Float64Array, edges: Float64Array) -> Float64Array:
    """Standard deviations of single pixels in the flattest blocks between edges of brightness; NaN where few are."""
    noise, mean = _blocks(gray)
    groups = [noise[(mean >= low) & (mean < high)] for low, high in pairwise(edges)]
    enough = 2.0 / _FLAT_SHARE
    return np.array([np.quantile(group, _FLAT_SHARE) if len(group) >= enough else np.nan for group in groups])


def _blocks(gray: Float64Array) -> tuple[Float64Array, Float64Array]:
    """(N,) standard deviations of single pixels in blocks and (N,) their brightness, without black and clipped ones."""
    detail = np.abs(np.diff(np.diff(gray, 2, axis=0), 2, axis=1)) / 6.0  # Immerkær 1996
    gray = gray[1:-1, 1:-1]
    rows, columns = (length // _BLOCK_PX for length in gray.shape)
    shape = rows, _BLOCK_PX, columns, _BLOCK_PX
    part = slice(rows * _BLOCK_PX), slice(columns * _BLOCK_PX)
    blocks, bright = (array[part].reshape(shape).swapaxes(1, 2).reshape(-1, _BLOCK_PX**2) for array in (detail, gray))
    mean = bright.mean(axis=1)
    usable = (mean > 8.0) & (mean < 245.0)
    return np.sqrt(np.pi / 2.0) * blocks[usable].mean(axis=1), mean[usable]


def _mean(values: Sequence[float]) -> float:
    """Mean of the finite values; NaN if there is none."""
    finite = [value for value in values if np.isfinite(value)]
    return float(np.mean(finite)) if finite else np.nan


def _lidar_curves(turns: Sequence[LidarTurn]) -> dict[str, Curve]:
    intensity = np.concatenate([turn.intensity for turn in turns]).astype(np.float64)
    xyz_m = np.concatenate([turn.xyz_m for turn in turns]).astype(np.float64)
    range_m = np.linalg.norm(xyz_m, axis=1)
    elevation_deg = np.degrees(np.arcsin(xyz_m[:, 2] / np.maximum(range_m, 1e-6)))
    incidence_deg = np.concatenate([_incidence_deg(turn) for turn in turns])
    steps, ranges_m, angles_deg = np.linspace(0.0, 1.0, 65), np.arange(0.0, 101.0, 4.0), np.arange(-30.0, 16.0, 1.0)
    right_angles_deg = np.arange(0.0, 91.0, 3.0)
    per_deg = np.histogram(elevation_deg, angles_deg)[0] / len(turns)
    return {
        "Intensities": Curve(_middles(steps), _shares(intensity, steps), "intensity", "share [%]", is_log=True),
        "Intensity over range": Curve(
            _middles(ranges_m), _means(intensity, range_m, ranges_m), "range [m]", "mean intensity"
        ),
        "Intensity over incidence": Curve(
            _middles(right_angles_deg),
            _means(intensity, incidence_deg, right_angles_deg),
            "angle to the normal [deg]",
            "mean intensity",
        ),
        "Intensity over elevation": Curve(
            _middles(angles_deg), _means(intensity, elevation_deg, angles_deg), "elevation [deg]", "mean intensity"
        ),
        "Ranges": Curve(_middles(ranges_m), _shares(range_m, ranges_m), "range [m]", "share [%]", is_log=True),
        "Losses by elevation of channels": Curve(
            _middles(angles_deg[::2]),
            _losses_by_elevation(turns, angles_deg[::2]),
            "elevation [deg]",
            "without return [%]",
        ),
        "Points by elevation": Curve(_middles(angles_deg), per_deg, "elevation [deg]", "points a turn and degree"),
    }


def _image_curves(images: Sequence[Photograph]) -> dict[str, Curve]:
    edges, shares, grays_of_noise = np.arange(0.0, 257.0, 4.0), np.linspace(0.02, 1.0, 50), np.arange(0.0, 257.0, 16.0)
    grays = [image.rgb.astype(np.float64) @ _LUMA for image in images]
    spectra = [np.interp(shares, *_spectrum(gray)) for gray in grays]
    level = np.mean([np.log(spectrum / spectrum[0]) for spectrum in spectra], axis=0)
    counts = np.mean([_shares(gray.ravel(), edges) for gray in grays], axis=0)
    noises = np.transpose([_noise_by_brightness(gray, grays_of_noise) for gray in grays])
    return {
        "Brightness": Curve(_middles(edges), counts, "gray level", "share [%]", is_log=True),
        "Spectrum": Curve(shares, np.exp(level), "share of Nyquist's frequency", "power", is_log=True),
        "Noise over brightness": Curve(
            _middles(grays_of_noise), np.array([_mean(row) for row in noises]), "gray level", "noise in flat areas"
        ),
    }


def _radar_curves(scans: Sequence[RadarScan]) -> dict[str, Curve]:
    edges = np.arange(-45.0, 46.0, 3.0)
    rcs = np.concatenate([scan.rcs_dbsm for scan in scans])
    return {"Cross-sections": Curve(_middles(edges), _shares(rcs, edges), "cross-section [dBsm]", "share [%]")}


def _middles(edges: Float64Array) -> Float64Array:
    return (edges[1:] + edges[:-1]) / 2.0


def _shares(values: AnyArray, edges: Float64Array) -> Float64Array:
    """Percentages of values in the bins between edges."""
    return 100.0 * np.histogram(values, edges)[0] / max(len(values), 1)


def _means(
    values: Float64Array, positions: Float64Array, edges: Float64Array, least: int = _MIN_IN_BIN
) -> Float64Array:
    """Means of the values in the bins between edges of their positions; NaN where there are few."""
    count = np.histogram(positions, edges)[0]
    total = np.histogram(positions, edges, weights=values)[0]
    return np.where(count >= least, total / np.maximum(count, 1), np.nan)


def _radar_figures(scans: Sequence[RadarScan]) -> Figures:
    rcs = np.concatenate([scan.rcs_dbsm for scan in scans])
    figures = {"detections a scan": float(np.mean([len(scan.rcs_dbsm) for scan in scans]))}
    for share in (5, 50, 95):
        figures[f"cross-section, {share}th percentile [dBsm]"] = (
            float(np.percentile(rcs, share)) if len(rcs) else np.nan
        )
    return figures


_FIGURES: Mapping[type, Callable[..., Figures]] = {
    LidarTurn: _lidar_figures,
    Photograph: _image_figures,
    RadarScan: _radar_figures,
}
_CURVES: Mapping[type, Callable[..., dict[str, Curve]]] = {
    LidarTurn: _lidar_curves,
    Photograph: _image_curves,
    RadarScan: _radar_curves,
}
