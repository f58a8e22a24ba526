"""Levels of detail of actor meshes: the geometric error that each level allows, and what it may therefore omit."""

from dataclasses import dataclass, replace

import numpy as np

from simbev_ros.foundation.types import BoolArray, Float64Array, Int64Array


@dataclass(frozen=True, slots=True)
class Detail:
    """Level of detail of an actor's mesh.

    Attributes:
        error_m: Maximum distance of the surface from the exact one; thinner details may be missing.
        insides: Whether the interior behind doors is built; without it all doors must be shut.
    """

    error_m: float = 0.0
    insides: bool = True

    @property
    def for_spinning_parts(self) -> "Detail":
        """Stricter detail for wheels: their rotation between images up to doubles errors in optical flow."""
        return replace(self, error_m=self.error_m / 3.0)

    def segments(self, wanted: int, radius_m: float, minimum: int = 4) -> int:
        """Number of sides of a round object: the fewest that keep within the error, at most ``wanted``."""
        if self.error_m <= 0.0:
            return wanted
        half_angle = np.arccos(max(1.0 - self.error_m / max(radius_m, 1e-9), 0.0))
        return min(wanted, max(minimum, int(np.ceil(np.pi / half_angle))))

    def needed(self, points_m: Float64Array) -> BoolArray:
        """(N,) which of a line's (N, K) points, with radii as further coordinates, keep it within the error."""
        if self.error_m <= 0.0:
            return np.ones(len(points_m), bool)
        return select_lines(points_m[:, None], np.zeros(len(points_m), bool), self.error_m / 2.0)[0]

    def shows(self, thickness_m: float) -> bool:
        """Whether details of a thickness are built."""
        return thickness_m > self.error_m


EXACT = Detail()
COARSER = tuple(Detail(error_m, insides=False) for error_m in (0.0, 0.005, 0.017, 0.035, 0.07))
"""Levels of detail of the coarser meshes that cameras may draw for distant actors."""
COARSER_FIGURES = tuple(Detail(error_m) for error_m in (0.008, 0.025, 0.07))
"""Those of people, who are many models with nothing inside."""


def select_lines(points_m: Float64Array, borders: BoolArray, error_m: float) -> tuple[BoolArray, Int64Array]:
    """Select the lines of a grid that its surface needs to stay within an error.

    Args:
        points_m: (N, M, 3) points of N neighboring lines.
        borders: (N,) whether a line should be kept, provided that it is a pixel away from other kept ones.
        error_m: Maximum distance of a point from the chord between its kept neighbors: half a pixel.

    Returns:
        (N,) whether each line is kept, with the first and the last; (K - 1,) the cell in the middle between each two
        kept lines.
    """
    along_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points_m, axis=0), axis=2).max(axis=1))])
    kept = np.zeros(len(points_m), bool)
    kept[[0, -1]] = True
    reached_m = 0.0
    for line in np.flatnonzero(borders[1:-1]) + 1:
        if min(along_m[line] - reached_m, along_m[-1] - along_m[line]) > 2.0 * error_m:
            kept[line], reached_m = True, along_m[line]
    while True:
        worst = _worst_lines(points_m, kept, error_m)
        if not len(worst):
            kept_lines = along_m[kept]
            middle = np.searchsorted(along_m, (kept_lines[:-1] + kept_lines[1:]) / 2.0, "right") - 1
            return kept, middle.astype(np.int64)
        kept[worst] = True


def _worst_lines(points_m: Float64Array, kept: BoolArray, error_m: float) -> Int64Array:
    """Between each two kept lines, the line that is farthest from their chord, if that exceeds the error."""
    index, kept_lines = np.arange(len(kept)), np.flatnonzero(kept)
    before = kept_lines[np.searchsorted(kept_lines, index, "right") - 1]
    after = kept_lines[np.searchsorted(kept_lines, index, "left")]
    start, chord = points_m[before], points_m[after] - points_m[before]
    square = np.maximum(np.einsum("nmi,nmi->nm", chord, chord), 1e-12)
    share = np.clip(np.einsum("nmi,nmi->nm", points_m - start, chord) / square, 0.0, 1.0)
    off_m = np.linalg.norm(points_m - start - share[..., None] * chord, axis=2).max(axis=1)
    order = np.lexsort((off_m, before))
    worst = order[np.append(np.diff(before[order]) > 0, True)]
    return worst[off_m[worst] > error_m]
