"""Piecewise cubic functions of the distance along a road: elevation, widths, offsets, superelevation."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.opendrive.reading.attributes import number

_MAX_COEFFICIENT = 1e24
"""Editors write such coefficients for pieces of a few micrometers."""


@dataclass(frozen=True, slots=True, eq=False)
class Cubics:
    """Piecewise cubic function a + b·ds + c·ds² + d·ds³, with ds the distance from each piece's start.

    Constant before the first start.

    Attributes:
        starts_m: (K,) starts of the pieces, ascending.
        coefficients: (K, 4) a, b, c, d.
    """

    starts_m: Float64Array
    coefficients: Float64Array

    @classmethod
    def read(cls, elements: Iterable[Element], start: str = "s") -> Self:
        """Read from records with attributes a, b, c, d; if several have the same start, the last one applies.

        Raises:
            Malformed: An attribute is not a number, or the start is missing.
        """
        rows = {number(e, start): [number(e, name, 0.0, _MAX_COEFFICIENT) for name in "abcd"] for e in elements}
        starts_m = np.array(sorted(rows), np.float64)
        return cls(starts_m, np.array([rows[start_m] for start_m in starts_m], np.float64).reshape(-1, 4))

    def __bool__(self) -> bool:
        return len(self.starts_m) > 0

    def __call__(self, s_m: Float64Array) -> Float64Array:
        """(N,) values at (N,) distances; 0 if there are no records."""
        if not self:
            return np.zeros(len(s_m))
        index = np.maximum(np.searchsorted(self.starts_m, s_m, side="right") - 1, 0) if len(self.starts_m) > 1 else 0
        ds_m = np.maximum(s_m - self.starts_m[index], 0.0)
        a, b, c, d = self.coefficients[index].T
        return a + ds_m * (b + ds_m * (c + ds_m * d))
