"""Left-hand traffic: everything is the mirror image of right-hand traffic."""

from pathlib import Path

import numpy as np
import pytest
from sumo_nets import generate_net

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.findings import sentences_of
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.osm.reader import read_osm
from simbev_ros.maps.source import map_spec

_MIRROR = np.array([1.0, -1.0])
STREET = """<osm version="0.6"><node id="1" lat="50" lon="8"/><node id="2" lat="50" lon="8.003"/>{relation}
<way id="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="residential"/><tag k="sidewalk" v="left"/>{tag}</way></osm>"""
LEFT = '<tag k="driving_side" v="left"/>'
BOUNDARY = '<relation id="1"><tag k="boundary" v="administrative"/><tag k="driving_side" v="{}"/></relation>'


def grid(folder: Path, junctions: str, *options: str) -> RoadNetwork:
    path = folder / f"{junctions}{''.join(options)}.net.xml"
    shape = ("--grid", "--grid.number", "3", "--grid.length", "90", "-L", "2", "--default.speed", "13", "-j", junctions)
    generate_net(path, *shape, "--sidewalks.guess", "--crossings.guess", *options)
    return load_network(map_spec(str(path)), folder)


def positions_m(network: RoadNetwork) -> dict[str, Float64Array]:
    """Kind of object → (N, 2) positions."""
    layout = network.layout
    positions = {
        "strips": [np.concatenate([strip.left_m, strip.right_m]).mean(axis=0)[:2] for strip in layout.strips],
        "stop lines": [line.ends_m[:, :2].mean(axis=0) for line in layout.stop_lines],
        "crosswalks": [crosswalk.outline_m[:, :2].mean(axis=0) for crosswalk in layout.crosswalks],
        "signs": [sign.foot_m[:2] for sign in layout.signs],
        "heads": [signal.position_m[:2] for signal in network.signals],
        "poles": [signal.pole_m[:2] for signal in network.signals],
    }
    return {kind: np.array(found) for kind, found in positions.items() if found}


@pytest.mark.parametrize(("junctions", "kinds"), [("traffic_light", {"heads", "poles"}), ("priority", {"signs"})])
def test_left_hand_nets_are_mirrored_right_hand_nets(tmp_path: Path, junctions: str, kinds: set[str]) -> None:
    right, left = (positions_m(grid(tmp_path, junctions, *options)) for options in ((), ("--lefthand",)))
    assert right.keys() == left.keys() == {"strips", "stop lines", "crosswalks"} | kinds
    middle_m = (right["strips"].min(axis=0) + right["strips"].max(axis=0)) / 2.0
    for kind, found_m in right.items():
        mirrored_m = middle_m + _MIRROR * (left[kind] - middle_m)
        apart_m = np.linalg.norm(mirrored_m[:, None] - found_m, axis=2)
        assert len(found_m) == len(mirrored_m) >= 8
        assert apart_m.min(axis=1).max() < 0.01, kind


@pytest.mark.parametrize(
    ("tag", "relation", "left_hand"),
    [
        ("", "", False),
        (LEFT, "", True),
        ("", BOUNDARY.format("left"), True),
        (LEFT, BOUNDARY.format("right"), False),
        ("", BOUNDARY.format("left").replace("boundary", "name"), False),
    ],
)
def test_driving_side_is_read_from_openstreetmap(tmp_path: Path, tag: str, relation: str, left_hand: bool) -> None:
    path = tmp_path / "street.osm"
    path.write_text(STREET.format(tag=tag, relation=relation))
    assert read_osm(path).left_hand is left_hand


@pytest.mark.parametrize(
    ("tag", "left_hand", "notes"),
    [
        ("", True, ("no tag says on which side traffic drives: it keeps to the left, by position",)),
        (LEFT.replace("left", "right"), False, ()),
    ],
)
def test_the_country_decides_where_no_tag_does(tmp_path: Path, tag: str, left_hand: bool, notes: tuple[str]) -> None:
    path = tmp_path / "greenwich.osm"
    path.write_text(STREET.format(tag=tag, relation="").replace('"50"', '"51.5"').replace('"8', '"0'))
    data = read_osm(path)
    assert (data.left_hand, sentences_of(path.name, data.findings)) == (left_hand, notes)


@pytest.mark.parametrize("tag", ["", LEFT])
def test_sidewalks_of_openstreetmap_stay_on_their_side_of_the_street(tmp_path: Path, tag: str) -> None:
    path = tmp_path / "street.osm"
    path.write_text(STREET.format(tag=tag, relation=""))
    strips = load_network(map_spec(str(path)), tmp_path).layout.strips
    (sidewalk,) = (strip for strip in strips if strip.kind == "sidewalk" and not strip.junction)
    assert sidewalk.center_m[:, 1].min() > 2.0, "north of an eastbound street"
    driving = [strip for strip in strips if strip.kind == "driving" and not strip.junction]
    assert len(driving) == 2
    for strip in driving:
        runs_east = strip.center_m[-1, 0] > strip.center_m[0, 0]
        assert (strip.center_m[:, 1].mean() > 0.0) == (runs_east == bool(tag))
