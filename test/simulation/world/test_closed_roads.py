"""One-lane roads that a hazard closes: traffic detours, and barriers close the road."""

from functools import cache
from xml.etree import ElementTree

import numpy as np

from simbev_ros.config.rig import Rig
from simbev_ros.config.scenario import Scenario
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.drawing.draw_scene import PlannedScene, draw_scene
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.world.demand import demand_of
from simbev_ros.simulation.world.sumo.routes import Routes

TOWN = MapSpec(name="Town01", seed=0)


@cache
def network() -> RoadNetwork:
    return load_network(TOWN)


@cache
def scenes() -> tuple[SceneSpec, ...]:
    scenario = Scenario.model_validate(
        {
            "scenes": [{"map": TOWN.name, "train": 6}],
            "rig": Rig(sensors=()),
            "traffic": {"vehicles": 20, "pedestrians": 0, "spawn_radius_m": 250},
            "hazards": {"count": 2},
        }
    )
    return tuple(draw_scene(scenario, PlannedScene(number, TOWN, "train"), network()) for number in range(6))


def test_each_hazard_on_one_lane_roads_closes_its_road_with_barriers_at_the_start() -> None:
    for scene in scenes():
        assert len(scene.hazards) == 2
        for hazard in scene.hazards:
            assert {network().lanes[stretch.lane].edge for stretch in hazard.blocked} <= set(hazard.closed_edges)
            barriers_m = np.array([(p.x_m, p.y_m) for p in hazard.props if p.blueprint == "prop.barrier"])
            for edge in hazard.closed_edges:
                lane = next(each for each in network().lanes.values() if each.edge == edge and "bus" in each.classes)
                if any(network().lanes[before].junction for before in network().lanes if lane.id in _after(before)):
                    assert np.linalg.norm(barriers_m - lane.centerline_m[0, :2], axis=1).min() < 7.0


def _after(lane: str) -> tuple[str, ...]:
    return network().lanes[lane].successors


def test_no_route_enters_a_closed_road_and_vehicles_that_start_there_are_past_the_hazard() -> None:
    for scene in scenes():
        root = ElementTree.fromstring(demand_of(scene, network()).xml)
        for element in root.iter("route"):
            assert scene.closed_edges.isdisjoint(element.attrib["edges"].split()[1:])
        routes = Routes(scene, network(), {lane.edge for lane in network().lanes.values()})
        for number, vehicle in enumerate(scene.drivers):
            edge = network().lanes[vehicle.start.lane].edge
            assert scene.closed_edges.isdisjoint(routes.draw_extension(number, edge, 7).edges)
            if edge in scene.closed_edges:
                assert number > 0
                ends_m = [s.to_s_m for h in scene.hazards for s in h.blocked if s.lane == vehicle.start.lane]
                assert len(ends_m) == 1 and vehicle.start.s_m > ends_m[0]
