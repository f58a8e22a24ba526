"""OpenDRIVE from other writers: one road with all features of version 1.7, and SUMO's own export of its nets."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial.distance import pdist
from sumo_nets import generate_net
from xodr_sample import LINE, cubic, geometry, lane, linked, road, section, width, xodr

from simbev_ros.config.load import load_scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import ROAD_KINDS, LaneKind
from simbev_ros.maps.roads.surface import strip_polygons
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.simulation.world.simulation import Simulation

X_M, Y_M, Z_M = 691_000.5, 5_334_000.25, 480.0
HEADER = """<header revMajor="1" revMinor="7" name="x" version="1.00" north="1" south="0" east="1" west="0" vendor="V">
<geoReference><![CDATA[+proj=utm +zone=32 +datum=WGS84 +units=m +no_defs]]></geoReference>
<offset x="0" y="0" z="0" hdg="0"/></header>"""
ATTRIBUTES = 'level="false" direction="standard" dynamicLaneDirection="false" roadWorks="false"'
MARK = """<roadMark sOffset="0" type="solid" weight="standard" color="standard" material="standard" width="0.12"
laneChange="none" height="0.02"><type name="solid" width="0.12"><line length="0" space="0" tOffset="0" sOffset="0"/>
</type></roadMark>"""
SPEED = """<speed sOffset="0" max="30" unit="mph"/><speed sOffset="50" max="no limit"/><access sOffset="0" rule="allow"
restriction="bus"/><height sOffset="0" inner="0.1" outer="0.1"/><userData code="x" value="y"/>"""
OBJECTS = """<objects><object id="1" type="building" s="30" t="16" zOffset="0" hdg="0.1" orientation="none"><outlines>
<outline id="0" fillType="concrete" outer="true" closed="true"><cornerLocal u="-4" v="-4" z="0" height="8"/>
<cornerLocal u="4" v="-4" z="0" height="8"/><cornerLocal u="4" v="4" z="0" height="8"/></outline></outlines>
<repeat s="30" length="60" distance="25" tStart="16" tEnd="18" heightStart="8" heightEnd="12"/></object>
<object id="2" type="parkingSpace" s="160" t="-12" length="5" width="2.2"><parkingSpace access="car"/><markings>
<marking side="front" color="white" width="0.1" spaceLength="0" lineLength="1"/></markings></object>
<object id="3" type="barrier" s="0" t="12" height="0.8"><skeleton><polyline id="0"><vertexRoad id="0" s="1" t="1"/>
</polyline></skeleton></object><objectReference id="2" s="4" t="4" orientation="none"/>
<bridge id="b" s="150" length="30" type="concrete"/><tunnel id="t" s="190" length="10" type="standard"/></objects>
<signals><signal id="9" s="90" t="-7" dynamic="no" orientation="+" type="274" subtype="50" country="DE" zOffset="2"
value="50" unit="km/h"/></signals>"""
TYPES = """<type s="0" type="town" country="DE"><speed max="50" unit="km/h"/></type>
<type s="100" type="motorway"><speed max="70" unit="mph"/></type><type s="150" type="rural"><speed max="undefined"/>
</type>"""
CONFIG = """scenes: [{map: vendor.xodr, train: 1}]
rig: {sensors: [{type: imu, name: imu}]}
time: {tick_s: 0.1, warm_up_s: 1, duration_s: 10}
traffic: {vehicles: 8, pedestrians: 8, reckless_probability: 0}
"""


def lane_17(number: int, kind: str = "driving", width_m: float = 3.5, links: str = "", more: str = "") -> str:
    return lane(number, kind, links + width(width_m) + MARK + more, ATTRIBUTES)


def vendor_road() -> str:
    """300 m eastward in three lane sections, rising by 1 %, with an opening lane and a laneOffset."""
    same = [lane_17(1, links=linked(1, 1)), lane_17(-1, links=linked(-1, -1), more=SPEED)]
    walk, shoulder = (lambda n, to: lane_17(n, "sidewalk", 2.0, linked(n, to))), lane_17(-2, "shoulder", 1.0)
    opening = lane(-2, "driving", width(0, 0, 3 * 3.5 / 900, -2 * 3.5 / 27000) + width(3.5, at=30.0) + MARK, ATTRIBUTES)
    sections = [
        section(walk(2, 2), *same, shoulder, walk(-3, -4)),
        section(walk(2, 3), *same, opening, lane_17(-3, "shoulder", 1.0), walk(-4, -5), s=60.0),
        section(
            lane_17(3, "sidewalk", 2.0), lane_17(2, "biking", 1.5), *same, lane_17(-2), lane_17(-3, "parking", 2.2),
            lane_17(-4, "curb", 0.15), lane_17(-5, "walking", 2.0), s=140.0,
        ),
    ]  # fmt: skip
    heights = f"<elevationProfile>{cubic('elevation', Z_M, 0.01)}</elevationProfile>"
    banks = f"<lateralProfile>{cubic('superelevation', 0.0, 0.0005, s=220.0)}</lateralProfile>"
    offset = cubic("laneOffset", 0.0) + cubic("laneOffset", 0.0, 0.02, s=200.0)
    text = road(geometry(LINE, 300.0, x=X_M, y=Y_M), 300.0, sections, more=TYPES + heights + banks, offset=offset)
    return text.replace("</lanes>", "</lanes>" + OBJECTS).replace("<road ", '<road rule="RHT" ', 1)


VARIANTS = {
    "1.7": xodr(vendor_road(), header=HEADER),
    "namespace": xodr(vendor_road(), header=HEADER).replace("<OpenDRIVE>", '<OpenDRIVE xmlns="http://code.asam.net">'),
    "no header": xodr(vendor_road(), header=""),
    "left-hand": xodr(vendor_road(), header=HEADER).replace('"RHT"', '"LHT"'),
}


@pytest.mark.parametrize(
    "variant", ["1.7", *(pytest.param(name, marks=pytest.mark.slow) for name in list(VARIANTS)[1:])]
)
def test_a_road_with_all_features_of_version_1_7_is_read_and_driven(tmp_path: Path, variant: str) -> None:
    (tmp_path / "vendor.xodr").write_text(VARIANTS[variant])
    (tmp_path / "config.yaml").write_text(CONFIG)
    scenario = load_scenario(tmp_path / "config.yaml")
    (planned,) = planned_scenes(scenario)
    network = load_network(planned.map, tmp_path / "cache")
    assert {strip.kind for strip in network.layout.strips} >= {
        LaneKind.DRIVING, LaneKind.SIDEWALK, LaneKind.BICYCLE, LaneKind.PARKING, LaneKind.SHOULDER,
    }  # fmt: skip
    assert area_m2(network, LaneKind.DRIVING) == pytest.approx(2 * 3.5 * 300 + 3.5 * (15 + 50 + 160), rel=0.01)
    points_m = np.concatenate([strip.center_m for strip in network.layout.strips_of(LaneKind.DRIVING)])
    assert (points_m[:, 2].min(), points_m[:, 2].max()) == pytest.approx((Z_M, Z_M + 3.0), abs=0.3)
    speeds_mps = {round(strip.speed_mps, 2) for strip in network.layout.strips_of(LaneKind.DRIVING)}
    assert round(30 * 0.44704, 2) in speeds_mps
    if variant in ("1.7", "namespace"):
        assert network.datum.latitude_deg == pytest.approx(48.128, abs=0.01)
    with Simulation(draw_scene(scenario, planned, network), network) as simulation:
        states = [simulation.step() for _ in range(110)]
    kinds = np.array([blueprint.kind for blueprint in load_blueprints()])
    first, last = (state.actors[kinds[state.actors["blueprint"]] != "prop"] for state in (states[0], states[-1]))
    assert len(last) >= 17, "riders are extra"
    assert np.mean(np.hypot(last["x"] - first["x"], last["y"] - first["y"]) > 3.0) > 0.7


@pytest.mark.slow
def test_sumos_export_of_a_net_gives_the_same_roads(tmp_path: Path) -> None:
    net = tmp_path / "turns.net.xml"
    options = "--grid --grid.number 3 --default-junction-type traffic_light -L 2 "
    options += "--turn-lanes 1 --sidewalks.guess --bikelanes.guess --default.sidewalk-width 2"
    generate_net(net, *options.split())
    original = load_network(map_spec(str(net)), tmp_path / "cache")
    again = load_network(map_spec(str(original.opendrive_path)), tmp_path / "cache")
    first, second = (shapely.union_all(road_areas(network)) for network in (original, again))
    overlap = shapely.area(shapely.intersection(first, second)) / shapely.area(shapely.union(first, second))
    assert overlap > 0.95
    assert len(again.junctions) == len(original.junctions)
    heads_m = np.array([signal.position_m for signal in again.signals])
    assert {signal.lane for signal in again.signals}
    assert pdist(heads_m).min() > 0.3, "one head for all arrows of a lane"


def area_m2(network: RoadNetwork, *kinds: LaneKind) -> float:
    return float(shapely.area(strip_polygons(network.layout.strips_of(*kinds))).sum())


def road_areas(network: RoadNetwork) -> list[shapely.Geometry]:
    return [shapely.buffer(area, 0.001) for area in strip_polygons(network.layout.strips_of(*ROAD_KINDS))]
