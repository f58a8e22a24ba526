"""The importer of SUMO nets, on nets of netgenerate with known properties, and on invalid nets."""

import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pyproj import Transformer
from sumo_nets import generate_net

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.findings import sentences_of
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.signals import place_signals
from simbev_ros.maps.sumo.importer import import_sumo
from simbev_ros.maps.sumo.layout import layout_of
from simbev_ros.maps.sumo.net import SumoNet, read_sumo_net
from simbev_ros.maps.sumo.netconvert import build_from_plain_xml

UTM = "+proj=utm +zone=32 +ellps=WGS84 +datum=WGS84 +units=m +no_defs"
Import = Callable[[str], MapParts]


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> str:
    return generate_net(tmp_path_factory.mktemp("nets") / "grid.net.xml", "--grid")


@pytest.fixture
def import_net(tmp_path: Path) -> Import:
    def run(text: str) -> MapParts:
        (tmp_path / "work").mkdir()
        (tmp_path / "a.net.xml").write_text(text)
        return import_sumo(tmp_path / "a.net.xml", tmp_path / "work")

    return run


def kinds(net: SumoNet) -> Counter[LaneKind]:
    return Counter(lane.kind for lane in net.lanes.values() if not lane.junction)


def test_a_net_without_sidewalks_is_given_some_and_keeps_its_coordinates(grid: str, import_net: Import) -> None:
    parts = import_net(grid)
    net = read_sumo_net(parts.net)
    assert kinds(net) == {LaneKind.DRIVING: 80, LaneKind.SIDEWALK: 80}
    assert {LaneKind.CROSSING, LaneKind.WALKING_AREA} <= {lane.kind for lane in net.lanes.values()}
    assert net.junctions["C2"].center_m[:2].tolist() == [200.0, 200.0]
    assert "there are no sidewalks: sidewalks were added to streets of up to 50 km/h" in sentences_of(
        "a.net.xml", parts.findings
    )


def test_a_net_with_sidewalks_and_crossings_keeps_its_own(tmp_path: Path, import_net: Import) -> None:
    text = generate_net(
        tmp_path / "b.net.xml", "--grid", "-L2", "-S13", "-jtraffic_light", "--sidewalks.guess", "--crossings.guess"
    )
    parts = import_net(text)
    net = read_sumo_net(parts.net)
    assert kinds(net) == {LaneKind.DRIVING: 160, LaneKind.SIDEWALK: 80}
    assert len([lane for lane in net.lanes.values() if lane.kind is LaneKind.CROSSING]) == text.count('"crossing"')
    assert {link.programme for link in net.links} == set(re.findall(r'<tlLogic id="([^"]*)"', text))
    assert not any("sidewalks" in note or "crossings" in note for note in sentences_of("a.net.xml", parts.findings))


@pytest.mark.parametrize("options", [("--spider",), ("--rand", "--seed", "4"), ("--grid", "--no-internal-links")])
def test_other_nets_of_netgenerate_are_read(tmp_path: Path, import_net: Import, options: tuple[str, ...]) -> None:
    text = generate_net(tmp_path / "b.net.xml", *options)
    net = read_sumo_net(import_net(text).net)
    streets = set(re.findall(r'<edge id="([^:"]*)"', text))
    assert {lane.edge for lane in net.lanes.values() if lane.kind is LaneKind.DRIVING and not lane.junction} == streets
    assert any(lane.kind is LaneKind.DRIVING and lane.junction for lane in net.lanes.values())


def test_a_projected_net_has_the_position_of_its_projection(grid: str, import_net: Import) -> None:
    text = grid.replace('projParameter="!"', f'projParameter="{UTM}"')
    parts = import_net(text.replace('netOffset="0.00,0.00"', 'netOffset="-691000.00,-5335000.00"'))
    net = read_sumo_net(parts.net)
    to_geodetic = Transformer.from_crs(UTM, "EPSG:4326", always_xy=True)
    for name, east_m, north_m in (("A0", 0.0, 0.0), ("E0", 400.0, 0.0), ("C4", 200.0, 400.0)):
        longitude, latitude = to_geodetic.transform(691000.0 + east_m, 5335000.0 + north_m)
        here_m = parts.datum.map_from_geodetic(latitude, longitude, 0.0)
        assert np.abs(net.junctions[name].center_m - here_m).max() < 0.005
    assert any(
        "are rotated and scaled so that x points east" in note for note in sentences_of("a.net.xml", parts.findings)
    )


