"""The reference line of a road in plan: lines, arcs, spirals, cubic and parametric cubic polynomials, joined."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Self
from xml.etree.ElementTree import Element

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from simbev_ros.maps.opendrive.reading.attributes import Malformed, Notes, number
from simbev_ros.types import AnyArray, Float64Array

_MAX_TURN_RAD = 26.0  # four turns, more than any ramp in a car park has in one piece
_TABLE_STEP_M = 0.25
_SHORTEST_M = 1e-6
_WIDEST_MITRE_RAD = np.radians(60.0)
_GAP_M = 0.05

Curve = Callable[[Float64Array], tuple[Float64Array, Float64Array]]
"""(N,) distances along → complex (N,) places u + iv and (N,) headings, in the frame of the curve's start."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanView:
    """All pieces of one road.

    Attributes:
        starts_m: (K,) where along the road each piece starts, ascending.
        end_m: Where the last one ends.
        origins: (K,) complex x + iy of their starts, map frame.
        headings_rad: (K,) at their starts.
        curves: Their shapes.
        turns_rad: (K,) change of heading at their starts: 0 where they join smoothly.
    """

    starts_m: Float64Array
    end_m: float
    origins: Float64Array
    headings_rad: Float64Array
    curves: tuple[Curve, ...]
    turns_rad: Float64Array

    @classmethod
    def read(cls, elements: list[Element], road: Element, notes: Notes) -> Self:
        """From <geometry> elements; those without length are left out, gaps and steps between pieces are noted.

        Raises:
            Malformed: There is none, or one of them is not usable.
        """
        pieces = sorted((g for e in elements for g in [_geometry(e, notes)] if g is not None), key=lambda g: g.start_m)
        if not pieces:
            raise Malformed(road, "it has no geometry")
        starts_m = np.array([piece.start_m for piece in pieces])
        if np.any(np.diff(starts_m) <= 0.0):
            raise Malformed(road, "two geometries start at the same s")
        ends = [_end(piece, until_m) for piece, until_m in zip(pieces, starts_m[1:], strict=False)]
        turns_rad = [_wrapped(b.heading_rad - heading) for b, (_, heading) in zip(pieces[1:], ends, strict=True)]
        if any(abs(b.origin - place) > _GAP_M for b, (place, _) in zip(pieces[1:], ends, strict=True)):
            notes.add("the reference line has a gap", road, f"road {road.get('id')}")
        return cls(
            starts_m=starts_m,
            end_m=pieces[-1].start_m + pieces[-1].length_m,
            origins=np.array([piece.origin for piece in pieces]),
            headings_rad=np.array([piece.heading_rad for piece in pieces]),
            curves=tuple(piece.curve for piece in pieces),
            turns_rad=np.array([0.0, *turns_rad]),
        )

    def __call__(self, s_m: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Places and directions on the line.

        Args:
            s_m: (N,) distances along it.

        Returns:
            (N, 2) places in the map frame; (N, 2) normals to the left, of length 1, but where the line has a corner
            along its bisector and longer, so that parallels keep their distance; (N,) headings.
        """
        index = np.maximum(np.searchsorted(self.starts_m, s_m, side="right") - 1, 0)
        places, headings_rad = np.empty(len(s_m), np.complex128), np.empty(len(s_m))
        for piece in np.unique(index) if len(self.curves) > 1 else [0]:
            here = index == piece if len(self.curves) > 1 else slice(None)
            local, turned_rad = self.curves[piece](s_m[here] - self.starts_m[piece])
            places[here] = self.origins[piece] + local * np.exp(1j * self.headings_rad[piece])
            headings_rad[here] = self.headings_rad[piece] + turned_rad
        half_rad = np.where(np.abs(s_m - self.starts_m[index]) < _SHORTEST_M, self.turns_rad[index] / 2.0, 0.0)
        half_rad[np.abs(half_rad) > _WIDEST_MITRE_RAD] = 0.0
        headings_rad -= half_rad
        normals = 1j * np.exp(1j * headings_rad) / np.cos(half_rad)
        return _pairs(places), _pairs(normals), headings_rad


@dataclass(frozen=True, slots=True, eq=False)
class _Geometry:
    """One piece."""

    start_m: float
    length_m: float
    origin: complex
    heading_rad: float
    curve: Curve


def _geometry(element: Element, notes: Notes) -> _Geometry | None:
    """One <geometry>; None if it has no length."""
    length_m = number(element, "length")
    if length_m < _SHORTEST_M:
        notes.add("a <geometry> without length is left out", element)
        return None
    shape = next((child for child in element if child.tag in _SHAPES), None)
    if shape is None:
        raise Malformed(element, f"it has none of {', '.join(_SHAPES)}")
    origin = complex(number(element, "x"), number(element, "y"))
    curve = _SHAPES[shape.tag](shape, length_m)
    return _Geometry(number(element, "s"), length_m, origin, number(element, "hdg"), curve)


def _end(piece: _Geometry, next_start_m: float) -> tuple[complex, float]:
    """Place and heading where the next piece starts."""
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
    """A curve whose curvature (1/m) grows at a rate (1/m²): line, arc or spiral.

    Places are Gauss-Legendre integrals of its direction, of so many nodes that they are exact to rounding.
    """
    turn_rad = max(abs(curvature), abs(curvature + rate * length_m)) * length_m
    if turn_rad > _MAX_TURN_RAD and element is not None:
        raise Malformed(element, f"it turns by {turn_rad:.3g} rad, more than {_MAX_TURN_RAD:g}")
    nodes, weights = _gauss_legendre(10 + int(turn_rad))

    def evaluate(s_m: Float64Array) -> tuple[Float64Array, Float64Array]:
        if turn_rad == 0.0:
            return s_m, np.zeros(len(s_m))
        at_m = np.outer(s_m, nodes)
        places = s_m * (np.exp(1j * at_m * (curvature + rate * at_m / 2.0)) @ weights)
        return places, s_m * (curvature + rate * s_m / 2.0)

    return evaluate


def parametric_cubic(u: Float64Array, v: Float64Array, length_m: float, end: float | None, element: Element) -> Curve:
    """A curve u(p), v(p) by arc length.

    Args:
        u: (4,) coefficients of 1, p, p², p³.
        v: (4,) likewise.
        length_m: Its declared length; p = ``end`` is reached there, whatever the arc length is exactly.
        end: Largest p; None: where the arc length is ``length_m``.
        element: Named in the error.

    Raises:
        Malformed: The curve stands still somewhere.
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
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return (nodes + 1.0) / 2.0, weights / 2.0


def _wrapped(angle_rad: float) -> float:
    """The angle in (-π, π]."""
    return float(np.angle(np.exp(1j * angle_rad)))


def _pairs(numbers: AnyArray) -> Float64Array:
    """(N, 2) real and imaginary parts."""
    return np.column_stack([numbers.real, numbers.imag])
