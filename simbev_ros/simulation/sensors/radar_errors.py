"""Errors of a real radar, applied to ideal detections: noise, threshold, ambiguous speeds, finite resolution cells."""

from collections.abc import Callable

import numpy as np

from simbev_ros.config.radar import Radar
from simbev_ros.foundation.types import Float64Array, Int64Array, Table

_CELL_COLUMNS = ["range", "doppler_velocity", "azimuth", "elevation"]


def apply_errors(radar: Radar, table: Table, ray: Int64Array, draw: Callable[[], Float64Array]) -> Table:
    """Apply all configured errors and return the remaining detections, in order.

    Args:
        radar: Configuration that turns errors on; each is off by default.
        table: (N,) ``RADAR_POINT_DTYPE`` detections without x, y, z; modified in place.
        ray: (N,) ray index of each detection.
        draw: Returns (rays, 5) standard normal numbers: each ray has its own, whether it returns or not.
    """
    sigmas = {
        "range": radar.range_noise_sigma_m,
        "azimuth": np.radians(radar.azimuth_noise_sigma_deg),
        "elevation": np.radians(radar.elevation_noise_sigma_deg),
        "doppler_velocity": radar.doppler_noise_sigma_mps,
        "amplitude": radar.amplitude_noise_sigma_db,
    }
    if any(sigmas.values()):
        noise = draw()[ray]
        for column, (name, sigma) in enumerate(sigmas.items()):
            table[name] += sigma * noise[:, column]
        table["range"] = np.maximum(table["range"], 0.0)
    if radar.threshold_db is not None:
        table = table[table["amplitude"] >= radar.threshold_db]
    if radar.max_doppler_mps is not None:
        limit_mps = radar.max_doppler_mps
        table["doppler_velocity"] = (table["doppler_velocity"] + limit_mps) % (2.0 * limit_mps) - limit_mps
    if radar.detector is not None:  # places between cells, with speeds that are aliased already
        return table
    _round_to_cells(radar, table)
    return _strongest_of_cells(table) if radar.one_per_cell else table


def _round_to_cells(radar: Radar, table: Table) -> None:
    """Round values to cell centers. The first range cell begins at 0; cells of speed and angle are centered on 0."""
    if (cell_m := radar.range_resolution_m) is not None:
        table["range"] = (np.floor(table["range"].astype(np.float64) / cell_m) + 0.5) * cell_m
    for name, cell in (
        ("doppler_velocity", radar.doppler_resolution_mps),
        ("azimuth", radar.azimuth_resolution_deg and np.radians(radar.azimuth_resolution_deg)),
        ("elevation", radar.elevation_resolution_deg and np.radians(radar.elevation_resolution_deg)),
    ):
        if cell is not None:
            table[name] = np.round(table[name].astype(np.float64) / cell) * cell


def _strongest_of_cells(table: Table) -> Table:
    """The strongest detection of each cell, in the order of the rays."""
    cells = np.stack([table[name] for name in _CELL_COLUMNS])
    order = np.lexsort((-table["amplitude"], *cells))  # by cell, then the strongest first
    first = np.ones(len(table), bool)
    first[1:] = (np.diff(cells[:, order]) != 0.0).any(axis=0)
    return table[np.sort(order[first])]
