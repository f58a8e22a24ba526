"""Chooses the stations at which borders of a road are sampled, such that linear interpolation is accurate enough."""

from itertools import pairwise

import numpy as np

from simbev_ros.foundation.geometry.ragged import ragged_indices
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.maps.opendrive.borders import borders_m
from simbev_ros.maps.opendrive.reading.document import Road, Section

_SPACING_M = 5.0
_TOLERANCE_M = 0.01
_MIN_STEP_M = 0.05
_MAX_PARTS = 8
_PROBE_FRACTIONS = np.array([0.25, 0.5, 0.75])


def stations_m(road: Road) -> Float64Array:
    """(N,) distances along a road at which its borders are sampled, ascending from 0 to its length.

    They include the start of every record. Linear interpolation between the border points there deviates from the exact
    borders by no more than a tolerance, in plan and in height, unless stations are closer than 5 cm.
    """
    bounds_m = sorted({0.0, road.length_m, *(section.start_m for section in road.sections)})
    breaks_m = _breaks_m(road)
    parts = []
    for start_m, end_m in pairwise(bounds_m):
        active = [
            (section, left)
            for left, sections in ((True, road.left), (False, road.right))
            for section in sections
            if section.lanes and section.start_m <= start_m < section.end_m
        ]
        inside_m = breaks_m[(breaks_m > start_m + _MIN_STEP_M / 2) & (breaks_m < end_m - _MIN_STEP_M / 2)]
        parts.append(_refine_m(road, active, np.array([start_m, *inside_m, end_m])))
    return np.unique(np.concatenate(parts))


def _breaks_m(road: Road) -> Float64Array:
    """Distances along a road at which a record starts or ends, ascending, at least 1 mm apart."""
    cubics = (road.elevation, road.superelevation, road.offset, *road.crossfall)
    section_starts_m = [
        section.start_m + np.concatenate([record.starts_m for lane in section.lanes for record in lane.records])
        for section in road.sections
        if section.lanes
    ]
    cuts = [*(s_m for s_m, _ in road.speeds), *(s_m for stretch in (*road.bridges, *road.tunnels) for s_m in stretch)]
    for section in road.sections:
        records = (*section.marks.values(), *(lane.speeds for lane in section.lanes))
        cuts += [section.start_m + s_m for changes in records for s_m, _ in changes]
    shape_m = [shape.s_m for shape in road.shape]
    all_m = np.concatenate(
        [road.plan.starts_m, *(cubic.starts_m for cubic in cubics), *section_starts_m, cuts, shape_m]
    )
    breaks_m = np.unique(all_m)
    return breaks_m[np.concatenate([[True], np.diff(breaks_m) > 1e-3])]


def _refine_m(road: Road, active: list[tuple[Section, bool]], nodes_m: Float64Array) -> Float64Array:
    """Insert stations between nodes until the borders between neighbors are straight within the tolerance."""
    nodes_m = _subdivide(nodes_m, np.ceil(np.diff(nodes_m) / _SPACING_M).astype(np.int64))
    while active:
        lengths_m = np.diff(nodes_m)
        probes_m = nodes_m[:-1, None] + lengths_m[:, None] * _PROBE_FRACTIONS
        order_m = np.concatenate([nodes_m, probes_m.ravel()])
        lines = np.concatenate([borders_m(road, section, left, order_m)[0] for section, left in active])
        ends, probes = (
            lines[:, : len(nodes_m)],
            lines[:, len(nodes_m) :].reshape(len(lines), -1, len(_PROBE_FRACTIONS), 3),
        )
        parts = np.ceil(np.sqrt(_deviation_m(ends, probes) / _TOLERANCE_M) - 1e-6)
        parts = np.clip(np.minimum(parts, lengths_m / _MIN_STEP_M), 1, _MAX_PARTS).astype(np.int64)
        if np.all(parts == 1):
            break
        nodes_m = _subdivide(nodes_m, parts)
    return nodes_m


def _deviation_m(ends: Float64Array, probes: Float64Array) -> Float64Array:
    """(N - 1,) largest distance of (B, N - 1, P, 3) probes from the chords of (B, N, 3) ends, in plan or in height."""
    chords = np.diff(ends, axis=1)
    arms = probes - ends[:, :-1, None]
    lengths_m = np.maximum(np.linalg.norm(chords[..., :2], axis=2), 1e-9)[..., None]
    plan_m = np.abs(chords[..., None, 0] * arms[..., 1] - chords[..., None, 1] * arms[..., 0]) / lengths_m
    height_m = np.abs(arms[..., 2] - chords[..., None, 2] * _PROBE_FRACTIONS)
    return np.maximum(plan_m, height_m).max(axis=(0, 2))


def _subdivide(nodes_m: Float64Array, parts: Int64Array) -> Float64Array:
    """Divide each interval between nodes into its number of equal parts."""
    parts = np.maximum(parts, 1)
    interval, within = ragged_indices(parts)
    inner_m = nodes_m[interval] + within / parts[interval] * np.diff(nodes_m)[interval]
    return np.append(inner_m, nodes_m[-1])
