"""Piecewise cubic functions of the distance along a road: elevation, widths, offsets, superelevation."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self
from xml.etree.ElementTree import Element

import numpy as np

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.reading.attributes import Malformed, number, start_of

_MAX_COEFFICIENT = 1e24
"""Editors write such coefficients for pieces of a few micrometers."""
_PROBE_FRACTIONS = np.linspace(0.0, 1.0, 5)


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
    def read(
        cls,
        elements: Iterable[Element],
        notes: Findings,
        length_m: float,
        max_abs: float,
        start: str = "s",
    ) -> Self:
        """Read from records with attributes a, b, c, d; if several have the same start, the last one applies.

        A record that cannot be read, or has values out of bounds, is left out with a note: the value where it starts
        is kept up to the next record.

        Args:
            elements: The records.
            notes: Receives the records that are left out.
            length_m: End of the last record.
            max_abs: Bound of the absolute values.
            start: Name of the attribute at which a record starts.
        """
        rows: dict[float, tuple[Element, list[float]]] = {}
        for element in elements:
            start_m = start_of(element, start, notes)
            try:
                rows[start_m] = element, [number(element, name, 0.0, _MAX_COEFFICIENT) for name in "abcd"]
            except Malformed as problem:
                notes.left_out(f"a <{element.tag}> that cannot be read is left out", element, str(problem))
                rows.setdefault(start_m, (element, [np.nan] * 4))
        starts_m = np.array(sorted(rows), np.float64)
        coefficients = np.array([rows[start_m][1] for start_m in starts_m], np.float64).reshape(-1, 4)
        ends_m = np.append(starts_m[1:], length_m)[: len(starts_m)]
        ds_m = np.maximum(np.minimum(ends_m, length_m) - starts_m, 0.0)[:, None] * _PROBE_FRACTIONS
        is_out = np.abs(_evaluate(coefficients[:, None], ds_m)).max(axis=1, initial=0.0) > max_abs
        for start_m in starts_m[is_out].tolist():
            element = rows[start_m][0]
            rule = f"a <{element.tag}> with values beyond {max_abs:.4g} is left out"
            notes.left_out(rule, element, f"{start}={start_m:g}")
        is_out |= np.isnan(coefficients).any(axis=1)
        for k in np.flatnonzero(is_out[1:]) + 1:
            coefficients[k] = _evaluate(coefficients[k - 1], starts_m[k] - starts_m[k - 1]), 0.0, 0.0, 0.0
        is_used = np.logical_or.accumulate(~is_out)
        return cls(starts_m[is_used], coefficients[is_used])

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


def _evaluate(coefficients: Float64Array, ds_m: Float64Array) -> Float64Array:
    """Values of polynomials with (..., 4) coefficients."""
    a, b, c, d = np.moveaxis(coefficients, -1, 0)
    return np.asarray(a + ds_m * (b + ds_m * (c + ds_m * d)))
