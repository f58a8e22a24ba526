"""Invalid OpenDRIVE files: each gives a clear error or a repair with a note."""

import re
from pathlib import Path

import numpy as np
import pytest
import xodr_sample as sample

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.findings import sentences_of
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.parts import MapParts

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
        (sample.xodr(GOOD.replace("3.5", "3e5")), "out of bounds or far too wide"),
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
        ('<geometry s="0" x="0" y="0" hdg="0" length="-10"><line/></geometry>', "it has no geometry"),
        ('<geometry s="0" x="0" y="0" hdg="0" length="10"/>', "it has none of line, arc"),
        ('<geometry s="0" x="0" y="0" hdg="0" length="10"><arc curvature="1e6"/></geometry>', "it turns by 1e"),
        ('<geometry s="0" x="0" y="0" hdg="0" length="10"><arc/></geometry>', "attribute 'curvature' is missing"),
        (
            '<geometry s="0" x="0" y="0" hdg="0" length="10"><paramPoly3 pRange="normalized" '
            'aU="0" bU="0" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/></geometry>',
            "the curve stands still",
        ),
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


def test_two_long_geometries_at_the_same_distance_cost_only_their_road(tmp_path: Path) -> None:
    twice = sample.geometry(sample.LINE, 5.0) + sample.geometry(sample.LINE, 10.0, y=9.0)
    parts = import_text(tmp_path, sample.xodr(GOOD, sample.road(twice, 10.0, number="8")))
    assert {strip.road for strip in parts.layout.strips} == {"7"}
    assert any("two geometries start at the same s" in text for text in sentences_of("sample.xodr", parts.findings))


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
