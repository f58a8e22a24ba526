import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import shapely
from pyproj import CRS
from waiting import PATIENCE_S

from simbev_ros.foundation.errors import InputError, SimulationError
from simbev_ros.maps.build import load_datum, load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.maps.source import known_maps, map_spec
from simbev_ros.maps.sumo import netconvert
from simbev_ros.schema.scene.map_spec import MapSpec

_BUILD_AND_PRINT_FOLDER = """
import sys
from pathlib import Path
from simbev_ros.maps.build import load_network
from simbev_ros.schema.scene.map_spec import MapSpec
print(load_network(MapSpec(name="Blocks", seed=7), Path(sys.argv[1])).net_path.parent)
"""


def test_unknown_map_is_refused_with_the_known_names(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'Atlantis'.*Blocks"):
        load_network(MapSpec(name="Atlantis"), tmp_path)
    assert "Blocks" in known_maps()


def test_unwritable_cache_raises_input_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cache of maps"):
        load_network(MapSpec(name="Blocks"), tmp_path / "file")


def test_netconvert_failure_includes_its_message(tmp_path: Path) -> None:
    nodes, edges, connections = (tmp_path / f"a.{part}.xml" for part in ("nod", "edg", "con"))
    nodes.write_text('<nodes><node id="A" x="0" y="0"/></nodes>')
    edges.write_text('<edges><edge id="AB" from="A" to="B"/></edges>')
    connections.write_text("<connections/>")
    with pytest.raises(SimulationError, match=r"netconvert.*'B'.*not known"):
        netconvert.build_from_plain_xml(nodes, edges, connections, tmp_path / "net.xml", tmp_path / "map.xodr")


@pytest.mark.slow
def test_concurrent_processes_build_the_same_bytes_as_a_single_one(tmp_path: Path) -> None:
    shared, alone = tmp_path / "shared", tmp_path / "alone"
    processes = [
        subprocess.Popen([sys.executable, "-c", _BUILD_AND_PRINT_FOLDER, str(cache)], stdout=subprocess.PIPE, text=True)
        for cache in (shared, shared, alone)
    ]
    folders = [Path(process.communicate(timeout=PATIENCE_S)[0].strip()) for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert folders[0] == folders[1]
    for name in ("map.net.xml", "map.xodr", "network.npz"):
        assert (folders[0] / name).read_bytes() == (folders[2] / name).read_bytes()
    assert [path.name for path in (shared / "maps").iterdir()] == [folders[0].name], "no half-built folder stays behind"


def test_second_load_is_served_from_the_cache(
    blocks: RoadNetwork, map_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(netconvert, "build_from_plain_xml", lambda *_: pytest.fail("built again"))
    again = load_network(MapSpec(name="Blocks", seed=0), map_cache)
    assert again.net_path == blocks.net_path
    assert list(again.lanes) == list(blocks.lanes)


def test_damaged_cache_entry_is_rebuilt(blocks: RoadNetwork, tmp_path: Path) -> None:
    first = load_network(MapSpec(name="Blocks"), tmp_path)
    stored = first.net_path.with_name("network.npz")
    content = stored.read_bytes()
    stored.write_bytes(content[:1000])
    assert list(load_network(MapSpec(name="Blocks"), tmp_path).lanes) == list(blocks.lanes)
    assert stored.read_bytes() == content
    assert len(list((tmp_path / "maps").iterdir())) == 1, "nothing of the damaged one stays behind"


def test_datum_can_be_loaded_without_the_network(blocks: RoadNetwork, map_cache: Path) -> None:
    assert load_datum(MapSpec(name="Blocks", seed=0), map_cache) == blocks.datum


def test_different_seeds_give_different_streets(blocks: RoadNetwork, map_cache: Path) -> None:
    other = load_network(MapSpec(name="Blocks", seed=1), map_cache)
    here, there = (
        shapely.points([junction.center_m[:2] for junction in network.junctions.values()])
        for network in (blocks, other)
    )
    assert shapely.distance(shapely.multipoints(there), here).max() > 5.0


def test_opendrive_has_the_same_roads_at_the_same_position_on_earth(blocks: RoadNetwork) -> None:
    root = ElementTree.fromstring(blocks.opendrive)
    reference = root.findtext("header/geoReference")
    assert reference is not None
    assert CRS.from_proj4(reference.strip()) == CRS.from_proj4(blocks.datum.proj_string)
    assert {junction.attrib["name"] for junction in root.findall("junction")} == set(blocks.junctions)
    starts = [road.find("planView/geometry") for road in root.findall("road")]
    points = shapely.points(
        [[float(start.attrib["x"]), float(start.attrib["y"])] for start in starts if start is not None]
    )
    assert len(points) > 2 * len(blocks.junctions)
    assert shapely.distance(points, surfaces_of(blocks.layout).road).max() < 0.1


def test_built_files_contain_no_time_stamps_or_paths(blocks: RoadNetwork) -> None:
    for text in (blocks.net_path.read_text(), blocks.opendrive):
        assert not re.search(r"generated on|20\d\d-\d\d-\d\d|\.nod\.xml|<header [^>]*date=", text)


def test_every_junction_has_crossings(blocks: RoadNetwork) -> None:
    crossed = {lane.junction for lane in blocks.lanes_of(LaneKind.CROSSING)}
    assert crossed == set(blocks.junctions)


def test_the_published_opendrive_says_at_which_altitude_heights_begin(map_cache: Path, tmp_path: Path) -> None:
    blocks = load_network(MapSpec(name="Blocks", seed=0), map_cache)
    (tmp_path / "again.xodr").write_text(blocks.opendrive)
    again = load_datum(map_spec(str(tmp_path / "again.xodr")), map_cache)
    assert again.altitude_m == blocks.datum.altitude_m == 256.0
    assert blocks.has_opendrive(blocks.opendrive.encode())
    assert blocks.has_opendrive(blocks.opendrive_path.read_bytes()), "bags of earlier versions"
    assert not blocks.has_opendrive(b"<OpenDRIVE/>")
