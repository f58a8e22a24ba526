"""Evaluates the reference line of a road in plan view: joined lines, arcs, spirals and cubic polynomials."""

import cmath
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby
from typing import Self, cast
from xml.etree.ElementTree import Element

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.reading.attributes import MAX_ABS, Malformed, number

_MAX_TURN_RAD = 26.0  # four turns, more than any single piece of a car park ramp
_TABLE_STEP_M = 0.25
_MIN_LENGTH_M = 1e-6
_MAX_SPLINTER_M = 1e-3  # rounding of s in a file merges pieces as short as this with the next one
_MAX_MITER_RAD = np.radians(60.0)
_GAP_M = 0.05
_MAX_COORDINATE_M = 100e3
_MAX_ROAD_M = 200e3
_MAX_LENGTH_RATIO = 10.0  # of a curve to its declared length
_MIN_STRETCH, _MAX_STRETCH = 0.5, 1.5  # of a straight line that replaces a piece, to end where the next one starts

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

        A piece that cannot be read, or only in part, continues the piece before it: a shape that is unknown is a
        straight line up to the next piece.

        Raises:
            Malformed: There is no geometry, or none has a position.
        """
        pieces = sorted(_started(elements, road, notes), key=lambda piece: piece.start_m)
        if not pieces:
            raise Malformed(road, "it has no geometry")
        pieces = _completed(list(_without_coinciding(pieces, road, notes)))
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
            curves=tuple(cast(Curve, piece.curve) for piece in pieces),
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
    """One piece of the reference line; what cannot be read is NaN, or None."""

    start_m: float
    length_m: float
    origin: complex
    heading_rad: float
    curve: Curve | None
    problem: Malformed | None


def _geometry(element: Element, next_m: float, notes: Findings) -> _Geometry | None:
    """Read one <geometry>; None if it has no length. Without a readable length it ends at ``next_m``, if known."""
    problems: list[Malformed] = []

    def read(name: str, min_value: float, max_abs: float = MAX_ABS) -> float:
        try:
            value = number(element, name, max_abs=max_abs)
            if value < min_value:
                raise Malformed(element, f"{name}={value:g} is less than {min_value:g}")
        except Malformed as problem:
            problems.append(problem)
            return math.nan
        return value

    start_m, length_m = read("s", -_MIN_LENGTH_M, _MAX_ROAD_M), read("length", -_MIN_LENGTH_M)
    heading_rad = read("hdg", -math.inf)
    length_m = next_m - start_m if math.isnan(length_m) else length_m
    if length_m < _MIN_LENGTH_M:
        notes.left_out("a <geometry> without length is left out", element)
        return None
    origin = complex(*(read(name, -math.inf, _MAX_COORDINATE_M) for name in "xy"))
    curve = None
    try:
        shape = next((child for child in element if child.tag in _SHAPES), None)
        if shape is None:
            raise Malformed(element, f"it has none of {', '.join(_SHAPES)}")
        if math.isfinite(length_m):
            curve = _SHAPES[shape.tag](shape, length_m, notes)
    except Malformed as problem:
        problems.append(problem)
    if problems:
        rule = "a <geometry> that cannot be read continues the one before it"
        notes.left_out(rule, element, str(problems[0]))
    return _Geometry(start_m, length_m, origin, heading_rad, curve, problems[0] if problems else None)


def _started(elements: list[Element], road: Element, notes: Findings) -> Iterator[_Geometry]:
    """Yield the pieces, in the file's order, with a start and a length each."""
    starts_m = [*(_number_or_nan(element, "s") for element in elements[1:]), _number_or_nan(road, "length")]
    end_m = 0.0
    for element, next_m in zip(elements, starts_m, strict=False):
        piece = _geometry(element, next_m, notes)
        if piece is not None and math.isfinite(piece.length_m):
            start_m = end_m if math.isnan(piece.start_m) else piece.start_m
            end_m = start_m + piece.length_m
            yield replace(piece, start_m=start_m)


def _number_or_nan(element: Element, name: str) -> float:
    try:
        return number(element, name)
    except Malformed:
        return math.nan


def _completed(pieces: list[_Geometry]) -> list[_Geometry]:
    """Pieces in ascending order with everything that could not be read taken from their neighbors.

    Raises:
        Malformed: None of them has a position.
    """
    first = next((k for k, piece in enumerate(pieces) if not cmath.isnan(piece.origin)), None)
    if first is None:
        raise cast(Malformed, pieces[0].problem)
    found = pieces[:]
    for k in reversed(range(first)):
        found[k] = _before(pieces[k], found[k + 1])
    for k in range(len(pieces)):
        if found[k].problem is not None:
            after = pieces[k + 1].origin if k + 1 < len(pieces) else complex(math.nan)
            found[k] = _after(found[k], found[k - 1] if k else None, after)
    return found


def _before(piece: _Geometry, following: _Geometry) -> _Geometry:
    """A piece without a position, placed such that it ends where the following one starts."""
    curve = piece.curve or clothoid(0.0, 0.0, piece.length_m)
    heading_rad = 0.0 if math.isnan(following.heading_rad) else following.heading_rad
    local, turned_rad = curve(np.array([following.start_m - piece.start_m]))
    heading_rad -= float(turned_rad[0])
    origin = following.origin - complex(local[0]) * complex(np.exp(1j * heading_rad))
    return replace(piece, origin=origin, heading_rad=heading_rad, curve=curve)


