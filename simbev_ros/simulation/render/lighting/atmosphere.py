"""Scattered sunlight: radiance of the clear sky and color of the sun, computed from the physics of the atmosphere.

The sun's altitude enters, linear RGB radiances and transmittances leave; ``light`` builds the light of a frame from
them. Model: Bruneton and Neyret 2008, Hillaire 2020 (ozone; multiple scattering as a geometric series of an isotropic
second order). The coefficients are those at 615, 535 and 445 nm, which stand for linear sRGB. Radiances are relative to
a sun of irradiance 1 outside the atmosphere. Heights and lengths are in kilometers.
"""

from functools import lru_cache

import numpy as np

from simbev_ros.foundation.types import Float64Array

GROUND_KM, TOP_KM = 6360.0, 6460.0
"""Radii of the Earth and of the top of its atmosphere."""

RAYLEIGH_PER_KM = np.array([8.67e-3, 15.14e-3, 31.6e-3])
MIE_SCATTERING_PER_KM = np.array([0.079, 0.094, 0.118])
"""Aerosols near towns on a clear day: optical depth 0.12, Ångstrom exponent 1.3."""
MIE_EXTINCTION_PER_KM = MIE_SCATTERING_PER_KM / 0.93
OZONE_PER_KM = np.array([2.30e-3, 1.45e-3, 0.085e-3])
RAYLEIGH_SCALE_KM, MIE_SCALE_KM = 8.0, 1.2

_MIE_FORWARD = 0.76
_GROUND_ALBEDO = 0.15
_EYE_KM = 0.02
_STEPS = 40
_LUT_HEIGHTS, _LUT_COSINES = 48, 96
_ENTRIES_AT_ONCE = 6
"""Number of entries with samples that fit into a core's cache; all at once take up to three times as long."""
_ELEVATIONS, _AZIMUTHS = 40, 33
_NODES_DEG = np.array(
    [-20, -16, -13, -11, -9, -7.5, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4.5, 6, 8, 11, 15, 20, 27, 35, 45, 60, 75, 90.0]
)
_MIN_RADIANCE = 1e-12


def sun_transmittance(altitude_deg: float) -> Float64Array:
    """(3,) share of sunlight that reaches the ground; it fades while the sun's disk sinks below the horizon."""
    risen = np.clip((altitude_deg + 0.8) / 1.2, 0.0, 1.0)
    cosine = np.sin(np.radians(max(altitude_deg, -0.5)))
    return _transmittance(np.array(GROUND_KM + _EYE_KM), np.array(max(cosine, -0.002))) * risen


def clear_sky(altitude_deg: float, elevation_deg: Float64Array, azimuth_deg: Float64Array) -> Float64Array:
    """(..., 3) radiance of the sky by elevation and by azimuth relative to the sun, for an altitude of the sun."""
    altitude_deg = float(np.clip(altitude_deg, _NODES_DEG[0], _NODES_DEG[-1]))
    upper = int(np.clip(np.searchsorted(_NODES_DEG, altitude_deg), 1, len(_NODES_DEG) - 1))
    low_deg, high_deg = _NODES_DEG[upper - 1], _NODES_DEG[upper]
    share = (altitude_deg - low_deg) / (high_deg - low_deg)
    table = np.exp(_log_radiance(float(low_deg)) * (1.0 - share) + _log_radiance(float(high_deg)) * share)
    row = np.sqrt(np.clip(elevation_deg, 0.0, 90.0) / 90.0) * (_ELEVATIONS - 1)
    angle_deg = np.abs((np.asarray(azimuth_deg) + 180.0) % 360.0 - 180.0)
    return _interpolate(table, row, np.sqrt(angle_deg / 180.0) * (_AZIMUTHS - 1))


@lru_cache(maxsize=len(_NODES_DEG))
def _log_radiance(altitude_deg: float) -> Float64Array:
    """(elevations, azimuths, 3) logarithm of the sky's radiance; both axes are spaced by the square of the angle."""
    elevation = np.linspace(0.0, 1.0, _ELEVATIONS)[:, None] ** 2 * (np.pi / 2)
    azimuth = np.linspace(0.0, 1.0, _AZIMUTHS)[None, :] ** 2 * np.pi
    altitude = np.radians(altitude_deg)
    sun_cosine = np.cos(elevation) * np.cos(azimuth) * np.cos(altitude) + np.sin(elevation) * np.sin(altitude)
    across = np.broadcast_to(np.sin(elevation), sun_cosine.shape)
    radiance = _scattered_light(across, sun_cosine, np.sin(altitude), GROUND_KM + _EYE_KM)
    return np.log(radiance + _MIN_RADIANCE)


