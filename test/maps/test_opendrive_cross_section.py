"""Cross-sections of OpenDRIVE roads compared with values worked by hand from the standard, 1.4 to 1.8."""

from pathlib import Path

import numpy as np
import pytest
import xodr_sample as sample
from test_opendrive_geometry import read, strips

from simbev_ros.maps.columns import from_columns, to_columns
from simbev_ros.maps.opendrive.lane_shapes import lane_shapes
from simbev_ros.maps.roads.layout import Strip


def profile(*records: str) -> str:
    return "<lateralProfile>" + "".join(records) + "</lateralProfile>"


def lane_height(inner: float, outer: float, at: float = 0.0) -> str:
    return f'<height sOffset="{at!r}" inner="{inner!r}" outer="{outer!r}"/>'


def made_of(tmp_path: Path, *lanes: str, more: str = "", offset: str = "") -> dict[str, Strip]:
    return strips(tmp_path, sample.straight_road(sections=sample.section(*lanes), more=more, offset=offset))


def heights_of(strip: Strip) -> tuple[float, float]:
    """Heights of the left and the right border at the strip's start."""
    return float(strip.left_m[0, 2]), float(strip.right_m[0, 2])


def test_positive_superelevation_lifts_the_left_side(tmp_path: Path) -> None:
    made = made_of(tmp_path, sample.lane(1), sample.lane(-1), more=profile(sample.cubic("superelevation", 0.1)))
    assert heights_of(made["1/0/-1/0"]) == pytest.approx((0.0, -3.5 * np.sin(0.1)))
    assert sorted(heights_of(made["1/0/1/0"])) == pytest.approx([0.0, 3.5 * np.sin(0.1)])


@pytest.mark.parametrize(("side", "left", "right"), [("both", 1.0, 1.0), ("left", 1.0, 0.0), ("right", 0.0, 1.0)])
def test_positive_crossfall_falls_outward_on_its_side(tmp_path: Path, side: str, left: float, right: float) -> None:
    fall = sample.cubic("crossfall", 0.03).replace("<crossfall", f'<crossfall side="{side}"')
    made = made_of(tmp_path, sample.lane(1), sample.lane(-1), more=profile(fall))
    assert min(heights_of(made["1/0/1/0"])) == pytest.approx(-left * 3.5 * np.tan(0.03))
    assert min(heights_of(made["1/0/-1/0"])) == pytest.approx(-right * 3.5 * np.tan(0.03))


def test_crossfall_counts_from_the_reference_line_even_where_lanes_are_offset(tmp_path: Path) -> None:
    offset = sample.cubic("laneOffset", 1.0)
    made = made_of(tmp_path, sample.lane(-1), more=profile(sample.cubic("crossfall", 0.03)), offset=offset)
    strip = made["1/0/-1/0"]
    assert strip.left_m[0, 1] == pytest.approx(1.0)
    assert heights_of(strip) == pytest.approx((-1.0 * np.tan(0.03), -2.5 * np.tan(0.03)))


def test_the_crown_of_the_standards_example_has_its_heights(tmp_path: Path) -> None:
    """The example of a linear crown: 0 up to t = -3, 0.15 per meter up to the middle, then 0.1 per meter down."""
    rows = ((-4.0, 0.0, 0.0), (-3.0, 0.0, 0.15), (0.0, 0.45, -0.1), (4.0, 0.05, 0.0))
    shapes = [sample.cubic("shape", a, b, s=0.0, t=t) for t, a, b in rows]
    lanes = [sample.lane(k, inner=sample.width(w)) for k, w in ((2, 1.0), (1, 3.0), (-1, 3.0), (-2, 1.0))]
    made = made_of(tmp_path, *lanes, more=profile(*shapes))
    assert heights_of(made["1/0/-1/0"]) == pytest.approx((0.45, 0.0))
    assert heights_of(made["1/0/-2/0"]) == pytest.approx((0.0, 0.0))
    assert sorted(heights_of(made["1/0/2/0"])) == pytest.approx([0.05, 0.15])


def test_shapes_are_interpolated_linearly_along_the_road(tmp_path: Path) -> None:
    shapes = [sample.cubic("shape", 0.0, slope, s=s, t=-10.0) for s, slope in ((20.0, 0.0), (60.0, 0.04))]
    strip = made_of(tmp_path, sample.lane(-1), more=profile(*shapes))["1/0/-1/0"]
    slope = np.interp(strip.left_m[:, 0], [20.0, 60.0], [0.0, 0.04])
    np.testing.assert_allclose(strip.left_m[:, 2], 10.0 * slope, atol=1e-9)
    np.testing.assert_allclose(strip.right_m[:, 2], 6.5 * slope, atol=1e-9)


