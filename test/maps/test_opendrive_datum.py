"""Geodetic positions compared with PROJ, for several forms of geoReference."""

from pathlib import Path

import numpy as np
import pytest
import xodr_sample as sample
from pyproj import Geod, Transformer

from simbev_ros.maps.findings import WALKED_VERGES, sentences_of
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.parts import MapParts

_GEOD = Geod(ellps="WGS84")


def import_sample(tmp_path: Path, reference: str, offset: str = "", x: float = 0.0, y: float = 0.0) -> MapParts:
    reference = f"<geoReference>{reference}</geoReference>" if reference else ""
    header = f'<header revMajor="1" revMinor="8">{reference}{offset}</header>'
    path, work = tmp_path / "sample.xodr", tmp_path / "work"
    road = sample.road(sample.geometry(sample.LINE, 100.0, x=x, y=y), 100.0)
    path.write_text(sample.xodr(road, header=header), encoding="utf-8")
    work.mkdir()
    return import_opendrive(path, work)


def gap_m(parts: MapParts, position_m: tuple[float, float, float], longitude: float, latitude: float) -> float:
    found = parts.datum.geodetic_from_map(np.array(position_m))
    return float(_GEOD.inv(found[1], found[0], longitude, latitude)[2])


@pytest.mark.parametrize(
    "crs",
    [
        "+proj=utm +zone=32 +ellps=WGS84 +datum=WGS84 +units=m +no_defs",
        "+proj=tmerc +lat_0=37.35 +lon_0=-122.07 +k=0.9996 +x_0=-17.5 +y_0=42 +datum=WGS84 +geoidgrids=egm96_15.gtx",
        "EPSG:3857",
    ],
)
@pytest.mark.parametrize("position_m", [(0.0, 0.0, 0.0), (4000.0, -3000.0, 12.0)])
def test_projections_are_accurate_to_a_centimeter(
    tmp_path: Path, crs: str, position_m: tuple[float, float, float]
) -> None:
    parts = import_sample(tmp_path, f"<![CDATA[{crs}]]>", '<offset x="500250.5" y="1000.25" z="30" hdg="0"/>')
    plain = crs.replace("+geoidgrids=egm96_15.gtx", "")
    truth = Transformer.from_crs(plain, "EPSG:4326", always_xy=True).transform(
        position_m[0] + 500250.5, position_m[1] + 1000.25
    )
    assert gap_m(parts, position_m, *truth) < 0.01
    found = parts.datum.geodetic_from_map(np.array(position_m))
    assert found[2] == pytest.approx(30.0 + position_m[2])
    np.testing.assert_allclose(parts.datum.map_from_geodetic(*found), position_m, atol=1e-3)


def test_a_reference_without_a_projection_is_transverse_mercator_as_in_carla(tmp_path: Path) -> None:
    parts = import_sample(tmp_path, "+lat_0=4.9e1 +lon_0=8.0e0")
    tmerc = "+proj=tmerc +lat_0=49 +lon_0=8 +k=1 +x_0=0 +y_0=0 +datum=WGS84"
    truth = Transformer.from_crs(tmerc, "EPSG:4326", always_xy=True).transform(300.0, -200.0)
    assert gap_m(parts, (300.0, -200.0, 0.0), *truth) < 0.01
    assert any(
        "names no projection: transverse Mercator" in note for note in sentences_of("sample.xodr", parts.findings)
    )


@pytest.mark.parametrize(
    ("crs", "metric"),
    [
        (
            "+proj=tmerc +lat_0=48 +lon_0=11 +x_0=30 +datum=WGS84 +units=us-ft",
            "+proj=tmerc +lat_0=48 +lon_0=11 +x_0=30",
        ),
        ("+proj=tmerc +lat_0=48 +lon_0=11 +datum=WGS84 +axis=wsu", "+proj=tmerc +lat_0=48 +lon_0=11"),
        ("EPSG:2227", "EPSG:26943"),  # California's zone 3 in feet, and in meters
    ],
)
def test_feet_and_axes_to_the_west_are_taken_as_meters_to_the_east(tmp_path: Path, crs: str, metric: str) -> None:
    parts = import_sample(
        tmp_path, f"<![CDATA[{crs}]]>", '<offset x="2000000" y="500100" z="0" hdg="0"/>' * ("EPSG" in crs)
    )
    x_m, y_m = (2e6, 500100.0) if "EPSG" in crs else (0.0, 0.0)
    truth = Transformer.from_crs(metric, "EPSG:4326", always_xy=True).transform(x_m + 300.0, y_m - 200.0)
    assert gap_m(parts, (300.0, -200.0, 0.0), *truth) < 0.5
    assert any("has other units or axes" in note for note in sentences_of("sample.xodr", parts.findings))


def test_a_rotated_offset_rotates_the_map(tmp_path: Path) -> None:
    parts = import_sample(tmp_path, "EPSG:25832", '<offset x="600000" y="5300000" z="0" hdg="1.5707963267948966"/>')
    truth = Transformer.from_crs("EPSG:25832", "EPSG:4326", always_xy=True).transform(
        600000.0 - 20.0, 5300000.0 + 100.0
    )
    assert gap_m(parts, (100.0, 20.0, 0.0), *truth) < 0.01


def test_the_plain_form_stays_plain(tmp_path: Path) -> None:
    parts = import_sample(tmp_path, "+proj=tmerc +lat_0=42.5 +lon_0=-83.25 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m")
    assert parts.datum.projection == ""
    assert (parts.datum.latitude_deg, parts.datum.longitude_deg) == (42.5, -83.25)
    assert {finding.rule for finding in parts.findings} == {WALKED_VERGES}


@pytest.mark.parametrize("reference", ["", "somewhere", "+proj=longlat +datum=WGS84", "+proj=tmerc +lat_0=x"])
def test_without_a_usable_geo_reference_the_default_is_stated(tmp_path: Path, reference: str) -> None:
    parts = import_sample(tmp_path, reference)
    assert (parts.datum.latitude_deg, parts.datum.longitude_deg) == (0.0, 0.0)
    assert any("0° N 0° E" in note for note in sentences_of("sample.xodr", parts.findings))


def test_large_coordinates_are_recentered_and_keep_their_position_on_earth(tmp_path: Path) -> None:
    parts = import_sample(tmp_path, "EPSG:32632", x=691_000.25, y=5_335_000.5)
    (strip,) = parts.layout.strips
    assert np.abs(strip.left_m).max() < 101.0
    truth = Transformer.from_crs("EPSG:32632", "EPSG:4326", always_xy=True).transform(691_000.25, 5_335_000.5)
    assert gap_m(parts, tuple(strip.left_m[0]), *truth) < 0.01
    assert 'x="691000.25"' not in parts.opendrive.read_text(encoding="utf-8")
    assert parts.origin_m == (np.round(parts.origin_m[0]), np.round(parts.origin_m[1]), 0.0)
    np.testing.assert_allclose(strip.left_m[0, :2] + parts.origin_m[:2], (691_000.25, 5_335_000.5), atol=10.0)
    assert any("far from its origin" in note for note in sentences_of("sample.xodr", parts.findings))
