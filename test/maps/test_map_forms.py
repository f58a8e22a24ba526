"""Forms of map files: compressed ones open like plain ones, PBF like XML, whatever Overpass writes, and no bombs."""

import bz2
import gzip
import os
import shutil
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import numpy as np
import osmium
import pytest
import zstandard
from osm_sample import SAMPLE
from osmium.osm import mutable

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.osm.data import OsmData
from simbev_ros.maps.osm.reader import read_osm
from simbev_ros.maps.source import map_spec

COMPRESSORS: dict[str, Callable[[bytes], bytes]] = {
    ".gz": gzip.compress,
    ".bz2": bz2.compress,
    ".zst": zstandard.ZstdCompressor().compress,
}
STREET = """<osm version="0.6"><node id="1" lat="50" lon="8"/><node id="2" lat="50" lon="8.003"/>
<way id="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="residential"/></way></osm>"""


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> RoadNetwork:
    folder = tmp_path_factory.mktemp("plain")
    (folder / "street.osm").write_text(STREET)
    return load_network(map_spec(str(folder / "street.osm")), folder)


@pytest.fixture(scope="module")
def pbf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pbf") / "riverside.osm.pbf"
    with osmium.SimpleWriter(path) as writer:
        for element in osmium.FileProcessor(SAMPLE):
            writer.add(element)
    return path


def assert_equal(data: OsmData, other: OsmData) -> None:
    assert (data.ways, data.multipolygons, data.node_tags) == (other.ways, other.multipolygons, other.node_tags)
    assert np.abs(data.longitude_latitude_deg - other.longitude_latitude_deg).max() <= 5.1e-8, "PBF has 1e-7 degrees"


