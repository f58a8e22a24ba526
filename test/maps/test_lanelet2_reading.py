"""Points, frames and shapes of Lanelet2 files, by cases worked by hand; unusable elements are left out with a note."""

import math
from pathlib import Path

import numpy as np
import pytest
from lanelet2_sample import SQUARE_UTM_M, LaneletSample, straight_lane
from pyproj import Transformer

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.lanelet2.importer import import_lanelet2
from simbev_ros.maps.lanelet2.projector_info import datum_of_file, datum_of_grid
from simbev_ros.maps.lanelet2.reader import has_lanelets, read_lanelet_map
from simbev_ros.maps.lanelet2.shapes import LaneletShape, lanelet_shapes, pair_borders
from simbev_ros.maps.lanelet2.tags import parse_speed_mps


def read(folder: Path, text: str) -> tuple[list[LaneletShape], MapDatum, tuple[str, ...]]:
    path = folder / "map.osm"
    path.write_text(text, encoding="utf-8")
    notes = Findings(path)
    source, datum = read_lanelet_map(path, notes)
    return list(lanelet_shapes(source, notes)), datum, notes.sentences()


def one_lane(local: bool = True, on_earth: bool = True, origin_m: tuple[float, float] = (5000.0, 5000.0)) -> str:
    sample = LaneletSample(origin_m, local, on_earth)
    straight_lane(sample, [0.0, 100.0], -2.0, 2.0)
    return sample.text()


def test_mgrs_squares_start_where_published_positions_lie() -> None:
    # The test map of autoware_lanelet2_extension has this point at (100, 100) of 54SUE.
    datum = datum_of_grid("54SUE")
    assert datum is not None
    assert datum.map_from_geodetic(35.22404592461, 138.8035321072, 0.0) == pytest.approx((100.0, 100.0, 0.0), abs=1e-3)
    # Sydney's Opera House is in 56HLH, and (0° N, 3° E), where a central meridian meets the equator, in 31NEA.
    opera, equator = datum_of_grid("56HLH"), datum_of_grid("31NEA")
    assert opera is not None and equator is not None
    assert all(0.0 < value < 100e3 for value in opera.map_from_geodetic(-33.8568, 151.2153, 1.0))
    assert equator.map_from_geodetic(0.0, 3.0, 0.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("grid", ["", "54", "61SUE", "54IUE", "54SAE", "54SUW"])
def test_names_that_are_no_mgrs_square_are_refused(grid: str) -> None:
    assert datum_of_grid(grid) is None


@pytest.mark.parametrize(("local", "on_earth"), [(True, True), (False, True)])
def test_points_keep_their_position_on_earth(tmp_path: Path, local: bool, on_earth: bool) -> None:
    (shape,), datum, _ = read(tmp_path, one_lane(local, on_earth))
    to_earth = Transformer.from_crs("EPSG:32654", "EPSG:4326", always_xy=True)
    east_m, north_m = SQUARE_UTM_M
    for point_m, xy_m in ((shape.right_m[0], (5000.0, 4998.0)), (shape.left_m[-1], (5100.0, 5002.0))):
        latitude, longitude, _ = datum.geodetic_from_map(point_m)
        expected = to_earth.transform(east_m + xy_m[0], north_m + xy_m[1])
        assert (longitude, latitude) == pytest.approx(expected, abs=1e-7)  # 1 cm
        if local:
            assert point_m[:2] == pytest.approx(xy_m, abs=1e-3)


def test_local_coordinates_far_from_their_origin_are_shifted_with_their_datum(tmp_path: Path) -> None:
    (shape,), datum, notes = read(tmp_path, one_lane(origin_m=(89_000.0, 42_000.0)))
    assert np.abs(shape.left_m[:, :2]).max() < 100.0
    assert "map (0, 0) is its (89050, 42000)" in notes[0]
    to_earth = Transformer.from_crs("EPSG:32654", "EPSG:4326", always_xy=True)
    latitude, longitude, _ = datum.geodetic_from_map((0.0, 0.0, 0.0))
    assert (longitude, latitude) == pytest.approx(to_earth.transform(389_050.0, 3_942_000.0), abs=1e-7)


def test_coordinates_in_a_turned_frame_of_their_own_are_placed_by_their_latitudes(tmp_path: Path) -> None:
    center = MapDatum(48.0, 9.0, 0.0)
    sample = LaneletSample((0.0, 0.0))
    straight_lane(sample, [0.0, 100.0], -2.0, 2.0)
    for node in sample.nodes():
        tags = {tag.get("k"): float(tag.get("v", "")) for tag in node}
        turned = (-tags["local_y"], tags["local_x"], 0.0)  # x points north
        latitude, longitude, _ = center.geodetic_from_map(turned)
        node.set("lat", f"{latitude:.11f}")
        node.set("lon", f"{longitude:.11f}")
    (shape,), datum, _ = read(tmp_path, sample.text())
    assert datum.heading_rad == pytest.approx(math.pi / 2.0, abs=1e-4)
    assert datum.geodetic_from_map(shape.left_m[-1])[:2] == pytest.approx(
        center.geodetic_from_map((-2.0, 100.0, 0.0))[:2], abs=1e-7
    )


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("projector_type: MGRS\nmgrs_grid: 54SUE\n", (35.223125, 138.802458)),
        ("projector_type: LocalCartesianUTM\nmap_origin: {latitude: 48.5, longitude: 9.5}\n", (48.5, 9.5)),
        ("projector_type: TransverseMercator\nmap_origin: {latitude: -30, longitude: 9.5}\n", (-30.0, 9.5)),
        ("projector_type: LocalCartesian\nmap_origin: {latitude: 48.5, longitude: 9.5}\n", (48.5, 9.5)),
        ("projector_type: Local\n", (0.0, 0.0)),
    ],
)
def test_the_projector_file_places_local_coordinates(tmp_path: Path, text: str, expected: tuple[float, float]) -> None:
    (tmp_path / "map_projector_info.yaml").write_text(text)
    _, datum, notes = read(tmp_path, one_lane(on_earth=False))
    assert datum.geodetic_from_map((0.0, 0.0, 0.0))[:2] == pytest.approx(expected, abs=1e-6)
    assert (expected == (0.0, 0.0)) == any("no position on Earth" in note for note in notes)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("projector_type: Mercator\n", "projector_type: must be one of MGRS, .*, not 'Mercator'"),
        ("[]", "projector_type: must be one of"),
        ("projector_type: MGRS\nmgrs_grid: 99XX\n", "mgrs_grid: must be a square such as 54SUE, not '99XX'"),
        ("projector_type: LocalCartesian\n", r"map_origin\.latitude: must be a number of at most 90, not None"),
        (
            "projector_type: LocalCartesian\nmap_origin: {latitude: 91, longitude: 0}",
            r"map_origin\.latitude: .*, not 91",
        ),
    ],
)
def test_invalid_projector_files_are_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "map_projector_info.yaml").write_text(text)
    with pytest.raises(InputError, match=rf"map_projector_info\.yaml: {message}"):
        datum_of_file(tmp_path / "map.osm")


