"""Map files that are broken, hostile, strange or too large, through the command line."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.statistics import busiest_position
from simbev_ros.maps.sumo.netconvert import sumo_home
from simbev_ros.production import drawing, play

STREET = """<node id="1" lat="{0}" lon="{1}"/><node id="2" lat="{2}" lon="{3}"/>
<way id="1"><nd ref="1"/><nd ref="2"/>{4}</way>"""
HIGHWAY = '<tag k="highway" v="residential"/>'
ROAD = """<road id="{id}" length="100" junction="-1"><link/><planView>
<geometry s="0" x="{x}" y="0" hdg="0" length="100"><line/></geometry></planView><lanes><laneSection s="0">
<center><lane id="0" type="none"/></center><right>{lanes}</right></laneSection></lanes></road>"""
LANE = '<lane id="-1" type="{kind}"><width sOffset="0" a="{width}" b="0" c="0" d="0"/></lane>'
NOT_DRIVABLE = ":1: it has no drivable lane"
OPTIONS_OF_RUN = "rig: {sensors: [{type: imu, name: imu}]}\ntraffic: {vehicles: 2, pedestrians: 0}\n"


def osm(*street: object) -> str:
    return f'<osm version="0.6">{STREET.format(*street)}</osm>'


def xodr(x: object = 0, kind: str = "driving", width: float = 3.5, count: int = 1) -> str:
    lanes = LANE.format(kind=kind, width=width)
    return f"<OpenDRIVE>{''.join(ROAD.format(id=k, x=x, lanes=lanes) for k in range(count))}</OpenDRIVE>"


GOOD_OSM = osm(50, 8, 50, 8.003, HIGHWAY)
SECRET = '<!DOCTYPE osm [<!ENTITY a SYSTEM "file:///etc/passwd">]>\n'


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def grid(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("grid") / "grid.net.xml"
    command = [sumo_home() / "bin/netgenerate", "--grid", "--grid.number", "2", "-o", path]
    subprocess.run(command, check=True, capture_output=True, env={"SUMO_HOME": str(sumo_home())})
    return path.read_text()


@pytest.fixture
def refused(refused: Callable[..., str]) -> Callable[..., str]:
    """The same, and the message must be one line."""

    def run(*arguments: object) -> str:
        error = refused(*arguments)
        assert error.startswith("error: ")
        assert error.count("\n") == 1, "one line"
        return error

    return run


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.osm", SECRET + GOOD_OSM, ":1: document type declarations (<!DOCTYPE>) are not accepted"),
        ("a.osm", xodr(), ":1: the root element must be <osm>, not <OpenDRIVE>"),
        ("a.net.xml", GOOD_OSM, ":1: the root element must be <net>, not <osm>"),
        ("a.xodr", "\x1f\x8b\x08packed", "a.xodr: is damaged and cannot be unpacked: "),
        ("a.osm.zip", GOOD_OSM, "a.osm.zip: is not a kind of map file that is read"),
        ("a.xodr", xodr(kind="sidewalk"), NOT_DRIVABLE),
        ("a.xodr", xodr(kind="none"), NOT_DRIVABLE),
        ("a.xodr", xodr(width=0.0), "a lane without width or length is left out (lane -1 of road 0)"),
        ("a.xodr", xodr(width=1e8), "a <width> with values beyond 200 is left out (sOffset=0)"),
        ("a.xodr", xodr(x="nan"), "<geometry>: x='nan' is not a finite number"),
        ("a.xodr", xodr(x="1e300"), "<geometry>: x='1e300' is not a finite number of at most 100000"),
        ("a.xodr", xodr(count=50_001), "a.xodr: has 50001 roads; at most 50000 are read. Extract the part"),
        ("a.osm", osm(50, 8, 50, 8.003, '<tag k="building" v="yes"/>'), "a.osm: has no roads"),
        ("a.osm", osm(50, 8, 50, 8, HIGHWAY), "a.osm: has no roads that cars may drive on"),
        (
            "a.osm",
            GOOD_OSM.replace("</way>", '<nd ref="1"/><nd ref="2"/>' * 9500 + "</way>"),
            "its roads are 4079 km long; at most 4000 km",
        ),
    ],
)
def test_files_that_cannot_be_maps_are_refused_in_a_line(
    refused: Callable[..., str],
    tmp_path: Path,
    name: str,
    content: str,
    message: str,
) -> None:
    path = tmp_path / name
    path.write_text(content, encoding="latin-1")
    error = refused("map", path)
    assert str(path) in error and message in error


@pytest.mark.parametrize(
    ("pattern", "replacement", "message"),
    [
        (
            "<junction .*</junction>",
            "",
            r"cars may drive on; a\.net\.xml:\d+: an edge from or to missing junctions",
        ),
        (r'type="(priority|right_before_left)"', 'type="odd"', r"'A0' is not a valid node type\. \(and 3 more\)"),
        (r'(<junction id="B0" .*?x=")[^"]*', r"\g<1>9e7", r"a\.net\.xml: its edges span 90000 km; at most 100 km"),
        (r'(id="A0B0_0".*?shape=")[^"]*', r"\g<1>0,0 9e7,9e7", r"a\.net\.xml: its edges span 90000 km; at most 100 km"),
        ("<edge .*</edge>", "", "has no lanes that cars may drive on"),
    ],
)
def test_nets_that_hold_nonsense_are_refused_in_a_line(
    refused: Callable[..., str],
    tmp_path: Path,
    grid: str,
    pattern: str,
    replacement: str,
    message: str,
) -> None:
    path = tmp_path / "a.net.xml"
    path.write_text(re.sub(pattern, replacement, grid, flags=re.DOTALL))
    assert path.read_text() != grid
    assert re.search(message, refused("map", path))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("street", "longitude_deg", "latitude_deg", "width_m"),
    [((0, 179.999, 0, -179.999, HIGHWAY), -180.0, 0.0, 222.6), ((89.999, 0, 90, 0, HIGHWAY), 0.0, 89.9995, 0.0)],
)
def test_streets_at_the_edges_of_the_globe_are_maps(
    tmp_path: Path, street: tuple[object, ...], longitude_deg: float, latitude_deg: float, width_m: float
) -> None:
    path = tmp_path / "edge.osm"
    path.write_text(osm(*street))
    network = load_network(map_spec(str(path)))
    assert (network.datum.longitude_deg, network.datum.latitude_deg) == (longitude_deg, latitude_deg)
    points_m = np.concatenate([lane.centerline_m for lane in network.lanes.values() if lane.kind is LaneKind.DRIVING])
    assert np.ptp(points_m[:, 0]) == pytest.approx(width_m, abs=8.0), "two lanes, side by side"


def test_a_road_of_half_a_metre_can_be_looked_at(tmp_path: Path) -> None:
    path = tmp_path / "short.xodr"
    path.write_text(xodr().replace('length="100"', 'length="0.5"'))
    network = load_network(map_spec(str(path)))
    assert busiest_position(network) == pytest.approx([0.0, -1.75], abs=0.01)


def test_traffic_of_left_hand_nets_has_the_curb_on_its_left(tmp_path: Path) -> None:
    path = tmp_path / "left.net.xml"
    command = [sumo_home() / "bin/netgenerate", "--grid", "--grid.number", "3", "--lefthand", "-L", "2", "-o", path]
    subprocess.run(command, check=True, capture_output=True, env={"SUMO_HOME": str(sumo_home())})
    network = load_network(map_spec(str(path)))
    strips = {strip.lane: strip for strip in network.layout.strips if not strip.junction}
    pairs = [(strip, strips[strip.right]) for strip in strips.values() if strip.right in strips]
    assert len(pairs) >= 24 * 3
    for strip, other in pairs:
        along = strip.left_m[-1] - strip.left_m[0]
        to_other = other.center_m.mean(axis=0) - strip.center_m.mean(axis=0)
        assert along[0] * to_other[1] - along[1] * to_other[0] < 0.0
    paints = {strip.left_line.paint for strip in strips.values() if strip.lane.endswith("_0")}
    assert paints == {"none"}, "of sidewalks, which are outermost"
    signs = [sign for sign in network.layout.signs if sign.lanes[0] in strips]
    assert signs
    for sign in signs:
        strip = strips[sign.lanes[0]]
        along = strip.left_m[-1] - strip.left_m[0]
        to_sign = sign.foot_m - strip.left_m[0]
        assert along[0] * to_sign[1] - along[1] * to_sign[0] > 0.0


class _Reached(InputError):
    """The graph would start now."""


@pytest.fixture
def no_graph(monkeypatch: pytest.MonkeyPatch) -> None:
    def reached(*_: object, **__: object) -> None:
        raise _Reached("reached the graph")

    monkeypatch.setattr(play, "build_surroundings", lambda *_: None)
    monkeypatch.setattr(play, "GraphSession", reached)


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """A configuration with a map beside it, by relative path, twice."""
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps/street.osm").write_text(GOOD_OSM)
    path = tmp_path / "mine.yaml"
    path.write_text("scenes: [{map: maps/street.osm, train: 2}]\n" + OPTIONS_OF_RUN)
    return path


@pytest.mark.usefixtures("no_graph")
def test_a_configuration_runs_from_any_folder_and_the_notes_of_its_map_are_told_once(
    simbev: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, config: Path
) -> None:
    elsewhere = tmp_path / "else/where"
    elsewhere.mkdir(parents=True)
    monkeypatch.chdir(elsewhere)
    said = simbev("run", os.path.relpath(config))
    assert said.err == "error: reached the graph\n"
    assert said.out.count("map street: it has no buildings: they are generated\n") == 1


@pytest.mark.usefixtures("no_graph")
@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "cannot be read: No such file or directory"), (GOOD_OSM + "\n", "has changed since the scene was drawn")],
)
def test_a_map_that_goes_or_changes_while_scenes_are_drawn_is_said(
    refused: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    config: Path,
    content: str | None,
    message: str,
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = tmp_path / "maps/street.osm"

    def changed(scenario: drawing.Scenario) -> Iterator[object]:
        yield from list(planned(scenario))
        if content is None:
            path.unlink()
        else:
            path.write_text(content)

    planned = drawing.planned_scenes
    monkeypatch.setattr(drawing, "planned_scenes", changed)
    error = refused("run", config)
    assert f"{path}: {message}" in error


@pytest.mark.slow
def test_60_mib_of_the_same_road_are_refused_soon_in_bounded_memory(tmp_path: Path) -> None:
    path = tmp_path / "long.xodr"
    road = ROAD.format(id=1, x=0, lanes=LANE.format(kind="driving", width=3.5))
    with path.open("w") as stream:
        stream.write("<OpenDRIVE>")
        for _ in range((60 << 20) // len(road)):
            stream.write(road)
        stream.write("</OpenDRIVE>")
    limits = "import resource; resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))"
    script = f"{limits}; from simbev_ros.cli.main import main; main()"
    started_s = time.monotonic()
    command = [sys.executable, "-c", script, "map", str(path)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert result.returncode == 2
    assert re.search(r"long\.xodr: has 1\d{5} roads; at most 50000 are read", result.stderr.replace("\n", ""))
    assert "Traceback" not in result.stderr
    assert time.monotonic() - started_s < 90.0
