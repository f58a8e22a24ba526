"""Evaluates the reference line of a road in plan view: joined lines, arcs, spirals and cubic polynomials."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from typing import Self
from xml.etree.ElementTree import Element

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.reading.attributes import Malformed, number

_MAX_TURN_RAD = 26.0  # four turns, more than any single piece of a car park ramp
_TABLE_STEP_M = 0.25
_MIN_LENGTH_M = 1e-6
_MAX_SPLINTER_M = 1e-3  # rounding of s in a file merges pieces as short as this with the next one
_MAX_MITER_RAD = np.radians(60.0)
_GAP_M = 0.05

Curve = Callable[[Float64Array], tuple[Float64Array, Float64Array]]
"""(N,) distances along the curve → complex (N,) points u + iv and (N,) headings, in the frame of the curve's start."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanView:
    """The reference line of one road, made of K pieces.

    Attributes:
        starts_m: (K,) distances along the road at which the pieces start, ascending.
        end_m: Distance at which the last piece ends.
        origins: (K,) complex x + iy of the pieces' starts, map frame.
        headings_rad: (K,) headings at the pieces' starts.
        curves: Shapes of the pieces.
        turns_rad: (K,) change of heading at the pieces' starts: 0 where they join smoothly.
    """

    starts_m: Float64Array
    end_m: float
    origins: Float64Array
    headings_rad: Float64Array
    curves: tuple[Curve, ...]
    turns_rad: Float64Array

    @classmethod
    def read(cls, elements: list[Element], road: Element, notes: Findings) -> Self:
        """Read <geometry> elements; those without length are left out, gaps between pieces are noted.

        Raises:
            Malformed: There is no geometry, or one is not usable.
        """
        pieces = sorted((g for e in elements for g in [_geometry(e, notes)] if g is not None), key=lambda g: g.start_m)
        if not pieces:
            raise Malformed(road, "it has no geometry")
        pieces = list(_without_coinciding(pieces, road, notes))
        starts_m = np.array([piece.start_m for piece in pieces])
        ends = [_evaluate_end(piece, next_start_m) for piece, next_start_m in zip(pieces, starts_m[1:], strict=False)]
        turns_rad = [_wrapped(b.heading_rad - heading) for b, (_, heading) in zip(pieces[1:], ends, strict=True)]
        gaps = [b.origin for b, (point, _) in zip(pieces[1:], ends, strict=True) if abs(b.origin - point) > _GAP_M]
        for origin in gaps:
            notes.repaired(
                "the reference line has a gap", road, f"road {road.get('id')}", np.array([origin.real, origin.imag])
            )
        return cls(
            starts_m=starts_m,
            end_m=pieces[-1].start_m + pieces[-1].length_m,
            origins=np.array([piece.origin for piece in pieces]),
            headings_rad=np.array([piece.heading_rad for piece in pieces]),
            curves=tuple(piece.curve for piece in pieces),
            turns_rad=np.array([0.0, *turns_rad]),
        )

    def __call__(self, s_m: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Evaluate points and directions of the line.

        Args:
            s_m: (N,) distances along it.

        Returns:
            (N, 2) points in the map frame; (N, 2) normals to the left, of unit length, but at a corner of the line
            along its bisector and longer, so that parallel lines keep their distance; (N,) headings.
        """
        index = np.maximum(np.searchsorted(self.starts_m, s_m, side="right") - 1, 0)
        points, headings_rad = np.empty(len(s_m), np.complex128), np.empty(len(s_m))
        for piece in np.unique(index) if len(self.curves) > 1 else [0]:
            here = index == piece if len(self.curves) > 1 else slice(None)
            local, turned_rad = self.curves[piece](s_m[here] - self.starts_m[piece])
            points[here] = self.origins[piece] + local * np.exp(1j * self.headings_rad[piece])
            headings_rad[here] = self.headings_rad[piece] + turned_rad
        half_turn_rad = np.where(np.abs(s_m - self.starts_m[index]) < _MIN_LENGTH_M, self.turns_rad[index] / 2.0, 0.0)
        half_turn_rad[np.abs(half_turn_rad) > _MAX_MITER_RAD] = 0.0
        headings_rad -= half_turn_rad
        normals = 1j * np.exp(1j * headings_rad) / np.cos(half_turn_rad)
        return _as_xy(points), _as_xy(normals), headings_rad


@dataclass(frozen=True, slots=True, eq=False)
class _Geometry:
    """One piece of the reference line."""

    start_m: float
    length_m: float
    origin: complex
    heading_rad: float
    curve: Curve


def _geometry(element: Element, notes: Findings) -> _Geometry | None:
    """Read one <geometry>; None if it has no length."""
    length_m = number(element, "length")
    if length_m < _MIN_LENGTH_M:
        notes.left_out("a <geometry> without length is left out", element)
        return None
    shape = next((child for child in element if child.tag in _SHAPES), None)
    if shape is None:
        raise Malformed(element, f"it has none of {', '.join(_SHAPES)}")
    origin = complex(number(element, "x"), number(element, "y"))
    curve = _SHAPES[shape.tag](shape, length_m)
    return _Geometry(number(element, "s"), length_m, origin, number(element, "hdg"), curve)


def _without_coinciding(pieces: list[_Geometry], road: Element, notes: Findings) -> Iterator[_Geometry]:
    """Yield pieces in ascending order, of those that start at the same s only the one with a length.

    Raises:
        Malformed: Several of them have a length.
    """
    for _, group in groupby(pieces, key=lambda piece: piece.start_m):
        coinciding = sorted(group, key=lambda piece: piece.length_m)
        if len(coinciding) > 1 and coinciding[-2].length_m > _MAX_SPLINTER_M:
            raise Malformed(road, "two geometries start at the same s")
        for _ in coinciding[:-1]:
            notes.left_out("a <geometry> that ends where it starts is left out", road, f"road {road.get('id')}")
        yield coinciding[-1]


def _evaluate_end(piece: _Geometry, next_start_m: float) -> tuple[complex, float]:
    """Point and heading of a piece where the next piece starts."""
    local, turned_rad = piece.curve(np.array([next_start_m - piece.start_m]))
    return piece.origin + complex(local[0]) * np.exp(1j * piece.heading_rad), piece.heading_rad + float(turned_rad[0])


def _line(_: Element, length_m: float) -> Curve:
    return clothoid(0.0, 0.0, length_m)


def _arc(element: Element, length_m: float) -> Curve:
    return clothoid(number(element, "curvature"), 0.0, length_m, element)


def _spiral(element: Element, length_m: float) -> Curve:
    start, end = number(element, "curvStart"), number(element, "curvEnd")
    return clothoid(start, (end - start) / length_m, length_m, element)


def _poly3(element: Element, length_m: float) -> Curve:
    v = np.array([number(element, name) for name in "abcd"])
    return parametric_cubic(np.array([0.0, 1.0, 0.0, 0.0]), v, length_m, None, element)


def _param_poly3(element: Element, length_m: float) -> Curve:
    u, v = (np.array([number(element, name + axis) for name in "abcd"]) for axis in "UV")
    end = length_m if element.get("pRange") == "arcLength" else 1.0
    return parametric_cubic(u, v, length_m, end, element)


_SHAPES = {"line": _line, "arc": _arc, "spiral": _spiral, "poly3": _poly3, "paramPoly3": _param_poly3}


def clothoid(curvature: float, rate: float, length_m: float, element: Element | None = None) -> Curve:
    """A curve whose curvature (1/m) changes at a constant rate (1/m²): line, arc or spiral.

    Points are Gauss-Legendre integrals of its direction, with enough nodes to be exact to rounding.
    """
    turn_rad = max(abs(curvature), abs(curvature + rate * length_m)) * length_m
    if turn_rad > _MAX_TURN_RAD and element is not None:
        raise Malformed(element, f"it turns by {turn_rad:.3g} rad, more than {_MAX_TURN_RAD:g}")
    nodes, weights = _gauss_legendre(10 + int(turn_rad))

    def evaluate(s_m: Float64Array) -> tuple[Float64Array, Float64Array]:
        if turn_rad == 0.0:
            return s_m, np.zeros(len(s_m))
        at_m = np.outer(s_m, nodes)
        points = s_m * (np.exp(1j * at_m * (curvature + rate * at_m / 2.0)) @ weights)
        return points, s_m * (curvature + rate * s_m / 2.0)

    return evaluate


def parametric_cubic(u: Float64Array, v: Float64Array, length_m: float, end: float | None, element: Element) -> Curve:
    """A curve u(p), v(p), reparametrized by arc length.

    Args:
        u: (4,) coefficients of 1, p, p², p³.
        v: (4,) likewise.
        length_m: Declared length; p = ``end`` is reached there, whatever the exact arc length is.
        end: Largest p; None: where the arc length is ``length_m``.
        element: Named in the error.

    Raises:
        Malformed: The curve has a point of zero speed.
    """
    a, b, c, d = u + 1j * v

    def curve(p: Float64Array) -> AnyArray:
        return np.asarray(a + p * (b + p * (c + p * d)))

    def slope(p: Float64Array) -> AnyArray:
        return np.asarray(b + p * (2.0 * c + p * (3.0 * d)))

    steps = int(np.clip(length_m / _TABLE_STEP_M, 16, 8192))
    table = np.linspace(0.0, length_m if end is None else end, steps + 1)
    nodes, weights = _gauss_legendre(5)
    step = table[1]
    speeds = np.abs(slope(table[:-1, None] + step * nodes))
    if min(speeds.min(), np.abs(slope(table)).min()) * table[-1] < 1e-6 * length_m:
        raise Malformed(element, "the curve stands still somewhere")
    arc_m = np.concatenate([[0.0], np.cumsum(step * speeds @ weights)])
    parameter = CubicHermiteSpline(arc_m, table, 1.0 / np.abs(slope(table)))
    scale = 1.0 if end is None else arc_m[-1] / length_m

    def evaluate(s_m: Float64Array) -> tuple[Float64Array, Float64Array]:
        p = parameter(s_m * scale)
        return curve(p), np.angle(slope(p))

    return evaluate


@lru_cache(maxsize=64)
def _gauss_legendre(count: int) -> tuple[Float64Array, Float64Array]:
    """Gauss-Legendre nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1.0) / 2.0, weights / 2.0


def _wrapped(angle_rad: float) -> float:
    """The angle normalized to (-π, π]."""
    return float(np.angle(np.exp(1j * angle_rad)))


def _as_xy(numbers: AnyArray) -> Float64Array:
    """(N, 2) real and imaginary parts of (N,) complex numbers."""
    return np.column_stack([numbers.real, numbers.imag])
