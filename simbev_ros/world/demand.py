"""SUMO's input for one scene: its vehicles and pedestrians with their types, routes and starts, as route file XML.

Names: vehicle k of the specification is ``v<k>``, pedestrian k is ``p<k>``.
"""

from collections.abc import Mapping
from functools import cache
from xml.etree import ElementTree

from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.blueprints import Blueprint
from simbev_ros.scene.random import stream
from simbev_ros.scene.spec import NS_PER_S, PedestrianSpec, SceneSpec, VehicleSpec
from simbev_ros.world.cast import blueprint_of
from simbev_ros.world.routes import StreetGraph, WalkGraph

_FOREVER_S = "1e8"
_START_MARGIN_M = 0.1
_SIDE_MARGIN_M = 0.2
_TYPE = {"speedDev": "0", "sigma": "0"}
# SUMO's junction model: such a driver stops for no light, sign, vehicle or person at a junction; it keeps off who drives ahead.
_RECKLESS = {
    "jmDriveAfterRedTime": _FOREVER_S,
    "jmDriveAfterYellowTime": _FOREVER_S,
    "jmIgnoreFoeProb": "1",
    "jmIgnoreFoeSpeed": "1000",
    "jmIgnoreJunctionFoeProb": "1",
    "impatience": "1",
}


def vehicle_name(index: int) -> str:
    """SUMO's id of a vehicle of the specification."""
    return f"v{index}"


def pedestrian_name(index: int) -> str:
    """SUMO's id of a pedestrian of the specification."""
    return f"p{index}"


def index_of(name: str) -> int:
    """Index in the specification of a vehicle's or pedestrian's name."""
    return int(name[1:])


def demand_xml(spec: SceneSpec, network: RoadNetwork, net: ElementTree.Element) -> str:
    """The route file.

    Args:
        spec: The scene.
        network: Its roads.
        net: Root of the same roads' SUMO net file, for the lanes' permissions and lengths.
    """
    duration_s = (spec.warm_up_ticks + spec.ticks) * spec.tick_ns / NS_PER_S
    lane_elements = {lane.attrib["id"]: lane.attrib for lane in net.iter("lane")}

    @cache
    def streets(sumo_class: str) -> StreetGraph:
        return StreetGraph(network, {lane: _allows(lane_elements[lane], sumo_class) for lane in lane_elements})

    fastest_mps = max(lane.speed_mps for lane in network.lanes.values())
    root = ElementTree.Element("routes")
    for index, vehicle in enumerate(spec.vehicles):
        blueprint = blueprint_of(vehicle.blueprint)
        length_m = duration_s * min(fastest_mps * vehicle.speed_factor, blueprint.max_speed_mps)
        rng = stream(spec.seed, f"{vehicle_name(index)}.route")
        route = streets(blueprint.sumo_class).route(vehicle.start.lane, length_m, rng)
        _add_vehicle(root, vehicle_name(index), vehicle, blueprint, route, lane_elements)
    walks = WalkGraph(network)
    for index, pedestrian in enumerate(spec.pedestrians):
        rng = stream(spec.seed, f"{pedestrian_name(index)}.walk")
        lane = network.lanes[pedestrian.start.lane]
        side_m = (lane.width_m / 2.0 - _SIDE_MARGIN_M) * float(rng.uniform(-1.0, 1.0))
        walk = walks.walk(lane.edge, duration_s * pedestrian.max_speed_mps, rng)
        _add_pedestrian(root, pedestrian_name(index), pedestrian, walk, side_m)
    return ElementTree.tostring(root, encoding="unicode")


def _allows(lane: Mapping[str, str], sumo_class: str) -> bool:
    """Whether SUMO lets a vehicle class use a lane."""
    allowed, disallowed = lane.get("allow", "all").split(), lane.get("disallow", "").split()
    return sumo_class not in disallowed and "all" not in disallowed and (allowed == ["all"] or sumo_class in allowed)


def _add_vehicle(
    root: ElementTree.Element,
    name: str,
    vehicle: VehicleSpec,
    blueprint: Blueprint,
    route: tuple[str, ...],
    lane_elements: Mapping[str, Mapping[str, str]],
) -> None:
    """One vehicle at rest with its front bumper at its start, and a type of its own."""
    length_m, width_m, height_m = blueprint.size_m
    own = {
        "id": name,
        "vClass": blueprint.sumo_class,
        "length": f"{length_m:g}",
        "width": f"{width_m:g}",
        "height": f"{height_m:g}",
        "accel": f"{blueprint.accel:g}",
        "decel": f"{blueprint.decel:g}",
        "maxSpeed": f"{blueprint.max_speed_mps:g}",
        "desiredMaxSpeed": f"{blueprint.max_speed_mps:g}",
        "minGap": repr(vehicle.min_gap_m),
        "speedFactor": repr(vehicle.speed_factor),
        "latAlignment": "right" if blueprint.sumo_class == "bicycle" else "center",
    }
    ElementTree.SubElement(root, "vType", {**_TYPE, **own, **(_RECKLESS if vehicle.reckless else {})})
    lane = lane_elements[vehicle.start.lane]
    start = {
        "depart": "0",
        "departLane": lane["index"],
        "departPos": repr(min(vehicle.start.s_m, float(lane["length"]) - _START_MARGIN_M)),
        "departSpeed": "0",
        "insertionChecks": "collision",
    }
    element = ElementTree.SubElement(root, "vehicle", {"id": name, "type": name, **start})
    ElementTree.SubElement(element, "route", {"edges": " ".join(route)})
    # Where a route had to end early, the vehicle stands there instead of vanishing.
    ElementTree.SubElement(element, "stop", {"edge": route[-1], "duration": _FOREVER_S})


def _add_pedestrian(
    root: ElementTree.Element, name: str, pedestrian: PedestrianSpec, walk: tuple[str, ...], side_m: float
) -> None:
    """One pedestrian at its start, ``side_m`` to the left of the sidewalk's centre line."""
    length_m, width_m, height_m = blueprint_of(pedestrian.blueprint).size_m
    own = {
        "id": name,
        "vClass": "pedestrian",
        "length": f"{length_m:g}",
        "width": f"{width_m:g}",
        "height": f"{height_m:g}",
        "maxSpeed": repr(pedestrian.max_speed_mps),
        "desiredMaxSpeed": repr(pedestrian.max_speed_mps),
        "speedFactor": "1",
    }
    ElementTree.SubElement(root, "vType", {**_TYPE, **own})
    start = {"id": name, "type": name, "depart": "0", "departPos": repr(pedestrian.start.s_m)}
    person = ElementTree.SubElement(root, "person", start)
    ElementTree.SubElement(person, "walk", {"edges": " ".join(walk), "departPosLat": repr(side_m)})
    ElementTree.SubElement(person, "stop", {"edge": walk[-1], "duration": _FOREVER_S})