def test_a_net_far_from_its_origin_is_recentered(grid: str, import_net: Import) -> None:
    def moved(match: re.Match[str]) -> str:
        points = (point.split(",") for point in match[2].split())
        return f'{match[1]}"{" ".join(f"{float(x) + 90000},{y}" for x, y in points)}"'

    text = re.sub(r'( shape=)"([^"]*)"', moved, grid)
    text = re.sub(r' x="([^"]*)"', lambda match: f' x="{float(match[1]) + 90000}"', text)
    parts = import_net(text)
    assert parts.origin_m == (90200.0, 0.0, 0.0)
    assert "it lies far from its origin: map (0, 0, 0) is 90200, 0, 0 there" in sentences_of(
        "a.net.xml", parts.findings
    )
    assert read_sumo_net(parts.net).junctions["C2"].center_m[:2].tolist() == [0.0, 200.0]


ODD_SPEED = "a speed limit below 0.1 or above 150 m/s is replaced by 13.89 m/s (A0B0_0)"
LANE = r'(<lane id="A0B0_0"[^>]*?)'
BAD_SHAPE = "an edge with a lane shape that is not at least two points x,y or x,y,z in meters is left out (A0B0)"
LOST = "a connection of a missing lane is left out (A0X7_0"


@pytest.mark.parametrize(
    ("pattern", "replacement", "message"),
    [
        (r'projParameter="!"', 'projParameter="+proj=no"', r"net\.xml:\d+: location: projParameter: not a projection"),
        (r' speed="13\.89"', ' allow="rail" speed="13.89"', "has no lanes that cars may drive on"),
        (r"(?s)<location.*</net>", "</net>", "has no lanes that cars may drive on"),
    ],
)  # fmt: skip
def test_invalid_nets_are_refused_with_their_location(
    grid: str, import_net: Import, pattern: str, replacement: str, message: str
) -> None:
    text = re.sub(pattern, replacement, grid)
    assert text != grid
    with pytest.raises(InputError, match=message):
        import_net(text)


@pytest.mark.parametrize(
    ("pattern", "replacement", "note"),
    [
        (LANE + r' shape="[^"]*"', r'\1 shape="9,1 9,1"', "an edge without length is left out (A0B0)"),
        (LANE, r'\1 width="0"', "a lane without width is made 3.2 m wide (A0B0_0)"),
        (LANE, r'\1 width="-3"', "a lane without width is made 3.2 m wide (A0B0_0)"),
        (LANE + r' speed="[^"]*"', r'\1 speed="0"', ODD_SPEED),
        (LANE + r' speed="[^"]*"', r'\1 speed="1e7"', ODD_SPEED),
        (r'(<connection from=)"A0B0"', r'\1"A0X7"', LOST),
        (r'fromLane="0"', 'fromLane="one"', "a connection of a missing lane is left out ("),
        (r'<edge id="A0B0"', '<edge id="A0A1"', "an edge without an id of its own is left out (A0A1)"),
        (r'from="A0" to="B0"', 'from="A0" to="X"', "an edge from or to missing junctions is left out (A0B0"),
        (r'x="100\.00" y="0.00"', 'x="1e300" y="0"', "a junction without a position is left out (B0)"),
        (LANE + r' shape="[^"]*"', r"\1", BAD_SHAPE),
        (LANE + r' shape="[^"]*"', r'\1 shape="1,2 nan,3"', BAD_SHAPE),
        (LANE + r' shape="[^"]*"', r'\1 shape="1,2 3 4,5"', BAD_SHAPE),
        (LANE + r' speed="[^"]*"', r'\1 speed="fast"', ODD_SPEED),
        (LANE, r'\1 width="5000"', "an edge with a lane wider than 30 m is left out (A0B0"),
        (r'(<edge id="A0B0"[^>]*>)', r"\1" + 101 * "<lane/>", "an edge with more than 100 lanes is left out (A0B0"),
    ],
)  # fmt: skip
def test_repairable_nets_are_repaired_with_a_note(
    grid: str, import_net: Import, pattern: str, replacement: str, note: str
) -> None:
    text = re.sub(pattern, replacement, grid, flags=re.DOTALL)
    assert text != grid
    parts = import_net(text)
    assert any(note in sentence for sentence in sentences_of("a.net.xml", parts.findings))
    assert kinds(read_sumo_net(parts.net))[LaneKind.DRIVING] >= 73