def _scattered_light(up: Float64Array, sun_cosine: Float64Array, sun_up: float, radius_km: float) -> Float64Array:
    """(..., 3) light scattered into rays from a radius, given their cosines with the vertical and with the sun."""
    length_km = _length_to_top(radius_km, up)
    near, far = np.linspace(0.0, 1.0, _STEPS + 1)[:-1] ** 2, np.linspace(0.0, 1.0, _STEPS + 1)[1:] ** 2
    along_km = length_km[..., None] * (near + far) / 2.0
    step_km = (length_km[..., None] * (far - near))[..., None]
    sample_radius_km = np.sqrt(radius_km**2 + along_km**2 + 2.0 * radius_km * up[..., None] * along_km)
    sample_sun_cosine = (radius_km * sun_up + sun_cosine[..., None] * along_km) / sample_radius_km
    rayleigh, mie, extinction = _medium(sample_radius_km - GROUND_KM)
    optical = extinction * step_km
    transmittance = np.exp(-(np.cumsum(optical, axis=-2) - optical))
    from_sun = _lookup(_transmittance_lut(), sample_radius_km, sample_sun_cosine)
    phase_rayleigh, phase_mie = _phases(sun_cosine[..., None, None])
    source = from_sun * (rayleigh * phase_rayleigh + mie * phase_mie)
    source += (rayleigh + mie) * _lookup(_multiple_lut(), sample_radius_km, sample_sun_cosine)
    share: Float64Array = (1.0 - np.exp(-optical)) / np.maximum(extinction, 1e-12)
    return np.sum(transmittance * source * share, axis=-2)


