"""Levels of detail: how far a mesh may be from its exact form, and what may therefore be left out of it."""

from dataclasses import dataclass, replace

import numpy as np

from simbev_ros.types import BoolArray, Float64Array, Int64Array


@dataclass(frozen=True, slots=True)
class Detail:
    """How exactly an actor is modeled.

    Attributes:
        error_m: How far the surface may be from the exact one; what is thinner may be missing.
        insides: With what is behind doors; without it all doors must be shut.
    """

    error_m: float = 0.0
    insides: bool = True

    @property
    def for_spinning_parts(self) -> "Detail":
        """What a wheel needs: between two pictures it turns so far that an error shows up to twice in its flow."""
        return replace(self, error_m=self.error_m / 3.0)

    def segments(self, wanted: int, radius_m: float, minimum: int = 4) -> int:
        """Sides of a round thing that has ``wanted`` ones: as few as keep within the error of its circle."""
        if self.error_m <= 0.0:
            return wanted
        half_angle = np.arccos(max(1.0 - self.error_m / max(radius_m, 1e-9), 0.0))
        return min(wanted, max(minimum, int(np.ceil(np.pi / half_angle))))

    def shows(self, thickness_m: float) -> bool:
        """Whether a thing of this thickness is there."""
        return thickness_m > self.error_m


EXACT = Detail()
COARSER = tuple(Detail(error_m, insides=False) for error_m in (0.0, 0.005, 0.017, 0.035, 0.07))
"""What cameras may draw instead of the exact mesh where it is far enough away."""


def select_lines(points_m: Float64Array, borders: BoolArray, error_m: float) -> tuple[BoolArray, Int64Array]:
    """Which lines of a grid its surface needs to keep within an error.

    Args:
        points_m: (N, M, 3) points of N neighboring lines.
        borders: (N,) lines that should stay, as long as they are a pixel apart.
        error_m: How far a point may be from the straight way between its neighbors that stay: half a pixel.

    Returns:
        (N,) the lines that stay, the first and the last among them; the cell in the middle between each two of these.
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
    """The line between each two of those kept that is farthest off the straight way, if by more than the error."""
    index, kept_lines = np.arange(len(kept)), np.flatnonzero(kept)
    before = kept_lines[np.searchsorted(kept_lines, index, "right") - 1]
    after = kept_lines[np.searchsorted(kept_lines, index, "left")]
    start, chord = points_m[before], points_m[after] - points_m[before]
    square = np.maximum(np.einsum("nmi,nmi->nm", chord, chord), 1e-12)
    share = np.clip(np.einsum("nmi,nmi->nm", points_m - start, chord) / square, 0.0, 1.0)
    off_m = np.linalg.norm(points_m - start - share[..., None] * chord, axis=2).max(axis=1)
    order = np.lexsort((off_m, before))
    worst = order[np.append(np.diff(before[order]) > 0, True)]
    exceeding: Int64Array = worst[off_m[worst] > error_m]
    return exceeding
