"""Reference lines compared with closed formulas and integrals; borders in space compared with hand computations."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import xodr_sample as sample
from scipy.integrate import quad
from scipy.special import fresnel

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.opendrive.lane_shapes import lane_shapes
from simbev_ros.maps.opendrive.links import LaneLinks
from simbev_ros.maps.opendrive.reading.document import Document
from simbev_ros.maps.opendrive.reading.plan_view import clothoid, parametric_cubic
from simbev_ros.maps.opendrive.reading.reader import read_document
from simbev_ros.maps.opendrive.strips import strips_of
from simbev_ros.maps.roads.layout import Strip
from simbev_ros.maps.safe_xml import parse


def read(tmp_path: Path, text: str) -> tuple[Document, Findings]:
    path = tmp_path / "sample.xodr"
    path.write_text(text, encoding="utf-8")
    notes = Findings(path)
    return read_document(path, parse(path, "OpenDRIVE"), notes), notes


def strips(tmp_path: Path, *roads: str) -> dict[str, Strip]:
    document, notes = read(tmp_path, sample.xodr(*roads))
    shapes = {shape.key: shape for shape in lane_shapes(document, notes)}
    return {strip.id: strip for strip in strips_of(document, shapes, LaneLinks(document), notes)}


def distances_m(points_m: Float64Array, line_m: Float64Array) -> Float64Array:
    """(N,) distances of points to a densely sampled line."""
    gaps_m: Float64Array = np.min(np.linalg.norm(points_m[:, None] - line_m[None], axis=2), axis=1)
    return gaps_m


def test_spiral_from_zero_curvature_is_the_fresnel_integral() -> None:
    length_m, end = 120.0, 1.0 / 40.0
    s_m = np.linspace(0.0, length_m, 50)
    scale = np.sqrt(np.pi * length_m / end)
    sine, cosine = fresnel(s_m / scale)
    points, headings = clothoid(0.0, end / length_m, length_m)(s_m)
    np.testing.assert_allclose(points, scale * (cosine + 1j * sine), atol=1e-9)
    np.testing.assert_allclose(headings, end * s_m**2 / (2.0 * length_m))


@pytest.mark.parametrize(("start", "end"), [(0.05, -0.1), (1e-4, 1e-4 + 1e-13), (-0.2, -0.02), (0.5, 0.6)])
def test_spiral_between_curvatures_integrates_its_direction(start: float, end: float) -> None:
    length_m = 60.0
    rate = (end - start) / length_m
    point = complex(clothoid(start, rate, length_m)(np.array([length_m]))[0][0])

    def part(function: np.ufunc) -> float:
        limits = np.linspace(0.0, length_m, 13)
        pieces = pairwise(limits)
        return sum(quad(lambda s: function(start * s + rate * s * s / 2.0), a, b, epsabs=1e-12)[0] for a, b in pieces)

    assert point == pytest.approx(complex(part(np.cos), part(np.sin)), abs=1e-8)


def test_arc_of_many_turns_stays_on_its_circle() -> None:
    points, _ = clothoid(0.1, 0.0, 400.0)(np.linspace(0.0, 400.0, 200))
    np.testing.assert_allclose(np.abs(points - 10j), 10.0, atol=1e-9)


def test_poly3_is_parametrized_by_arc_length() -> None:
    length_m = 40.0
    curve = parametric_cubic(
        np.array([0.0, 1.0, 0.0, 0.0]), np.array([0.0, 0.2, -0.01, 5e-4]), length_m, None, sample.element()
    )
    point, heading_rad = (value[0] for value in curve(np.array([25.0])))
    u = point.real
    arc_m = quad(lambda p: np.hypot(1.0, 0.2 - 0.02 * p + 15e-4 * p * p), 0.0, u)[0]
    assert arc_m == pytest.approx(25.0, abs=1e-6)
    assert point.imag == pytest.approx(0.2 * u - 0.01 * u**2 + 5e-4 * u**3, abs=1e-9)
    assert np.tan(heading_rad) == pytest.approx(0.2 - 0.02 * u + 15e-4 * u * u)


@pytest.mark.parametrize("p_range", ["normalized", "arcLength"])
def test_both_forms_of_param_poly3_describe_the_same_curve(tmp_path: Path, p_range: str) -> None:
    u, v = np.array([0.0, 30.0, 4.0, -6.0]), np.array([0.0, 0.0, 25.0, -9.0])
    length_m = quad(lambda p: np.hypot(30 + 8 * p - 18 * p * p, 50 * p - 27 * p * p), 0.0, 1.0)[0]
    unit = length_m if p_range == "arcLength" else 1.0
    terms = [
        (f"{name}{axis}", float(row[k] / unit**k))
        for axis, row in (("U", u), ("V", v))
        for k, name in enumerate("abcd")
    ]
    attributes = " ".join(f'{name}="{value!r}"' for name, value in terms)
    shape = f'<paramPoly3 pRange="{p_range}" {attributes}/>'
    document, _ = read(tmp_path, sample.xodr(sample.road(sample.geometry(shape, length_m), length_m)))
    s_m = np.linspace(0.0, length_m, 30)
    xy_m, normals, headings_rad = document.roads["1"].plan(s_m)
    p = np.linspace(0.0, 1.0, 20001)
    curve_m = np.column_stack([np.polynomial.Polynomial(row)(p) for row in (u, v)])
    assert distances_m(xy_m, curve_m).max() < 2e-3
    np.testing.assert_allclose(xy_m[-1], [28.0, 16.0], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(np.diff(xy_m, axis=0), axis=1), s_m[1], rtol=2e-3)
    np.testing.assert_allclose(normals, np.column_stack([-np.sin(headings_rad), np.cos(headings_rad)]), atol=1e-12)


def test_param_poly3_without_p_range_is_normalized(tmp_path: Path) -> None:
    shape = '<paramPoly3 aU="0" bU="10" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>'
    document, _ = read(tmp_path, sample.xodr(sample.road(sample.geometry(shape, 10.0), 10.0)))
    np.testing.assert_allclose(document.roads["1"].plan(np.array([4.0]))[0], [[4.0, 0.0]], atol=1e-9)


def test_borders_of_an_arc_lie_on_concentric_circles_within_a_centimeter(tmp_path: Path) -> None:
    plan = sample.geometry('<arc curvature="-0.04"/>', 60.0)
    strip = strips(tmp_path, sample.road(plan, 60.0, sample.section(sample.lane(-1))))["1/0/-1/0"]
    for line_m, radius_m in ((strip.left_m, 25.0), (strip.right_m, 21.5)):
        middles_m = (line_m[1:] + line_m[:-1]) / 2.0
        for points_m in (line_m, middles_m):
            np.testing.assert_allclose(np.hypot(points_m[:, 0], points_m[:, 1] + 25.0), radius_m, atol=0.0105)
        assert np.linalg.norm(np.diff(line_m, axis=0), axis=1).max() < 5.5


def test_a_corner_between_lines_keeps_the_width_of_lanes(tmp_path: Path) -> None:
    plan = sample.geometry(sample.LINE, 20.0) + sample.geometry(sample.LINE, 20.0, s=20.0, x=20.0, hdg=np.pi / 6)
    strip = strips(tmp_path, sample.road(plan, 40.0))["1/0/-1/0"]
    corner = np.flatnonzero(np.abs(strip.left_m[:, :2] - [20.0, 0.0]).max(axis=1) < 1e-9)[0]
    np.testing.assert_allclose(strip.right_m[corner, 1], -3.5, atol=1e-9)
    outward = np.array([np.sin(np.pi / 6), -np.cos(np.pi / 6)])
    assert (strip.right_m[corner, :2] - [20.0, 0.0]) @ outward == pytest.approx(3.5)


def test_superelevation_rotates_the_road_about_its_reference_line(tmp_path: Path) -> None:
    roll_rad = 0.1
    more = "<elevationProfile>" + sample.cubic("elevation", 7.0, 0.02) + "</elevationProfile>"
    more += "<lateralProfile>" + sample.cubic("superelevation", roll_rad) + "</lateralProfile>"
    made = strips(tmp_path, sample.straight_road(sections=sample.section(sample.lane(1), sample.lane(-1)), more=more))
    right, left = made["1/0/-1/0"], made["1/0/1/0"]
    np.testing.assert_allclose(right.right_m[:, 1], -3.5 * np.cos(roll_rad))
    np.testing.assert_allclose(right.right_m[:, 2], 7.0 + 0.02 * right.right_m[:, 0] - 3.5 * np.sin(roll_rad))
    np.testing.assert_allclose(left.right_m[:, 2] - left.left_m[:, 2], 3.5 * np.sin(roll_rad))


def test_a_level_lane_does_not_follow_the_superelevation(tmp_path: Path) -> None:
    lanes = sample.lane(-1) + sample.lane(-2, "sidewalk", attributes='level="true"')
    more = "<lateralProfile>" + sample.cubic("superelevation", 0.1) + "</lateralProfile>"
    walk = strips(tmp_path, sample.straight_road(sections=sample.section(lanes), more=more))["1/0/-2/0"]
    np.testing.assert_allclose(walk.right_m[:, 2], -3.5 * np.sin(0.1))
    np.testing.assert_allclose(walk.right_m[:, 1], -3.5 * np.cos(0.1) - 3.5)


def test_crossfall_falls_outward_on_both_sides(tmp_path: Path) -> None:
    fall = sample.cubic("crossfall", 0.05).replace("<crossfall", '<crossfall side="both"')
    more = f"<lateralProfile>{fall}</lateralProfile>"
    made = strips(tmp_path, sample.straight_road(sections=sample.section(sample.lane(1), sample.lane(-1)), more=more))
    for strip in made.values():
        np.testing.assert_allclose(strip.left_m[:, 2], 0.0, atol=1e-12)
        np.testing.assert_allclose(strip.right_m[:, 2], -3.5 * np.tan(0.05))


def test_lateral_shape_is_interpolated_between_its_stations(tmp_path: Path) -> None:
    shapes = [sample.cubic("shape", 0.0, slope, s=s, t=-10.0) for s, slope in ((0.0, 0.02), (100.0, 0.06))]
    strip = strips(tmp_path, sample.straight_road(more=f"<lateralProfile>{''.join(shapes)}</lateralProfile>"))[
        "1/0/-1/0"
    ]
    slope = np.interp(strip.right_m[:, 0], [0.0, 100.0], [0.02, 0.06])
    np.testing.assert_allclose(strip.right_m[:, 2], slope * 6.5, atol=1e-9)
    np.testing.assert_allclose(strip.left_m[:, 2], slope * 10.0, atol=1e-9)


def test_widths_offsets_and_borders_add_up(tmp_path: Path) -> None:
    offset = sample.cubic("laneOffset", 1.0, s=0.0) + sample.cubic("laneOffset", 1.0, 0.0, 0.01, s=50.0)
    lanes = sample.lane(-1, inner=sample.width(3.0, 0.02)) + sample.lane(
        -2, inner=sample.width(2.0) + sample.width(4.0, at=30.0)
    )
    made = strips(tmp_path, sample.straight_road(sections=sample.section(lanes), offset=offset))
    inner, outer = made["1/0/-1/0"], made["1/0/-2/0"]
    x_m = inner.left_m[:, 0]
    center_m = 1.0 + np.where(x_m > 50.0, 0.01 * (x_m - 50.0) ** 2, 0.0)
    np.testing.assert_allclose(inner.left_m[:, 1], center_m, atol=1e-9)
    np.testing.assert_allclose(inner.right_m[:, 1], center_m - 3.0 - 0.02 * x_m, atol=1e-9)
    np.testing.assert_array_equal(outer.left_m, inner.right_m)
    np.testing.assert_allclose((outer.left_m - outer.right_m)[:, 1], np.where(x_m < 30.0 - 1e-6, 2.0, 4.0))


def test_border_records_do_not_depend_on_inner_lanes(tmp_path: Path) -> None:
    border = sample.cubic("border", -5.0, -0.01, sOffset=0.0)
    lanes = sample.lane(-1, inner=sample.width(2.0, 0.01)) + sample.lane(-2, inner=border)
    outer = strips(tmp_path, sample.straight_road(sections=sample.section(lanes)))["1/0/-2/0"]
    np.testing.assert_allclose(outer.right_m[:, 1], -5.0 - 0.01 * outer.right_m[:, 0])


def test_stretches_without_width_are_left_out(tmp_path: Path) -> None:
    opening = sample.width(0.0) + sample.width(0.0, 0.1, at=40.0)
    lanes = sample.lane(-1) + sample.lane(-2, inner=opening) + sample.lane(-3, inner=sample.width(0.0))
    made = strips(tmp_path, sample.straight_road(sections=sample.section(lanes)))
    assert set(made) == {"1/0/-1/0", "1/0/-2/0"}
    strip = made["1/0/-2/0"]
    assert strip.s_start_m == pytest.approx(40.0)
    np.testing.assert_allclose(strip.left_m[[0, -1], 0], [40.0, 100.0])