def _phases(cosine: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Phase functions of molecules and of aerosols (Cornette-Shanks)."""
    g = _MIE_FORWARD
    rayleigh = 3.0 / (16.0 * np.pi) * (1.0 + cosine**2)
    shape = (1.0 - g * g) * (1.0 + cosine**2) / ((2.0 + g * g) * (1.0 + g * g - 2.0 * g * cosine) ** 1.5)
    return rayleigh, 3.0 / (8.0 * np.pi) * shape


def _medium(height_km: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    """(..., 3) scattering by molecules, scattering by aerosols, and extinction, per kilometer."""
    height_km = np.maximum(height_km, 0.0)[..., None]
    rayleigh = RAYLEIGH_PER_KM * np.exp(-height_km / RAYLEIGH_SCALE_KM)
    aerosols = np.exp(-height_km / MIE_SCALE_KM)
    ozone = OZONE_PER_KM * np.maximum(1.0 - np.abs(height_km - 25.0) / 15.0, 0.0)
    return rayleigh, MIE_SCATTERING_PER_KM * aerosols, rayleigh + MIE_EXTINCTION_PER_KM * aerosols + ozone


def _length_to_top(radius_km: Float64Array | float, cosine: Float64Array) -> Float64Array:
    """Length of rays from a radius to the top of the atmosphere."""
    root = np.sqrt(np.maximum((radius_km * cosine) ** 2 + TOP_KM**2 - np.square(radius_km), 0.0))
    return root - radius_km * cosine


def _transmittance(radius_km: Float64Array, cosine: Float64Array) -> Float64Array:
    """(..., 3) share of light that enters from outside along rays, integrated numerically; 0 through the Earth."""
    share = ((np.arange(_STEPS) + 0.5) / _STEPS) ** 2
    width = 2.0 * np.sqrt(share) / _STEPS
    length_km = _length_to_top(radius_km, cosine)[..., None]
    along_km = length_km * share
    sample_radius_km = np.sqrt(
        radius_km[..., None] ** 2 + along_km**2 + 2.0 * (radius_km * cosine)[..., None] * along_km
    )
    depth = np.sum(_medium(sample_radius_km - GROUND_KM)[2] * (length_km * width)[..., None], axis=-2)
    horizon = -np.sqrt(np.maximum(1.0 - (GROUND_KM / radius_km) ** 2, 0.0))
    above = np.clip((cosine - horizon) / 0.008 + 0.5, 0.0, 1.0)  # the sun's disk is half a degree wide
    return np.exp(-depth) * above[..., None]


@lru_cache(maxsize=1)
def _transmittance_lut() -> Float64Array:
    """(heights, cosines, 3) lookup table of ``_transmittance``."""
    return _transmittance(*_lut_axes())


@lru_cache(maxsize=1)
def _multiple_lut() -> Float64Array:
    """(heights, cosines, 3) light of all scattering orders from the second, per scattering coefficient."""
    radius_km, sun_up = (axis[::4, ::4] for axis in _lut_axes())
    count = 64
    up = 1.0 - 2.0 * (np.arange(count) + 0.5) / count  # points on a spiral over the sphere
    turn = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    side = np.sqrt(1.0 - sun_up[..., None] ** 2)
    sun_cosine = up * sun_up[..., None] + np.sqrt(1.0 - up**2) * np.cos(turn) * side
    coarse = np.empty((*radius_km.shape, 3))
    for entries in np.array_split(np.arange(radius_km.size), radius_km.size // _ENTRIES_AT_ONCE):
        at = np.unravel_index(entries, radius_km.shape)
        second, share = _second_order(radius_km[at], up, sun_cosine[at], sun_up[at])
        coarse[at] = second / (1.0 - share)
    rows = np.linspace(0.0, coarse.shape[0] - 1.0, _LUT_HEIGHTS)[:, None]
    columns = np.linspace(0.0, coarse.shape[1] - 1.0, _LUT_COSINES)[None, :]
    return _interpolate(coarse, *np.broadcast_arrays(rows, columns))


def _second_order(
    radius_km: Float64Array, up: Float64Array, sun_cosine: Float64Array, sun_up: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Means over all directions: light scattered once or by the ground, and the share that is scattered again."""
    radius_km = radius_km[..., None]
    root = (radius_km * up) ** 2 + GROUND_KM**2 - radius_km**2
    down = (up < 0.0) & (root > 0.0)
    to_ground_km = -radius_km * up - np.sqrt(np.maximum(root, 0.0))
    length_km = np.where(down, to_ground_km, _length_to_top(radius_km, np.broadcast_to(up, down.shape)))
    steps = (np.arange(_STEPS) + 0.5) / _STEPS
    along_km = length_km[..., None] * steps
    sample_radius_km = np.sqrt(radius_km[..., None] ** 2 + along_km**2 + 2.0 * (radius_km * up)[..., None] * along_km)
    sample_sun_cosine = (
        (radius_km * sun_up[..., None])[..., None] + sun_cosine[..., None] * along_km
    ) / sample_radius_km
    rayleigh, mie, extinction = _medium(sample_radius_km - GROUND_KM)
    optical = extinction * (length_km / _STEPS)[..., None, None]
    transmitted = np.exp(-(np.cumsum(optical, axis=-2) - optical / 2.0)) * (length_km / _STEPS)[..., None, None]
    scattering = transmitted * (rayleigh + mie)
    single_scattering = np.sum(
        scattering * _lookup(_transmittance_lut(), sample_radius_km, sample_sun_cosine), axis=-2
    ) / (4.0 * np.pi)
    ground_sun = np.clip(sample_sun_cosine[..., -1:], 0.0, 1.0)
    ground = _lookup(_transmittance_lut(), np.full(down.shape, GROUND_KM), sample_sun_cosine[..., -1]) * ground_sun
    single_scattering += np.exp(-optical.sum(axis=-2)) * ground * (_GROUND_ALBEDO / np.pi) * down[..., None]
    return single_scattering.mean(axis=-2), scattering.sum(axis=-2).mean(axis=-2)


def _lut_axes() -> tuple[Float64Array, Float64Array]:
    """(heights, cosines) radii and cosines of the table entries; finer near the ground and near the horizon."""
    height = np.linspace(0.0, 1.0, _LUT_HEIGHTS) ** 2 * (TOP_KM - GROUND_KM)
    root = np.linspace(-1.0, 1.0, _LUT_COSINES)
    radius, cosine = np.meshgrid(GROUND_KM + height, np.sign(root) * root**2, indexing="ij")
    return radius, cosine


def _lookup(lut: Float64Array, radius_km: Float64Array, cosine: Float64Array) -> Float64Array:
    """(..., 3) interpolated values of a table."""
    row = np.sqrt(np.clip((radius_km - GROUND_KM) / (TOP_KM - GROUND_KM), 0.0, 1.0)) * (_LUT_HEIGHTS - 1)
    root = np.sign(cosine) * np.sqrt(np.abs(np.clip(cosine, -1.0, 1.0)))
    return _interpolate(lut, row, (root + 1.0) * 0.5 * (_LUT_COSINES - 1))


def _interpolate(table: Float64Array, row: Float64Array, column: Float64Array) -> Float64Array:
    """(..., 3) bilinear interpolation in a (R, C, 3) table at fractional rows and columns."""
    top = np.clip(row.astype(np.intp), 0, table.shape[0] - 2)
    left = np.clip(column.astype(np.intp), 0, table.shape[1] - 2)
    down, right = (row - top)[..., None], (column - left)[..., None]
    upper = table[top, left] * (1.0 - right) + table[top, left + 1] * right
    lower = table[top + 1, left] * (1.0 - right) + table[top + 1, left + 1] * right
    return upper * (1.0 - down) + lower * down