@pytest.mark.parametrize("suffix", COMPRESSORS)
def test_compressed_openstreetmap_files_read_like_plain_ones(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"riverside.osm{suffix}"
    path.write_bytes(COMPRESSORS[suffix](SAMPLE.read_bytes()))
    assert map_spec(str(path)).name == "riverside"
    assert_equal(read_osm(path), read_osm(SAMPLE))


@pytest.mark.parametrize("kind", [".osm.xml", ".net.xml", ".xodr"])
def test_compressed_files_of_all_kinds_build_the_same_roads(tmp_path: Path, plain: RoadNetwork, kind: str) -> None:
    source = {".net.xml": plain.net_path, ".xodr": plain.opendrive_path}.get(kind)
    content = STREET.encode() if source is None else source.read_bytes()
    lanes = []
    for suffix, compress in (("", bytes), (".gz", gzip.compress)):
        path = tmp_path / f"street{kind}{suffix}"
        path.write_bytes(compress(content))
        lanes.append(
            [lane.centerline_m.tolist() for lane in load_network(map_spec(str(path)), tmp_path).lanes.values()]
        )
    assert lanes[0] == lanes[1] != []


def test_a_compressed_file_is_recognized_by_its_content(tmp_path: Path) -> None:
    path = tmp_path / "street.osm"
    path.write_bytes(gzip.compress(STREET.encode()))
    assert len(read_osm(path).ways) == 1


def test_several_compressed_parts_are_one_file(tmp_path: Path) -> None:
    path = tmp_path / "street.osm.zst"
    path.write_bytes(b"".join(COMPRESSORS[".zst"](STREET[k : k + 100].encode()) for k in range(0, len(STREET), 100)))
    assert len(read_osm(path).ways) == 1


@pytest.mark.parametrize("suffix", COMPRESSORS)
def test_compressed_files_that_unpack_to_too_much_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    monkeypatch.setattr("simbev_ros.maps.osm.xml.MAX_OSM_BYTES", 4 << 20)
    path = tmp_path / f"bomb.osm{suffix}"
    path.write_bytes(COMPRESSORS[suffix](b"<osm>" + bytes([32]) * (8 << 20)))
    assert path.stat().st_size < 20_000
    with pytest.raises(InputError, match=rf"bomb\.osm{suffix}: unpacks to more than 4 MiB"):
        read_osm(path)


@pytest.mark.parametrize("suffix", COMPRESSORS)
def test_damaged_compressed_files_are_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"town.osm{suffix}"
    packed = COMPRESSORS[suffix](SAMPLE.read_bytes())
    path.write_bytes(packed[: len(packed) // 2])
    with pytest.raises(InputError, match=rf"town\.osm{suffix}:.* (is damaged|ends too early)"):
        read_osm(path)


def test_errors_in_compressed_files_name_the_file_and_the_line(tmp_path: Path) -> None:
    path = tmp_path / "street.osm.gz"
    path.write_bytes(gzip.compress(STREET.replace('<way id="1"', '<way id="x"').encode()))
    with pytest.raises(
        InputError, match=r"street\.osm\.gz:2: way: id: must be a whole number of at most 64 bits, not 'x'"
    ):
        read_osm(path)


def test_pbf_reads_like_xml(pbf: Path) -> None:
    assert_equal(read_osm(pbf), read_osm(SAMPLE))


def test_pbf_whose_nodes_are_not_sorted_reads_alike(tmp_path: Path) -> None:
    path, places = tmp_path / "street.pbf", {9: (8.0, 50.0), 2: (8.003, 50.0), 5: (8.006, 50.001)}
    with osmium.SimpleWriter(path) as writer:
        for node, place in places.items():
            writer.add_node(mutable.Node(id=node, location=place, tags={"highway": "crossing"} if node == 5 else {}))
        writer.add_way(mutable.Way(id=1, nodes=[9, 2, 5], tags={"highway": "residential"}))
    data = read_osm(path)
    (way,) = data.ways
    assert data.longitude_latitude_deg[list(way.nodes)].tolist() == [[8.0, 50.0], [8.003, 50.0], [8.006, 50.001]]
    assert data.node_tags == {way.nodes[2]: {"highway": "crossing"}}


@pytest.mark.parametrize("way_id", [-5, 2**53])
@pytest.mark.parametrize("member_id", [7, -7, 2**53])
def test_pbf_with_ids_that_are_not_openstreetmaps_reads_like_xml(tmp_path: Path, way_id: int, member_id: int) -> None:
    for name in ("new.osm", "new.pbf"):
        with osmium.SimpleWriter(tmp_path / name) as writer:
            for number in range(1, 4):
                writer.add_node(mutable.Node(id=number, location=(8.0 + number / 1000, 50.0 + number % 2 / 1000)))
            for each in (7, way_id):
                writer.add_way(mutable.Way(id=each, nodes=[1, 2, 3, 1], tags={"highway": "residential"}))
            members = [("w", 7, "outer"), ("w", member_id, "inner")]
            writer.add_relation(mutable.Relation(id=1, members=members, tags={"type": "multipolygon"}))
    assert_equal(read_osm(tmp_path / "new.pbf"), read_osm(tmp_path / "new.osm"))


def test_the_index_of_a_pbf_is_closed_and_frees_its_space_on_the_disk(pbf: Path) -> None:
    read_osm(pbf)
    assert not [link for link in Path("/proc/self/fd").iterdir() if "simbev-osm-" in os.path.realpath(link)]


def test_a_damaged_pbf_is_refused(tmp_path: Path, pbf: Path) -> None:
    path = tmp_path / "town.osm.pbf"
    path.write_bytes(pbf.read_bytes()[:-500])
    with pytest.raises(InputError, match=r"town\.osm\.pbf: is damaged"):
        read_osm(path)


def test_a_pbf_that_unpacks_to_far_more_than_a_map_is_refused_before_its_nodes_are_written(tmp_path: Path) -> None:
    path = tmp_path / "bomb.osm.pbf"
    with osmium.SimpleWriter(path) as writer:
        for number in range(1, 100_000):
            writer.add_node(mutable.Node(id=number, location=(8.0, 50.0)))
    with pytest.raises(InputError, match=r"bomb\.osm\.pbf: unpacks to .* more than 32 times its size"):
        read_osm(path)


def test_a_file_with_too_many_nodes_or_references_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simbev_ros.maps.osm.xml.MAX_OSM_NODES", 2)
    path = tmp_path / "street.osm"
    path.write_text(STREET.replace("<way", '<node id="3" lat="50" lon="8"/><way'))
    with pytest.raises(InputError, match=r"street\.osm: has more than 2 nodes; choose a part with bounds"):
        read_osm(path)
    path.write_text(STREET.replace("</way>", '<nd ref="1"/><nd ref="2"/>' * 4 + "</way>"))
    with pytest.raises(InputError, match=r"street\.osm: has too many ways"):
        read_osm(path)


def test_a_kind_of_file_that_is_not_read_says_which_are(tmp_path: Path) -> None:
    path = tmp_path / "town.osm.zip"
    shutil.copy(SAMPLE, path)
    with pytest.raises(
        InputError, match=r"town\.osm\.zip: is not a kind of map file.*\.xodr, \.osm,.*\.gz.*\.osm\.pbf"
    ):
        map_spec(str(path))


def test_overpass_answers_with_geometry_read_like_those_with_nodes(tmp_path: Path) -> None:
    tree = ElementTree.parse(SAMPLE)
    root = tree.getroot()
    places = {node.get("id"): {key: str(node.get(key)) for key in ("lat", "lon")} for node in root.iter("node")}
    geometry = {way.get("id"): [places[str(nd.get("ref"))] for nd in way.iter("nd")] for way in root.iter("way")}
    for way in root.iter("way"):
        for nd in way.iter("nd"):
            nd.attrib.update(places[str(nd.get("ref"))])
    for member in root.iter("member"):
        for place in geometry[member.get("ref")]:
            ElementTree.SubElement(member, "nd", place)
    outlines = {member.get("ref") for member in root.iter("member")}
    for element in [*root.iter("node"), *(way for way in root.iter("way") if way.get("id") in outlines)]:
        root.remove(element)
    path = tmp_path / "overpass.osm"
    tree.write(path)
    data, whole = read_osm(path), read_osm(SAMPLE)

    def drawn(data: OsmData) -> list[object]:
        degrees = data.longitude_latitude_deg
        ways = [(dict(way.tags), degrees[list(way.nodes)].tolist()) for way in data.ways]
        areas = [
            [dict(area.tags), *(degrees[list(way.nodes)].tolist() for way in area.outer + area.inner)]
            for area in data.multipolygons
        ]
        return [*sorted(ways, key=repr), *areas]

    assert len(data.multipolygons) == 2
    assert drawn(data) == drawn(whole)
    assert not any("missing" in finding.rule for finding in data.findings)
