"""Cuts carriageways into blocks: adjacent strips are cut into pieces at common cross-sections."""

from collections.abc import Sequence

import numpy as np
import shapely
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from simbev_ros.foundation.geometry.ragged import ragged_starts
from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.roads.polylines import Polylines
from simbev_ros.maps.roads.strip_pieces import StripPieces

_ENDPOINT_TOLERANCE_M = 0.3  # maximum distance between the endpoints of shared borders
_MIN_PIECE_M = 0.3  # minimum length of a piece


def cut_into_blocks(strips: Sequence[Strip], length_m: float) -> tuple[StripPieces, Int64Array]:
    """Cut strips into pieces of at most about ``length_m``, aligned across each carriageway.

    Strips belong to one carriageway if they share a border over their full length. Cuts are perpendicular to the
    longest of them. Strips with an outline are not cut.

    Returns:
        The pieces, and (N,) the block that each belongs to: pieces abreast of each other form one block.
    """
    lines = Polylines.from_lines([strip.center_m for strip in strips])
    if not len(lines):
        return StripPieces.cut(strips, length_m), np.empty(0, np.int64)
    leader, first_block, sections = _sections(strips, lines, length_m)
    shapes = np.asarray(shapely.linestrings(lines.points_m[:, :2], indices=lines.row), object)
    beside_m = shapely.line_locate_point(shapes[leader[lines.row]], shapely.points(lines.points_m[:, :2]))
    rows, starts, ends, blocks = [], [], [], []
    for row, (station_m, along_m) in enumerate(zip(lines.split(lines.station_m), lines.split(beside_m), strict=True)):
        cuts_m = _cuts(station_m, along_m, sections[leader[row]])
        bounds_m = np.concatenate([[0.0], cuts_m, [lines.length_m[row]]])
        middle_m = np.interp((bounds_m[1:] + bounds_m[:-1]) / 2.0, station_m, along_m)
        rows.append(np.full(len(middle_m), row))
        starts.append(bounds_m[:-1])
        ends.append(bounds_m[1:])
        blocks.append(first_block[row] + np.searchsorted(sections[leader[row]], middle_m))
    pieces = StripPieces(strips, np.concatenate(rows), np.concatenate(starts), np.concatenate(ends))
    return pieces, np.unique(np.concatenate(blocks), return_inverse=True)[1].astype(np.int64)


def _sections(
    strips: Sequence[Strip], lines: Polylines, length_m: float
) -> tuple[Int64Array, Int64Array, dict[int, Float64Array]]:
    """(S,) leader of each strip's carriageway, (S,) index of its first block, and the stations to cut by leader."""
    group = _carriageways(strips)
    order = np.lexsort([np.arange(len(strips)), -lines.length_m, group])
    leader = order[np.searchsorted(group[order], np.arange(group.max() + 1))]
    count = np.maximum(np.ceil(lines.length_m[leader] / length_m).astype(np.int64), 1)
    count[[strips[row].outline_m is not None for row in leader.tolist()]] = 1
    first_block = ragged_starts(count)
    cuts_m = {
        row: lines.length_m[row] * np.arange(1, number) / number
        for row, number in zip(leader.tolist(), count.tolist(), strict=True)
    }
    return leader[group], first_block[group], cuts_m


def _cuts(station_m: Float64Array, along_m: Float64Array, sections_m: Float64Array) -> Float64Array:
    """Stations at which a strip crosses its leader's cross-sections, ascending along the strip.

    Args:
        station_m: (P,) stations of the strip's points along the strip.
        along_m: (P,) stations of the leader's points beside them.
        sections_m: Stations of the cross-sections along the leader.
    """
    is_opposite = along_m[-1] < along_m[0]
    forward_m = np.maximum.accumulate(-along_m if is_opposite else along_m)
    section_stations_m = -sections_m[::-1] if is_opposite else sections_m
    cuts_m = np.interp(
        section_stations_m[(section_stations_m > forward_m[0]) & (section_stations_m < forward_m[-1])],
        forward_m,
        station_m,
    )
    cuts_m = cuts_m[(cuts_m > _MIN_PIECE_M) & (cuts_m < station_m[-1] - _MIN_PIECE_M)]
    far_enough: BoolArray = np.diff(cuts_m, prepend=-np.inf) > _MIN_PIECE_M
    return np.asarray(cuts_m[far_enough], np.float64)


def _carriageways(strips: Sequence[Strip]) -> Int64Array:
    """(S,) index of the carriageway that each strip belongs to."""
    sides_m = [np.stack([getattr(strip, side)[[0, -1]] for strip in strips]) for side in ("left_m", "right_m")]
    ends_m = np.concatenate([*sides_m, *(side_m[:, ::-1] for side_m in sides_m)])  # in both directions
    pairs = cKDTree(ends_m.reshape(-1, 6)).query_pairs(_ENDPOINT_TOLERANCE_M, output_type="ndarray").reshape(
        -1, 2
    ) % len(strips)
    shape = len(strips), len(strips)
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=shape)
    return np.asarray(connected_components(graph, directed=False)[1], np.int64)