def _after(piece: _Geometry, previous: _Geometry | None, next_origin: complex) -> _Geometry:
    """A piece that could not be read in full, continuing the previous one, towards the start of the next one."""
    end, heading_rad = (piece.origin, 0.0) if previous is None else _evaluate_end(previous, piece.start_m)
    origin = end if cmath.isnan(piece.origin) else piece.origin
    heading_rad = heading_rad if math.isnan(piece.heading_rad) else piece.heading_rad
    if piece.curve is not None:
        return replace(piece, origin=origin, heading_rad=heading_rad)
    gap = next_origin - origin
    gap_m = math.hypot(gap.real, gap.imag)  # of NaN, abs() raises after an earlier overflow
    scale = 1.0
    if _MIN_STRETCH < gap_m / piece.length_m < _MAX_STRETCH:
        scale, heading_rad = gap_m / piece.length_m, cmath.phase(gap)
    return replace(piece, origin=origin, heading_rad=heading_rad, curve=_straight(scale))


def _straight(scale: float) -> Curve:
    """A line on which distances are multiplied by a factor."""
    return lambda s_m: (np.asarray(s_m * scale), np.zeros(len(s_m)))


def _without_coinciding(pieces: list[_Geometry], road: Element, notes: Findings) -> Iterator[_Geometry]:
    """Yield pieces in ascending order, of those that start at the same s only the longest."""
    for _, group in groupby(pieces, key=lambda piece: piece.start_m):
        coinciding = sorted(group, key=lambda piece: piece.length_m)
        for piece in coinciding[:-1]:
            where = "ends where it starts" if piece.length_m <= _MAX_SPLINTER_M else "starts where a longer one does"
            notes.left_out(f"a <geometry> that {where} is left out", road, f"road {road.get('id')}")
        yield coinciding[-1]


def _evaluate_end(piece: _Geometry, next_start_m: float) -> tuple[complex, float]:
    """Point and heading of a piece where the next piece starts."""
    curve = cast(Curve, piece.curve)
    local, turned_rad = curve(np.array([next_start_m - piece.start_m]))
    return piece.origin + complex(local[0]) * np.exp(1j * piece.heading_rad), piece.heading_rad + float(turned_rad[0])


def _line(_: Element, length_m: float, notes: Findings) -> Curve:
    return clothoid(0.0, 0.0, length_m)


def _arc(element: Element, length_m: float, notes: Findings) -> Curve:
    (curvature,) = _coefficients(element, ["curvature"], notes)
    return clothoid(curvature, 0.0, length_m, element)


def _spiral(element: Element, length_m: float, notes: Findings) -> Curve:
    start, end = _coefficients(element, ["curvStart", "curvEnd"], notes)
    return clothoid(start, (end - start) / length_m, length_m, element)


def _poly3(element: Element, length_m: float, notes: Findings) -> Curve:
    v = np.array(_coefficients(element, "abcd", notes))
    return parametric_cubic(np.array([0.0, 1.0, 0.0, 0.0]), v, length_m, None, element)


def _param_poly3(element: Element, length_m: float, notes: Findings) -> Curve:
    u, v = (np.array(_coefficients(element, [name + axis for name in "abcd"], notes)) for axis in "UV")
    end = length_m if element.get("pRange") == "arcLength" else 1.0
    return parametric_cubic(u, v, length_m, end, element)


def _coefficients(element: Element, names: Iterable[str], notes: Findings) -> list[float]:
    """Numbers of a shape; those that are missing are 0, as CARLA reads them."""
    names = list(names)
    missing = [name for name in names if element.get(name) is None]
    if missing:
        notes.repaired("a number that a curve lacks is 0", element, f"<{element.tag}>: {', '.join(missing)}")
    return [number(element, name, 0.0) for name in names]


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

    A curve may stand still at single points, such as a Bézier curve whose control points coincide.

    Raises:
        Malformed: The curve has no length.
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
    arc_m = np.concatenate([[0.0], np.cumsum(step * speeds @ weights)])
    if arc_m[-1] < _MIN_LENGTH_M or np.diff(arc_m).min() <= 0.0:
        raise Malformed(element, "the curve stands still")
    reach_m = max(arc_m[-1], np.abs(curve(table)).max())
    if reach_m > _MAX_LENGTH_RATIO * max(length_m, 1.0):
        raise Malformed(element, f"the curve reaches {reach_m:.4g} m, not {length_m:.4g} m")
    stands_still = min(speeds.min(), np.abs(slope(table)).min()) * table[-1] < 1e-6 * length_m
    parameter = (
        PchipInterpolator(arc_m, table)
        if stands_still
        else CubicHermiteSpline(arc_m, table, 1.0 / np.abs(slope(table)))
    )
    scale = 1.0 if end is None else arc_m[-1] / length_m
    inside = table[-1] * 1e-4

    def evaluate(s_m: Float64Array) -> tuple[Float64Array, Float64Array]:
        p = parameter(s_m * scale)
        if not stands_still:
            return curve(p), np.angle(slope(p))
        beside = np.clip(p, inside, table[-1] - inside)
        return curve(p), np.angle(curve(beside + inside) - curve(beside - inside))

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
