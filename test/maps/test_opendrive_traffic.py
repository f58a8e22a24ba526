"""The SUMO net of OpenDRIVE files has the file's lanes and rules; vehicles and pedestrians reach their goals."""

import os
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
import xodr_sample as sample

from simbev_ros.maps.findings import sentences_of
from simbev_ros.maps.opendrive.importer import import_opendrive
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.sumo.net import SumoNet, read_sumo_net
from simbev_ros.maps.sumo.netconvert import sumo_home

_MAPS = Path(__file__).parents[2].parent / "shared" / "maps" / "carla"


def import_sample(tmp_path: Path, *content: str) -> tuple[MapParts, SumoNet]:
    path, work = tmp_path / "sample.xodr", tmp_path / "work"
    path.write_text(sample.xodr(*content), encoding="utf-8")
    work.mkdir()
    parts = import_opendrive(path, work)
    return parts, read_sumo_net(parts.net)


@pytest.fixture(scope="module", params=["Town01", pytest.param("Town04", marks=pytest.mark.slow)])
def town(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[MapParts, SumoNet]:
    path = _MAPS / f"{request.param}.xodr"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    parts = import_opendrive(path, tmp_path_factory.mktemp(request.param))
    return parts, read_sumo_net(parts.net)


def test_vehicles_use_driving_strips_and_pedestrians_use_sidewalks(town: tuple[MapParts, SumoNet]) -> None:
    parts, net = town
    for kind, tolerance_m in ((LaneKind.DRIVING, 0.05), (LaneKind.SIDEWALK, 0.05)):
        outlines = [
            shapely.make_valid(shapely.Polygon(np.concatenate([s.left_m[:, :2], s.right_m[::-1, :2]])))
            for s in parts.layout.strips_of(kind)
        ]
        area = shapely.union_all(outlines).buffer(tolerance_m)
        for lane in net.lanes.values():
            if lane.kind is kind:
                line = shapely.LineString(lane.centerline_m[:, :2])
                assert line.difference(area).length < 0.02 * line.length + 0.1, lane.id


def test_lanes_in_the_net_have_the_heights_of_strips(town: tuple[MapParts, SumoNet]) -> None:
    parts, net = town
    centers_m = np.concatenate([strip.center_m for strip in parts.layout.strips_of(LaneKind.DRIVING)])
    for lane in net.lanes.values():
        if lane.kind is LaneKind.DRIVING and not lane.junction:
            for end_m in lane.centerline_m[[0, -1]]:
                near = np.linalg.norm(centers_m[:, :2] - end_m[:2], axis=1) < 0.5
                assert np.abs(centers_m[near, 2] - end_m[2]).min() < 0.1, lane.id


def test_sidewalks_are_for_pedestrians_only_and_shoulders_are_closed(town: tuple[MapParts, SumoNet]) -> None:
    _, net = town
    assert {lane.kind for lane in net.lanes.values()} <= {
        LaneKind.DRIVING,
        LaneKind.SIDEWALK,
        LaneKind.CROSSING,
        LaneKind.WALKING_AREA,
    }
    assert all(lane.classes == {"pedestrian"} for lane in net.lanes.values() if lane.kind is LaneKind.SIDEWALK)
    assert not any("pedestrian" in lane.classes for lane in net.lanes.values() if lane.kind is LaneKind.DRIVING)


def test_every_traffic_light_of_the_file_stops_a_lane_that_the_net_controls(town: tuple[MapParts, SumoNet]) -> None:
    parts, net = town
    controlled = {link.lane for link in net.links}
    assert parts.layout.signal_places
    for place in parts.layout.signal_places:
        assert controlled.issuperset(place.lanes)
    ids = {element.get("id", "") for element in ElementTree.parse(parts.opendrive).iter("signal")}
    assert ids.issuperset(place.opendrive_id for place in parts.layout.signal_places)


@pytest.mark.slow
def test_vehicles_and_pedestrians_reach_their_destinations(town: tuple[MapParts, SumoNet], tmp_path: Path) -> None:
    parts, _ = town
    home = sumo_home()
    environment = {**os.environ, "SUMO_HOME": str(home)}
    trips, walks, statistics = (tmp_path / f"{name}.xml" for name in ("trips", "walks", "statistics"))
    common = ["-n", str(parts.net), "-e", "200", "--seed", "1", "--validate"]
    for target, options in ((trips, ["-p", "2"]), (walks, ["-p", "4", "--pedestrians", "--prefix", "p"])):
        command = ["python", str(home / "tools" / "randomTrips.py"), *common, *options, "-o", str(tmp_path / "t.xml")]
        subprocess.run([*command, "-r", str(target)], env=environment, check=True, capture_output=True, cwd=tmp_path)
    command = [str(home / "bin" / "sumo"), "-n", str(parts.net), "-r", f"{trips},{walks}", "--end", "900"]
    command += ["--lateral-resolution", "0.8", "--time-to-teleport", "300", "--statistic-output", str(statistics)]
    subprocess.run([*command, "--no-step-log"], env=environment, check=True, capture_output=True)
    root = ElementTree.parse(statistics).getroot()
    found = {element.tag: element.attrib for element in root}
    assert int(found["vehicles"]["inserted"]) >= 95
    assert found["vehicles"]["running"] == found["vehicles"]["waiting"] == found["teleports"]["total"] == "0"
    assert int(found["persons"]["loaded"]) >= 45
    assert found["persons"]["running"] == "0"


def test_roads_that_are_not_connected_carry_traffic_of_their_own_with_a_note(tmp_path: Path) -> None:
    island = sample.road(sample.geometry(sample.LINE, 30.0, y=500.0), 30.0, number="2")
    parts, net = import_sample(tmp_path, sample.straight_road(), island)
    assert {strip.road for strip in parts.layout.strips} == {"1", "2"}
    assert any(lane.centerline_m[:, 1].min() > 490.0 for lane in net.lanes.values())
    notes = sentences_of("sample.xodr", parts.findings)
    assert any("roads are in 2 parts that are not connected" in note and "(0.03 of" in note for note in notes)


def test_an_opening_lane_is_used_only_where_it_is_wide_enough(tmp_path: Path) -> None:
    opening = sample.width(0.0) + sample.width(0.0, 0.1, at=40.0) + sample.width(3.5, at=75.0)
    _, net = import_sample(
        tmp_path, sample.straight_road(sections=sample.section(sample.lane(-1), sample.lane(-2, inner=opening)))
    )
    driven = [lane for lane in net.lanes.values() if lane.kind is LaneKind.DRIVING and not lane.junction]
    starts_m = sorted(lane.centerline_m[0, 0] for lane in driven)
    assert starts_m[0] == pytest.approx(0.0, abs=0.01)
    assert starts_m[1:] == pytest.approx([starts_m[1]] * 2, abs=0.01)
    assert 60.0 <= starts_m[1] <= 65.1
    first = next(lane for lane in driven if lane.centerline_m[0, 0] < 1.0)
    assert len(first.successors) == 1


def test_a_closed_ring_can_be_driven(tmp_path: Path) -> None:
    radius_m = 30.0
    links = "".join(
        f'<{name} elementType="road" elementId="1" contactPoint="{end}"/>'
        for name, end in (("predecessor", "end"), ("successor", "start"))
    )
    lanes = sample.section(*(sample.lane(n, inner=sample.width(3.5) + sample.linked(n, n)) for n in (1, -1)))
    ring = sample.road(
        sample.geometry(f'<arc curvature="{1 / radius_m!r}"/>', 2 * np.pi * radius_m),
        2 * np.pi * radius_m,
        lanes,
        links=links,
    )
    _, net = import_sample(tmp_path, ring)
    for lane in net.lanes.values():
        seen = []
        while lane.id not in seen:
            seen.append(lane.id)
            lane = net.lanes[lane.successors[0]]
        assert len(seen) == 4


def test_stop_signs_make_their_road_wait(tmp_path: Path) -> None:
    def arm(number: int, heading_rad: float, more: str = "") -> str:
        x, y = (float(20.0 * f(heading_rad + np.pi)) for f in (np.cos, np.sin))
        plan = sample.geometry(sample.LINE, 80.0, x=4 * x + x, y=4 * y + y, hdg=heading_rad)
        link = '<successor elementType="junction" elementId="9"/>'
        return sample.road(plan, 80.0, sample.section(sample.lane(1), sample.lane(-1)), str(number), link, more)

    def way(
        number: int, start: int, goal: int, heading_rad: float, shape: str = sample.LINE, length: float = 40.0
    ) -> str:
        x, y = (float(20.0 * f(heading_rad + np.pi)) for f in (np.cos, np.sin))
        links = (
            f'<predecessor elementType="road" elementId="{start}" contactPoint="end"/>'
            f'<successor elementType="road" elementId="{goal}" contactPoint="end"/>'
        )
        lanes = sample.section(sample.lane(-1, inner=sample.width(3.5) + sample.linked(-1, 1)))
        plan = sample.geometry(shape, length, x=x, y=y, hdg=heading_rad)
        return sample.road(plan, length, lanes, str(number), links, junction="9")

    stop = '<signals><signal id="1" type="206" s="79" t="-5" orientation="+" dynamic="no"/></signals>'
    roads = [arm(1, 0.0), arm(2, np.pi), arm(3, np.pi / 2, stop), arm(4, -np.pi / 2, stop)]
    roads += [way(5, 1, 2, 0.0), way(6, 2, 1, np.pi), way(7, 3, 4, np.pi / 2), way(8, 4, 3, -np.pi / 2)]
    roads.append(way(10, 1, 3, 0.0, '<arc curvature="-0.05"/>', 10.0 * np.pi))
    connections = "".join(
        f'<connection id="{k}" incomingRoad="{a}" connectingRoad="{k}" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection>'
        for k, a in ((5, 1), (6, 2), (7, 3), (8, 4), (10, 1))
    )
    parts, net = import_sample(tmp_path, *roads, f'<junction id="9" name="">{connections}</junction>')
    waiting = {lane for sign in parts.layout.signs for lane in sign.lanes}
    assert len(waiting) == 2
    for lane, codes in net.right_of_way.items():
        if not net.lanes[lane].junction:
            assert ("s" in codes) == (lane in waiting)
    assert len(parts.layout.stop_lines) == 2