@pytest.mark.parametrize("flips", [(False, False), (True, False), (False, True), (True, True)])
def test_bounds_may_run_in_either_direction(tmp_path: Path, flips: tuple[bool, bool]) -> None:
    sample = LaneletSample((0.0, 0.0))
    left, right = ([(0.0, y), (50.0, y), (90.0, y)] for y in (2.0, -2.0))
    lines = [sample.line(line[::-1] if flip else line) for line, flip in zip((left, right), flips, strict=True)]
    sample.lanelet(*lines)
    (shape,), _, _ = read(tmp_path, sample.text())
    assert shape.left_m[[0, -1], :2].tolist() == [[0.0, 2.0], [90.0, 2.0]]
    assert shape.right_m[[0, -1], :2].tolist() == [[0.0, -2.0], [90.0, -2.0]]
    assert shape.flipped == flips
    assert shape.length_m == pytest.approx(90.0)
    assert shape.width_m == pytest.approx(4.0)


def test_paired_borders_keep_all_points_and_lie_across_from_each_other_in_curves() -> None:
    angles = np.radians(np.linspace(0.0, 90.0, 10))
    straight = np.column_stack([np.linspace(-20.0, -2.0, 5)] * 1 + [np.zeros(5)])

    def border(radius_m: float, points: int) -> np.ndarray:
        turn = np.linspace(0.0, angles[-1], points)
        arc = np.column_stack([radius_m * np.sin(turn), 10.0 - radius_m * np.cos(turn)])
        lead = np.column_stack([straight[:, 0], np.full(5, 10.0 - radius_m)])
        return np.column_stack([np.concatenate([lead, arc]), np.zeros(5 + points)])

    inner_m, outer_m = border(6.0, 20), border(10.0, 31)
    left_m, right_m = pair_borders(inner_m, outer_m)
    assert len(left_m) == len(right_m)
    for given, paired in ((inner_m, left_m), (outer_m, right_m)):
        gaps_m = np.linalg.norm(given[:, None] - paired[None], axis=2).min(axis=1)
        assert gaps_m.max() < 2e-3
    widths_m = np.linalg.norm(left_m - right_m, axis=1)
    assert widths_m.min() > 3.9
    assert widths_m.max() < 4.2
    for paired in (left_m, right_m):
        assert np.linalg.norm(np.diff(paired, axis=0), axis=1).sum() == pytest.approx(
            np.linalg.norm(np.diff(inner_m if paired is left_m else outer_m, axis=0), axis=1).sum(), abs=1e-6
        )