def test_a_lane_on_level_continues_at_the_height_of_its_inner_border(tmp_path: Path) -> None:
    lanes = sample.lane(-1), sample.lane(-2, "sidewalk", sample.width(2.0), 'level="true"')
    records = sample.cubic("superelevation", 0.1), sample.cubic("crossfall", 0.02)
    outer = made_of(tmp_path, *lanes, more=profile(*records))["1/0/-2/0"]
    level_m = -3.5 * np.sin(0.1) - 3.5 * np.tan(0.02) * np.cos(0.1)
    assert heights_of(outer) == pytest.approx((level_m, level_m))
    assert outer.left_m[0, 1] - outer.right_m[0, 1] == pytest.approx(2.0), "its width is horizontal"


def test_a_lane_on_level_ignores_the_shape_beside_it(tmp_path: Path) -> None:
    lanes = sample.lane(-1), sample.lane(-2, "sidewalk", sample.width(2.0), 'level="true"')
    shape = sample.cubic("shape", 0.0, 0.04, s=0.0, t=-10.0)
    outer = made_of(tmp_path, *lanes, more=profile(shape))["1/0/-2/0"]
    assert heights_of(outer) == pytest.approx((0.26, 0.26)), "0.04 times 10 - 3.5"


def test_heights_of_a_lane_are_those_of_its_inner_and_outer_border(tmp_path: Path) -> None:
    lanes = sample.lane(1, "sidewalk", lane_height(0.05, 0.2)), sample.lane(-1, "bicycle", lane_height(0.05, 0.2))
    made = made_of(tmp_path, *lanes)
    assert made["1/0/-1/0"].raised_m is not None
    np.testing.assert_allclose(made["1/0/-1/0"].raised_m[0], [0.05, 0.2])
    walk = made["1/0/1/0"]
    assert walk.raised_m is not None
    outer = np.abs(np.stack([walk.left_m[0, 1], walk.right_m[0, 1]])).argmax()
    assert walk.raised_m[0, outer] == 0.2
    assert heights_of(walk) == (0.0, 0.0), "borders remain in the carriageway's plane"


def test_heights_are_linear_between_records(tmp_path: Path) -> None:
    records = lane_height(0.0, 0.0, 30.0) + lane_height(0.1, 0.2, 50.0)
    strip = made_of(tmp_path, sample.lane(-1, "bicycle", records))["1/0/-1/0"]
    assert strip.raised_m is not None
    x = strip.left_m[:, 0]
    assert {30.0, 50.0} <= set(x.tolist())
    np.testing.assert_allclose(strip.raised_m[:, 1], np.interp(x, [30.0, 50.0], [0.0, 0.2]))


def test_the_usual_curb_height_is_not_stored(tmp_path: Path) -> None:
    lanes = sample.lane(-1, inner=lane_height(0.0, 0.0)), sample.lane(-2, "sidewalk", lane_height(0.12, 0.12))
    made = list(made_of(tmp_path, *lanes).values())
    assert [strip.raised_m for strip in made] == [None, None]
    columns = to_columns(Strip, made)
    assert not any(name.startswith(("raised_m", "tunnel")) for name in columns)
    assert [strip.raised_m for strip in from_columns(Strip, columns)] == [None, None]


def test_stored_heights_are_read_back(tmp_path: Path) -> None:
    made = list(made_of(tmp_path, sample.lane(-1), sample.lane(-2, "sidewalk", lane_height(0.0, 0.1))).values())
    first, second = from_columns(Strip, to_columns(Strip, made))
    assert first.raised_m is None
    np.testing.assert_array_equal(second.raised_m, made[1].raised_m)


@pytest.mark.parametrize(
    ("record", "note"),
    [('<height inner="x" outer="0"/>', "cannot be read"), ('<height inner="0" outer="5"/>', "more than 2 m")],
)
def test_heights_that_cannot_be_used_are_left_out_with_a_note(tmp_path: Path, record: str, note: str) -> None:
    road = sample.straight_road(sections=sample.section(sample.lane(-1, inner=record)))
    document, notes = read(tmp_path, sample.xodr(road))
    assert next(iter(lane_shapes(document, notes))).raised_m is None
    assert note in notes.sentences()[0]