def test_parts_that_are_not_connected_stay_and_footpaths_apart_are_left_out_with_notes(
    grid: str, import_net: Import
) -> None:
    bridges = ("B{0}C{0}", "C{0}B{0}")
    cut = "|".join(bridge.format(row) for row in range(5) for bridge in bridges)
    text = re.sub(rf'<edge id="({cut})".*?</edge>', "", grid, flags=re.DOTALL)
    path = '<edge id="path" from="y" to="z"><lane id="path_0" allow="pedestrian" shape="0,900 90,900"/></edge>'
    ends = "".join(f'<junction id="{name}" x="{x}" y="900" type="dead_end"/>' for name, x in (("y", 0), ("z", 90)))
    parts = import_net(text.replace("</net>", f"{path}{ends}</net>"))
    net = read_sumo_net(parts.net)
    assert {name[0] for name in net.junctions} == {"A", "B", "C", "D", "E"}
    notes = sentences_of("a.net.xml", parts.findings)
    (note,) = (each for each in notes if "not connected" in each)
    number, outside_km, all_km = map(float, re.findall(r"in (\d+) parts .* \((.*) of (.*) km are outside", note)[0])
    assert number == 2
    # Of a grid of 5 x 5 junctions, 4 x 2 + 5 of the 40 streets are beside the cut, and 3 x 4 + 2 x 5 on its other side.
    assert outside_km / all_km == pytest.approx(13 / (13 + 22), abs=0.01)
    assert any("an edge that no road reaches is left out (path)" in note for note in notes)


def test_programs_of_a_light_between_which_someone_switches_by_hand_run_one_after_another(
    tmp_path: Path, import_net: Import
) -> None:
    text = generate_net(tmp_path / "b.net.xml", "--grid", "--grid.number=3", "-jtraffic_light")
    logic = re.search(r'<tlLogic id="B1".*?</tlLogic>', text, re.DOTALL)
    assert logic is not None
    phases = re.findall(r"<phase .*?/>", logic[0])
    halves = [phases[: len(phases) // 2], phases[len(phases) // 2 :]]
    written = [
        f'<tlLogic id="B1" type="static" programID="{number}" offset="0">{"".join(half)}</tlLogic>'
        for number, half in enumerate(halves)
    ]
    parts = import_net(text.replace(logic[0], "".join(written)))
    found = re.search(r'<tlLogic id="B1".*?</tlLogic>', parts.net.read_text(), re.DOTALL)
    assert found is not None
    by_link = zip(*re.findall('state="(.*?)"', found[0]), strict=True)
    assert all({"G", "g"} & set(states) for states in by_link)
    notes = sentences_of("a.net.xml", parts.findings)
    assert any(
        "programs of a traffic light that leave out movements run one after another (B1)" in note for note in notes
    )


def test_a_race_track_for_special_vehicles_is_opened_to_cars(grid: str, import_net: Import) -> None:
    parts = import_net(re.sub(r'(<lane id="[^:"][^"]*")', r'\1 allow="vip"', grid))
    assert any(
        "no lane is for cars: a lane for special vehicles is opened to them (A0A1_0; 80 times)" in note
        for note in sentences_of("a.net.xml", parts.findings)
    )
    assert kinds(read_sumo_net(parts.net))[LaneKind.DRIVING] >= 76


def test_a_net_with_nothing_but_a_stub_of_a_sidewalk_is_given_some(grid: str, import_net: Import) -> None:
    stub = r'\1<lane id="A0B0_1" index="1" speed="9" length="0.5" shape="50,3 50.5,3" allow="pedestrian"/>'
    parts = import_net(re.sub(r'(<lane id="A0B0_0"[^>]*/>)', stub, grid, count=1))
    assert kinds(read_sumo_net(parts.net))[LaneKind.SIDEWALK] >= 79


def test_no_light_hangs_above_the_cycleway_that_is_the_straightest_exit(tmp_path: Path) -> None:
    places = {"w": (-100, 0), "c": (0, 0), "e": (100, 0), "n": (0, 100), "s": (0, -100)}
    streets = {
        "in": "w c 2 all",
        "straight": "c e 1 bicycle",
        "left": "c n 1 all",
        "right": "c s 1 all",
        "from_s": "s c 1 all",
    }
    nodes = "".join(
        f'<node id="{name}" x="{x}" y="{y}" type="{"traffic_light" if name == "c" else "priority"}"/>'
        for name, (x, y) in places.items()
    )
    edges = "".join(
        f'<edge id="{name}" from="{start}" to="{end}" numLanes="{lanes}" allow="{allow}"/>'
        for name, (start, end, lanes, allow) in ((name, text.split()) for name, text in streets.items())
    )
    texts = {"nodes": nodes, "edges": edges, "connections": ""}
    nodes_path, edges_path, connections_path = (tmp_path / f"{tag}.xml" for tag in texts)
    for (tag, content), path in zip(texts.items(), (nodes_path, edges_path, connections_path), strict=True):
        path.write_text(f"<{tag}>{content}</{tag}>")
    net_path = tmp_path / "cycle.net.xml"
    build_from_plain_xml(nodes_path, edges_path, connections_path, net_path, tmp_path / "cycle.xodr")
    net = read_sumo_net(net_path)
    heads = place_signals(net, layout_of(net))
    assert {signal.lane for signal in heads} == {"in_0", "in_1", "from_s_0"}
