"""Invalid OpenDRIVE files: each gives a clear error or a repair with a note."""

import re
from pathlib import Path

import numpy as np
import pytest
import shapely
import xodr_sample as sample

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.findings import WALKED_VERGES, sentences_of
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.parts import MapParts

STRANGERS = Path(__file__).parents[2].parent / "shared/maps/foreign/small"
GOOD = sample.road(sample.geometry(sample.LINE, 80.0, y=50.0), 80.0, number="7")


def import_text(tmp_path: Path, text: str) -> MapParts:
    path, work = tmp_path / "sample.xodr", tmp_path / "work"
    path.write_text(text, encoding="utf-8")
    work.mkdir(exist_ok=True)
    return import_opendrive(path, work)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (sample.xodr(GOOD)[:-30], r"sample\.xodr:2:\d+: .*ends too early"),
        (
            sample.xodr(GOOD).replace("<OpenDRIVE>", "<!DOCTYPE x [<!ENTITY a 'b'>]><OpenDRIVE>"),
            r"sample\.xodr:2: .*DOCTYPE",
        ),
        ("<net/>", r"sample\.xodr:1: the root element must be <OpenDRIVE>"),
        (sample.xodr(), r"sample\.xodr:2: it has no drivable lane"),
        (
            sample.xodr(sample.straight_road(sections=sample.section(sample.lane(-1, "sidewalk")))),
            "no drivable lane",
        ),
        (sample.xodr(sample.road("", 10.0)), "no drivable lane.*road 1: <road>: it has no geometry"),
        (sample.xodr(GOOD, header='<header revMajor="2"/>'), "revMajor='2'"),
        (sample.xodr(GOOD.replace("80.0", "2e8")), "not between 1 mm and 200 km"),
        (sample.xodr(GOOD.replace("3.5", "3e5")), "no drivable lane; sample.xodr:2: a <width> with values beyond 200"),
    ],
)
def test_unusable_files_are_refused_with_their_location(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        import_text(tmp_path, text)


@pytest.mark.parametrize(
    ("wrong", "note"),
    [
        ('<geometry s="0" x="nan" y="0" hdg="0" length="10"><line/></geometry>', r"x='nan' is not a finite number"),
        ('<geometry s="0" x="inf" y="0" hdg="0" length="10"><line/></geometry>', r"x='inf' is not a finite number"),
        ('<geometry s="0" y="0" hdg="0" length="10"><line/></geometry>', r"attribute 'x' is missing"),
    ],
)
def test_a_road_with_unusable_geometry_is_left_out_with_a_note(tmp_path: Path, wrong: str, note: str) -> None:
    parts = import_text(tmp_path, sample.xodr(GOOD, sample.road(wrong, 10.0, number="8")))
    assert {strip.road for strip in parts.layout.strips} == {"7"}
    (found,) = [text for text in sentences_of("sample.xodr", parts.findings) if "left out (road 8" in text]
    assert re.search(note, found)
    assert found.startswith("sample.xodr:2: ")


@pytest.mark.parametrize(
    ("old", "new", "note"),
    [
        ('length="80.0" junction', 'length="NaN" junction', "length is not that of its geometry"),
        ('length="80.0" junction', 'length="1e300" junction', "length is not that of its geometry"),
        ('length="80.0" junction', 'length="0" junction', "length is not that of its geometry"),
        ("<width", '<speed max="fast"/><width', "speed limit that cannot be read"),
        ("<width", '<roadMark type="wavy" color="mauve"/><width', "unknown kind or color of road mark"),
        (
            "<lanes>",
            '<objects><object type="crosswalk" id="1" s="x" t="0"/></objects><lanes>',
            "crosswalk that cannot be",
        ),
        ("<lanes>", '<signals><signal type="206" s="x" t="0"/></signals><lanes>', "signal that cannot be read"),
        ("</lanes>", sample.section(sample.lane(-1), s=900.0) + "</lanes>", "section beyond the road's end"),
        ("</OpenDRIVE>", GOOD + "</OpenDRIVE>", "the id of an earlier one"),
        (
            "</OpenDRIVE>",
            '<junction id="3"><connection id="0" incomingRoad="7" connectingRoad="99" contactPoint="start"/></junction>'
            "</OpenDRIVE>",
            "connection of missing roads",
        ),
        ("<planView>", "<planView>" + sample.geometry(sample.LINE, 0.0), "geometry> without length"),
        ("<planView>", "<planView>" + sample.geometry(sample.LINE, 7e-6), "geometry> that ends where it starts"),
    ],
)
def test_repairable_files_are_repaired_with_a_note(tmp_path: Path, old: str, new: str, note: str) -> None:
    parts = import_text(tmp_path, sample.xodr(GOOD).replace(old, new, 1))
    (strip,) = parts.layout.strips
    np.testing.assert_allclose(strip.left_m[-1], [80.0, 50.0, 0.0])
    assert any(note in text for text in sentences_of("sample.xodr", parts.findings))


PLAN = (
    sample.geometry(sample.LINE, 30.0),
    sample.geometry('<arc curvature="0.01"/>', 20.0, s=30.0, x=30.0),
    sample.geometry(sample.LINE, 30.0, s=50.0, x=49.866933, y=1.993342, hdg=0.2),
)
FLAT = {"elevation": 2.0, "superelevation": 0.0, "laneOffset": 0.0, "width": 3.5}
SHAPED = sample.road(
    "".join(PLAN),
    80.0,
    sections=sample.section(sample.lane(1), sample.lane(-1), sample.lane(-2, "sidewalk")),
    more="<elevationProfile>" + sample.cubic("elevation", 2.0) + "</elevationProfile><lateralProfile>"
    + sample.cubic("superelevation", 0.0) + "</lateralProfile>",
    offset=sample.cubic("laneOffset", 0.0),
)  # fmt: skip
THIRD = '<arc curvature="0.01"/>'


def records(tag: str, *starts: str, value: str = "7") -> str:
    name = "sOffset" if tag == "width" else "s"
    return "".join(f'<{tag} {name}="{start}" a="{value}" b="0" c="0" d="0"/>' for start in starts)


@pytest.mark.parametrize("tag", FLAT)
@pytest.mark.parametrize(
    ("start", "value", "note"),
    [("20.0x", "nan", "that cannot be read is left out"), ("20", "9e9", "is left out"), ("20", "", "cannot be read")],
)
def test_a_record_with_a_bad_number_costs_only_itself(
    tmp_path: Path, tag: str, start: str, value: str, note: str
) -> None:
    good = sample.cubic(tag, FLAT[tag], **{"sOffset" if tag == "width" else "s": 0.0})
    text = sample.xodr(SHAPED)
    expected = import_text(tmp_path, text).layout
    parts = import_text(tmp_path, text.replace(good, good + records(tag, start, value=value)))
    assert parts.layout is not None and expected is not None
    for strip, whole in zip(parts.layout.strips, expected.strips, strict=True):
        for points_m in (strip.left_m, strip.right_m):
            distance = shapely.LineString(whole.left_m).union(shapely.LineString(whole.right_m))
            assert shapely.distance(shapely.points(points_m), distance).max() < 0.02
    assert any(note in text and f"<{tag}" in text for text in sentences_of("sample.xodr", parts.findings))


@pytest.mark.parametrize("tag", FLAT)
@pytest.mark.parametrize("start", ["0.000000+0", "", "x", "nan", None])
def test_a_record_without_a_readable_start_begins_at_the_start(tmp_path: Path, tag: str, start: str | None) -> None:
    name = "sOffset" if tag == "width" else "s"
    text = sample.xodr(SHAPED).replace(
        f'<{tag} {name}="0.0"', f"<{tag}" + ("" if start is None else f' {name}="{start}"')
    )
    parts = import_text(tmp_path, text)
    assert parts.layout is not None
    (lane,) = [strip for strip in parts.layout.strips if strip.index == -1]
    np.testing.assert_allclose(lane.right_m[0], [0.0, -3.5, 2.0], atol=1e-9)
    assert any(f"<{tag}" in text for text in sentences_of("sample.xodr", parts.findings))


@pytest.mark.parametrize(
    ("old", "new", "note"),
    [
        (THIRD, "<spiral curvEnd='0.0'/>", "a number that a curve lacks is 0 (<spiral>: curvStart)"),
        (THIRD, "<spiral curvStart='x' curvEnd='0.01'/>", "curvStart='x' is not a number"),
        (THIRD, "<arc curvature='1e6'/>", "it turns by"),
        (THIRD, "<helix/>", "it has none of line"),
        (THIRD, "", "it has none of line"),
        (THIRD, '<paramPoly3 aU="0" bU="0" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>', "the curve stands still"),
        (THIRD, '<paramPoly3 aU="0" bU="1e9" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>', "the curve reaches 1e+09 m"),
        ('x="30.0"', 'x="nan"', "x='nan' is not a finite number"),
        ('x="30.0"', 'x="1e7"', "x='1e7' is not a finite number of at most 100000"),
        ('x="30.0"', "", "attribute 'x' is missing"),
        ('s="30.0"', 's="x"', "s='x' is not a number"),
        ('s="30.0"', 's="-1e9"', "s='-1e9' is not"),
        ('length="20.0"', 'length="inf"', "length='inf' is not"),
        ('length="20.0"', 'length="-20"', "length=-20 is less than"),
        (PLAN[0], PLAN[0].replace('y="0.0"', 'y="inf"'), "y='inf' is not"),
        (PLAN[2], PLAN[2].replace('hdg="0.2"', 'hdg=""'), "hdg='' is not a number"),
        (
            "</planView>",
            sample.geometry(sample.LINE, 5.0) + "</planView>",
            "starts where a longer one does is left out",
        ),
    ],
)
def test_a_bad_geometry_costs_only_itself(tmp_path: Path, old: str, new: str, note: str) -> None:
    text = sample.xodr(SHAPED)
    assert text.count(old) >= 1
    parts = import_text(tmp_path, text.replace(old, new, 1))
    assert parts.layout is not None
    (lane,) = [strip for strip in parts.layout.strips if strip.index == 1]
    middle_m = shapely.LineString(lane.left_m[:, :2])
    for point in ([1.0, 0.0], [29.0, 0.0], [65.0, 5.06]):
        assert middle_m.distance(shapely.Point(point)) < 0.7, "before and after it"
    assert any(note in text for text in sentences_of("sample.xodr", parts.findings))


def test_a_curve_that_starts_at_rest_is_read(tmp_path: Path) -> None:
    at_rest = '<paramPoly3 pRange="normalized" aU="0" bU="0" cU="80" dU="0" aV="0" bV="0" cV="0" dV="0"/>'
    parts = import_text(tmp_path, sample.xodr(GOOD.replace(sample.LINE, at_rest)))
    assert parts.layout is not None
    (strip,) = parts.layout.strips
    np.testing.assert_allclose(strip.left_m[[0, -1]], [[0.0, 50.0, 0.0], [80.0, 50.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(strip.right_m[:, 1], 46.5)
    assert {finding.rule for finding in parts.findings} == {WALKED_VERGES}


@pytest.mark.parametrize(
    ("old", "new", "lanes", "note"),
    [
        ('id="-1" type', 'id="1" type', {1, -2}, "a lane with the id of an earlier one is left out (lane 1)"),
        ('id="1" type', 'id="-3" type', {-1, -2, -3}, "a lane with an id of the other side is moved there (lane -3)"),
        ('id="-2" type', 'id="-1" type', {1, -1}, "a lane with the id of an earlier one is left out (lane -1)"),
        ('id="1" type', 'id="x" type', {-1, -2}, "a lane without an id of its side is left out (<lane>: id='x'"),
        ('id="1" type', 'id="0" type', {-1, -2}, "a lane without an id of its side is left out (lane 0)"),
        ('id="-1" type', 'id="-1.0" type', {1, -1, -2}, ""),
    ],
)
def test_a_bad_lane_id_costs_only_its_lane(tmp_path: Path, old: str, new: str, lanes: set[int], note: str) -> None:
    parts = import_text(tmp_path, sample.xodr(SHAPED.replace(old, new, 1)))
    assert parts.layout is not None
    assert {strip.index for strip in parts.layout.strips} == lanes
    notes = sentences_of("sample.xodr", parts.findings)
    assert any(note in text for text in notes) if note else notes == ()


@pytest.mark.parametrize(
    ("content", "note"),
    [
        ('<roadMark sOffset="0" type="custom"><type><line tOffset="x"/></type></roadMark>', "a road mark that cannot"),
        ('<roadMark sOffset="nan" type="solid"/>', "a record without a readable start begins at 0"),
        ('<speed sOffset="x" max="30"/>', "a record without a readable start begins at 0"),
        ('<link><successor id="x"/></link>', "a link of a lane that cannot be read is left out"),
    ],
)
def test_a_bad_part_of_a_lane_costs_only_itself(tmp_path: Path, content: str, note: str) -> None:
    parts = import_text(tmp_path, sample.xodr(GOOD.replace("<width", content + "<width", 1)))
    assert parts.layout is not None and len(parts.layout.strips) == 1
    assert any(note in text for text in sentences_of("sample.xodr", parts.findings))


def test_a_signal_keeps_what_can_be_read(tmp_path: Path) -> None:
    bad = '<signals><signal id="1" type="206" s="75" t="-5"><validity fromLane="x" toLane="-1"/></signal></signals>'
    parts = import_text(tmp_path, sample.xodr(GOOD.replace("<lanes>", bad + "<lanes>")))
    assert parts.layout is not None and len(parts.layout.signs or ()) == 1
    assert any("a validity of a signal" in text for text in sentences_of("sample.xodr", parts.findings))


@pytest.mark.skipif(not STRANGERS.exists(), reason="the maps of strangers are not here")
def test_the_road_of_a_stranger_with_odd_numbers_opens(tmp_path: Path) -> None:
    parts = import_text(tmp_path, (STRANGERS / "elevation_s_0.000000+0.xodr").read_text())
    assert parts.layout is not None and {strip.road for strip in parts.layout.strips} == {"4451"}
    assert any("s='0.000000+0'" in text for text in sentences_of("sample.xodr", parts.findings))


def test_the_steep_width_of_a_lane_section_of_micrometers_is_used(tmp_path: Path) -> None:
    widths = {0.0: (3.5,), 40.0: (3.5, 0.0, -6e12, 4e18), 40.000001: (3.0,)}
    lanes = {s: sample.lane(-1, inner=sample.linked(-1, -1) + sample.width(*width)) for s, width in widths.items()}
    sections = "".join(sample.section(lane, s=s) for s, lane in lanes.items())
    parts = import_text(tmp_path, sample.xodr(sample.straight_road(80.0, sections=sections)))
    first, last = (strip for strip in parts.layout.strips)
    assert first.following == (last.lane,)
    for strip, width_m in ((first, 3.5), (last, 3.0)):
        np.testing.assert_allclose(strip.left_m[:, 1] - strip.right_m[:, 1], width_m)
    np.testing.assert_allclose(first.left_m[-1], last.left_m[0], atol=1e-5)


@pytest.mark.slow
def test_mangled_numbers_result_in_a_map_or_an_input_error(tmp_path: Path) -> None:
    more = "<elevationProfile>" + sample.cubic("elevation", 1.0, 0.1) + "</elevationProfile>"
    signals = '<signals><signal id="1" type="206" s="95" t="-5" orientation="+"/></signals>'
    text = sample.xodr(
        sample.straight_road(sections=sample.section(sample.lane(1), sample.lane(-1)), more=more + signals)
    )
    spans = [match.span(1) for match in re.finditer(r'"(-?[\d.]+)"', text)]
    for number, (start, end) in enumerate(spans):
        wrong = ("", "nan", "-1e9", "1e-9", "x", "1e308")[number % 6]
        try:
            parts = import_text(tmp_path, text[:start] + wrong + text[end:])
        except InputError as error:
            assert "sample.xodr" in str(error)
        else:
            assert all(np.isfinite(strip.left_m).all() for strip in parts.layout.strips)


def test_a_file_in_another_encoding_is_published_as_utf_8(tmp_path: Path) -> None:
    text = sample.xodr(GOOD.replace("<road ", '<road name="Straße" ')).replace(
        'version="1.0"', 'version="1.0" encoding="ISO-8859-1"'
    )
    path, work = tmp_path / "sample.xodr", tmp_path / "work"
    path.write_bytes(text.encode("iso-8859-1"))
    work.mkdir()
    assert 'name="Straße"' in import_opendrive(path, work).opendrive.read_text(encoding="utf-8")