def test_unusable_elements_are_left_out_with_a_note(tmp_path: Path) -> None:
    sample = LaneletSample((0.0, 0.0))
    (good,) = straight_lane(sample, [0.0, 100.0], -2.0, 2.0)
    far, near = sample.line([(0.0, 20.0), (50.0, 20.0)]), sample.line([(0.0, 16.0), (50.0, 16.0)])
    sample.lanelet(far, "999999")
    sample.lanelet(sample.line([(0.0, 40.0), (50.0, 44.0)]), sample.line([(0.0, 44.0), (50.0, 40.0)]))
    sample.lanelet(far, near, subtype="launch_pad")
    sample.lanelet(sample.element("way", {}), near)
    sample.element("node", {"ele": "0"}, {"lat": "100", "lon": ""})
    shapes, _, notes = read(tmp_path, sample.text())
    assert [shape.id for shape in shapes] == [good]
    for part in (
        "a lanelet without both bounds is left out (lanelet 14 has no right bound; 2 times; 0.10 km of lanes)",
        "a lanelet with crossing bounds is left out",
        "a lanelet of unknown subtype is left out (subtype='launch_pad')",
        "a point without a usable position is left out",
    ):
        assert any(part in note for note in notes), (part, notes)
    assert any("with crossing bounds" in note and "0.05 km of lanes" in note for note in notes)


def test_bounds_may_cross_a_little(tmp_path: Path) -> None:
    sample = LaneletSample((0.0, 0.0))
    # Worked by hand: the lines meet at x = 48, so that 0.08 m² of 96 m² + 0.08 m² are inverted.
    sample.lanelet(sample.line([(0.0, 4.0), (50.0, 4.0)]), sample.line([(0.0, 0.0), (48.0, 4.0), (50.0, 4.08)]))
    (shape,), _, notes = read(tmp_path, sample.text())
    assert shape.inverted_fraction == pytest.approx(0.08 / 96.08, rel=1e-3)
    assert notes == ()


def test_a_bound_may_consist_of_several_lines_in_any_direction(tmp_path: Path) -> None:
    sample = LaneletSample((0.0, 0.0))
    first, second = sample.line([(0.0, 2.0), (40.0, 2.0)]), sample.line([(90.0, 2.0), (40.0, 2.0)])
    right = sample.line([(0.0, -2.0), (90.0, -2.0)])
    members = (("way", "left", first), ("way", "left", second), ("way", "right", right))
    sample.relation({"type": "lanelet", "subtype": "road"}, *members)
    (shape,), _, notes = read(tmp_path, sample.text())
    assert shape.left_m[[0, -1], 0].tolist() == [0.0, 90.0]
    assert 40.0 in shape.left_m[:, 0].tolist()
    assert notes == ()


@pytest.mark.parametrize(
    ("text", "mps"),
    [
        ("50", 50 / 3.6),
        ("50 km/h", 50 / 3.6),
        ("30 mph", 13.4112),
        ("20mps", 20.0),
        ("3", 3 / 3.6),
        ("fast", 0.0),
        ("0", 0.0),
    ],
)
def test_speeds_have_units(text: str, mps: float) -> None:
    assert parse_speed_mps(text) == pytest.approx(mps)


def test_files_are_lanelet_maps_by_their_content(tmp_path: Path) -> None:
    path = tmp_path / "map.osm"
    for text, expected in (
        (one_lane(), True),
        ('<osm><relation id="1"><tag v="lanelet" k="type"/></relation></osm>', True),
        ('<osm><way id="1"><tag k="highway" v="residential"/></way></osm>', False),
        ("<osm>" + " " * (1 << 20) + "<tag k='type' v='lanelet'/></osm>", True),
    ):
        path.write_text(text)
        assert has_lanelets(path, ".osm") is expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<osm><relation id='1'><tag k='type' v='lanelet'/></relation></osm>", "its points have neither"),
        (one_lane().replace('v="road"', 'v="crosswalk"'), "it has no lanelet for vehicles"),
        (
            one_lane().replace('v="5100.0000"', 'v="65100.0000"'),
            "its points lie up to 30 km from its middle; at most 15 km",
        ),
        (one_lane() + "<", "not valid XML"),
    ],
)
def test_files_without_usable_lanelets_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "map.osm"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        import_lanelet2(path, tmp_path)
